// Whose trajectories stand for those of all nodes: the mean's, then the nodes' own pilots.
#pragma once

#include <cstddef>
#include <vector>

#include "fisherpoint/prior/prior_nodes.hpp"

namespace fisherpoint {

struct Pilots {
  std::size_t nodes;  // that they stand for
  int count;
  std::vector<double> theta;  // row by row

  Pilots(const double* mean, const PriorNodes& nodes) : nodes(nodes.size()), theta(mean, mean + nodes.parameters()) {
    const std::vector<double> others = nodes.pilots();
    theta.insert(theta.end(), others.begin(), others.end());
    count = static_cast<int>(theta.size() / nodes.parameters());
  }
  const double* operator[](int k) const { return theta.data() + k * (theta.size() / count); }
};

}  // namespace fisherpoint
