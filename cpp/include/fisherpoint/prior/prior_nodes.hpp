// The prior as weighted nodes theta_r, which is all that a sum over it needs to know: either made one after the other
// (prior_grid.hpp) or stored (NodeTable, below).
#pragma once

#include <cmath>
#include <cstddef>
#include <memory>
#include <stdexcept>
#include <vector>

namespace fisherpoint {

class PriorNodes {
 public:
  // Stands at one node at a time; whoever works through a stretch of nodes asks for a cursor of its own.
  class Cursor {
   public:
    virtual ~Cursor() = default;
    virtual void advance() = 0;
    const double* theta() const { return theta_; }
    double weight() const { return weight_; }  // of any sign

   protected:
    const double* theta_ = nullptr;
    double weight_ = 0.0;
  };

  // Besides the mean; as many as are worth their time where steps are planned.
  static constexpr std::size_t most_pilots = 31;

  virtual ~PriorNodes() = default;
  virtual std::size_t size() const = 0;
  virtual int parameters() const = 0;
  virtual std::unique_ptr<Cursor> cursor(std::size_t node) const = 0;
  // Row by row, parameter sets near the edge of what the nodes cover: trajectories there stand for those of all nodes.
  virtual std::vector<double> pilots() const = 0;
};

// A few hundred or thousand nodes that follow no pattern which a cursor could walk.
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
  std::unique_ptr<Cursor> cursor(std::size_t node) const override { return std::make_unique<Row>(*this, node); }

 private:
  class Row final : public Cursor {
   public:
    Row(const NodeTable& table, std::size_t node) : table_(table), node_(node) { read(); }
    void advance() override {
      node_ = node_ + 1 < table_.size() ? node_ + 1 : 0;
      read();
    }

   private:
    void read() {
      theta_ = table_.theta_.data() + node_ * table_.parameters_;
      weight_ = table_.weight_[node_];
    }
    const NodeTable& table_;
    std::size_t node_;
  };

  std::vector<double> theta_, weight_, pilots_;
  int parameters_;
};

// Second moments of the nodes about the mean, in units of std: sum_r w_r d_r d_r^T / sum_r w_r with d = (theta - mean) / std,
// (parameters, parameters).
inline std::vector<double> second_moments(const PriorNodes& nodes, const double* mean, const double* std) {
  const int p = nodes.parameters();
  std::vector<double> moments(p * p, 0.0), deviation(p);
  double weights = 0;
  const auto node = nodes.cursor(0);
  for (std::size_t r = 0; r < nodes.size(); ++r, node->advance()) {
    for (int j = 0; j < p; ++j) deviation[j] = (node->theta()[j] - mean[j]) / std[j];
    for (int i = 0; i < p; ++i)
      for (int j = 0; j < p; ++j) moments[i * p + j] += node->weight() * deviation[i] * deviation[j];
    weights += node->weight();
  }
  for (double& moment : moments) moment /= weights;
  return moments;
}

}  // namespace fisherpoint
