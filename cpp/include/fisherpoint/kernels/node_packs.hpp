// The nodes of a prior in packs, of which a block is read at once.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>

#include "fisherpoint/numbers/heap_array.hpp"
#include "fisherpoint/numbers/lanes.hpp"
#include "fisherpoint/prior/prior_nodes.hpp"

namespace fisherpoint {

template <class P>
class NodePacks {
  static constexpr std::size_t width = lanes_of<P>::width, block = 256;
  static_assert(block % width == 0 && sizeof(P) == width * sizeof(double));

 public:
  NodePacks(const PriorNodes& nodes, std::size_t begin, std::size_t end)
      : nodes_(nodes),
        next_(begin),
        end_(end),
        theta_(static_cast<int>(std::min(block, end - begin)) * nodes.parameters()),
        weight_(static_cast<int>(std::min(block, end - begin))) {}

  // The next pack's parameters, and weights where there is a node; the lanes behind the last node repeat its parameters.
  // Returns how many nodes there are.
  int next(auto& theta, P& weight) {
    if (at_ == count_) {
      count_ = std::min(block, end_ - next_);
      nodes_.read(next_, count_, theta_.data(), weight_.data());
      next_ += count_;
      at_ = 0;
    }
    const std::size_t from = at_, used = std::min(width, count_ - at_);
    at_ += used;
    if (used == width) {
      for (std::size_t j = 0; j < theta.size(); ++j) std::memcpy(&theta[j], &theta_[j * count_ + from], sizeof(P));
      std::memcpy(&weight, &weight_[from], sizeof(P));
      return width;
    }
    weight = P(0.0);
    for (std::size_t lane = 0; lane < width; ++lane) {
      const std::size_t node = from + std::min(lane, used - 1);
      for (std::size_t j = 0; j < theta.size(); ++j) lanes_of<P>::set(theta[j], lane, theta_[j * count_ + node]);
      if (lane < used) lanes_of<P>::set(weight, lane, weight_[node]);
    }
    return static_cast<int>(used);
  }

 private:
  const PriorNodes& nodes_;
  std::size_t next_, end_, at_ = 0, count_ = 0;  // nodes that are not read yet; in the block
  HeapArray<double> theta_, weight_;             // (parameters, count), (count,)
};

}  // namespace fisherpoint
