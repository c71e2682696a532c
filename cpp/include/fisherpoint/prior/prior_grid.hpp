// The prior on a tensor grid (11)-(13): each axis holds the values of one coordinate and the probabilities of its cells. Nodes
// are numbered with the last axis running fastest and made one after the other, never stored: R may be millions.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <optional>
#include <span>
#include <vector>

#include "fisherpoint/numbers/shelves.hpp"
#include "fisherpoint/prior/prior_nodes.hpp"

namespace fisherpoint {

// Probability of a standard normal variable in (a, b): erfc on the side of the mean where it is small, so that cells far out
// keep their digits. (12) is read with a negative exponent.
inline double normal_probability(double a, double b) {
  const double s = 1.0 / std::numbers::sqrt2;
  if (a > 0) return 0.5 * (std::erfc(a * s) - std::erfc(b * s));
  if (b < 0) return 0.5 * (std::erfc(-b * s) - std::erfc(-a * s));
  return 0.5 * (std::erf(b * s) - std::erf(a * s));
}

struct Axis {
  std::vector<double> values, probabilities;
};

// Cells between neighbouring edges, in standard deviations: their middles, with their probabilities.
inline Axis cells_between(std::span<const double> edges) {
  Axis axis;
  for (std::size_t i = 0; i + 1 < edges.size(); ++i) {
    axis.values.push_back((edges[i] + edges[i + 1]) / 2);
    axis.probabilities.push_back(normal_probability(edges[i], edges[i + 1]));
  }
  return axis;
}

// `levels` equidistant values from mean - span std to mean + span std, each with the probability of its cell of one spacing's
// width; a single level is the mean with probability 1.
inline Axis cells(double mean, double std, int levels, double span) {
  if (levels == 1) return {{mean}, {1.0}};
  Axis axis;
  const double half_width = span / (levels - 1);
  for (int i = 0; i < levels; ++i) {
    const double z = span * (2 * i - (levels - 1)) / (levels - 1);
    axis.values.push_back(mean + z * std);
    axis.probabilities.push_back(normal_probability(z - half_width, z + half_width));
  }
  return axis;
}

// From coordinates z of independent standard normal variables to parameters: theta = center + matrix z, then the exponential
// for the log-normal ones.
struct Coordinates {
  std::vector<double> center, matrix;  // (p,), (p, p) row by row
  std::vector<char> exponential;       // (p,)
};

class PriorGrid final : public PriorNodes {
 public:
  // The axes hold parameters, or z where coordinates are given.
  explicit PriorGrid(std::vector<Axis> axes, std::optional<Coordinates> coordinates = std::nullopt)
      : axes_(std::move(axes)), coordinates_(std::move(coordinates)) {
    for (const Axis& axis : axes_) size_ *= axis.values.size();
  }

  std::size_t size() const override { return size_; }
  int parameters() const override { return static_cast<int>(axes_.size()); }
  void read(std::size_t first, std::size_t count, double* theta, double* weight) const override {
    Odometer node(*this, digits(first));
    for (std::size_t r = 0; r < count; ++r) {
      if (r > 0) node.advance();
      for (std::size_t j = 0; j < axes_.size(); ++j) theta[j * count + r] = node.theta()[j];
      weight[r] = node.weight();
    }
  }

  // A two-level fractional factorial over the outermost values of the axes: every combination of three axes' ends appears as
  // long as there are no more than 16 axes.
  std::vector<double> pilots() const override {
    std::vector<double> theta;
    for (std::size_t k = 1; k <= most_pilots; ++k) {
      ShelfVector<std::size_t> digit;
      for (std::size_t j = 0; j < axes_.size(); ++j) digit.push_back(high(k, j) ? axes_[j].values.size() - 1 : 0);
      const Odometer corner(*this, std::move(digit));
      theta.insert(theta.end(), corner.theta(), corner.theta() + axes_.size());
    }
    return theta;
  }

  // Whether axis j is at its upper end in pilot k > 0: the parity of the bits of k that the axis' mask picks. Masks of odd
  // weight make every three of them independent.
  static bool high(std::size_t k, std::size_t j) {
    constexpr std::array<std::size_t, 16> masks = {1, 2, 4, 8, 16, 7, 11, 13, 14, 19, 21, 22, 25, 26, 28, 31};
    return std::popcount(k & masks[j % 16]) % 2 == 1;
  }

 private:
  // A step costs what the digits that turn cost.
  class Odometer {
   public:
    Odometer(const PriorGrid& grid, ShelfVector<std::size_t> digit)
        : axes_(grid.axes_),
          coordinates_(grid.coordinates_ ? &*grid.coordinates_ : nullptr),
          digit_(std::move(digit)),
          parameter_(axes_.size()),
          product_(axes_.size() + 1, 1.0) {
      if (coordinates_) {
        partial_.resize((axes_.size() + 1) * axes_.size());
        std::copy(coordinates_->center.begin(), coordinates_->center.end(), partial_.begin());
      }
      refresh(0);
    }
    const double* theta() const { return parameter_.data(); }
    double weight() const { return product_.back(); }
    void advance() {
      std::size_t j = axes_.size();
      while (j-- > 0) {
        if (++digit_[j] < axes_[j].values.size()) break;
        digit_[j] = 0;
      }
      refresh(j < axes_.size() ? j : 0);
    }

   private:
    void refresh(std::size_t from) {
      for (std::size_t j = from; j < axes_.size(); ++j) {
        parameter_[j] = axes_[j].values[digit_[j]];
        product_[j + 1] = product_[j] * axes_[j].probabilities[digit_[j]];
      }
      if (!coordinates_) return;
      for (std::size_t j = from; j < axes_.size(); ++j) add_column(j, axes_[j].values[digit_[j]]);
      for (std::size_t i = 0; i < axes_.size(); ++i) {
        const double sum = partial_[axes_.size() * axes_.size() + i];
        parameter_[i] = coordinates_->exponential[i] ? std::exp(sum) : sum;
      }
    }
    // center + the first j columns of the matrix times z are kept, so that a node does not depend on where the walk began.
    void add_column(std::size_t j, double z) {
      const std::size_t p = axes_.size();
      for (std::size_t i = 0; i < p; ++i) partial_[(j + 1) * p + i] = partial_[j * p + i] + coordinates_->matrix[i * p + j] * z;
    }

    std::span<const Axis> axes_;
    const Coordinates* coordinates_;
    ShelfVector<std::size_t> digit_;
    ShelfVector<double> parameter_, product_, partial_;
  };

  ShelfVector<std::size_t> digits(std::size_t node) const {
    ShelfVector<std::size_t> digit(axes_.size());
    for (std::size_t j = axes_.size(); j-- > 0;) {
      digit[j] = node % axes_[j].values.size();
      node /= axes_[j].values.size();
    }
    return digit;
  }

  std::vector<Axis> axes_;
  std::optional<Coordinates> coordinates_;
  std::size_t size_ = 1;
};

}  // namespace fisherpoint
