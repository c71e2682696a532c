// The prior as weighted nodes theta_r, which is all that a sum over it needs to know: either made one after the other
// (prior_grid.hpp) or stored (NodeTable, below).
#pragma once

#include <algorithm>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <vector>

namespace fisherpoint {

class PriorNodes {
 public:
  // Besides the mean; as many as are worth their time where steps are planned.
  static constexpr std::size_t most_pilots = 31;

  virtual ~PriorNodes() = default;
  virtual std::size_t size() const = 0;
  virtual int parameters() const = 0;
  // theta (parameters, count), as packs take it, and weight (count,), of any sign, of the nodes from `first` on.
  virtual void read(std::size_t first, std::size_t count, double* theta, double* weight) const = 0;
  // Row by row, parameter sets near the edge of what the nodes cover: trajectories there stand for those of all nodes.
  virtual std::vector<double> pilots() const = 0;
};

// A few hundred or thousand nodes that follow no pattern.
class NodeTable final : public PriorNodes {
 public:
  // theta (size, parameters), weight (size,), pilots (any number up to most_pilots, parameters).
  NodeTable(std::vector<double> theta, std::vector<double> weight, std::vector<double> pilots)
      : theta_(std::move(theta)), weight_(std::move(weight)), pilots_(std::move(pilots)) {
    if (weight_.empty()) throw std::invalid_argument("nodes: expected at least one, given none");
    parameters_ = static_cast<int>(theta_.size() / weight_.size());
    if (pilots_.size() > most_pilots * parameters_)
      throw std::invalid_argument("pilots: expected at most " + std::to_string(most_pilots) + ", given more");
  }

  std::size_t size() const override { return weight_.size(); }
  int parameters() const override { return parameters_; }
  std::vector<double> pilots() const override { return pilots_; }
  void read(std::size_t first, std::size_t count, double* theta, double* weight) const override {
    for (int j = 0; j < parameters_; ++j)
      for (std::size_t r = first; r < first + count; ++r) *theta++ = theta_[r * parameters_ + j];
    std::copy_n(weight_.data() + first, count, weight);
  }

 private:
  std::vector<double> theta_, weight_, pilots_;
  int parameters_;
};

// Second moments of the nodes about the mean, in units of std: sum_r w_r d_r d_r^T / sum_r w_r with d = (theta - mean) / std,
// (parameters, parameters).
inline std::vector<double> second_moments(const PriorNodes& nodes, const double* mean, const double* std) {
  constexpr std::size_t block = 256;
  const int p = nodes.parameters();
  std::vector<double> moments(p * p, 0.0), deviation(p), theta(block * p), weight(block);
  double weights = 0;
  for (std::size_t first = 0; first < nodes.size(); first += block) {
    const std::size_t count = std::min(block, nodes.size() - first);
    nodes.read(first, count, theta.data(), weight.data());
    for (std::size_t r = 0; r < count; ++r) {
      for (int j = 0; j < p; ++j) deviation[j] = (theta[j * count + r] - mean[j]) / std[j];
      for (int i = 0; i < p; ++i)
        for (int j = 0; j < p; ++j) moments[i * p + j] += weight[r] * deviation[i] * deviation[j];
      weights += weight[r];
    }
  }
  for (double& moment : moments) moment /= weights;
  return moments;
}

}  // namespace fisherpoint
