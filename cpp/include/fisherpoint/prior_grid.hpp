// The prior on a tensor grid (11)-(13): each axis holds the values of one parameter and the probabilities of its cells. Nodes
// are numbered with the last parameter running fastest and made one after the other, never stored: R may be millions.
#pragma once

#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>
#include <vector>

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

class PriorGrid {
 public:
  explicit PriorGrid(std::vector<Axis> axes) : axes_(std::move(axes)) {
    for (const Axis& axis : axes_) size_ *= axis.values.size();
  }

  std::size_t size() const { return size_; }
  const std::vector<Axis>& axes() const { return axes_; }
  int parameters() const { return static_cast<int>(axes_.size()); }

  // Walks over the nodes like an odometer: a step costs what the digits that turn cost.
  class Cursor {
   public:
    Cursor(const PriorGrid& grid, std::size_t node)
        : axes_(grid.axes_), digit_(axes_.size()), theta_(axes_.size()), product_(axes_.size() + 1, 1.0) {
      for (std::size_t j = axes_.size(); j-- > 0;) {
        digit_[j] = node % axes_[j].values.size();
        node /= axes_[j].values.size();
      }
      refresh(0);
    }
    const double* theta() const { return theta_.data(); }
    double probability() const { return product_.back(); }
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
        theta_[j] = axes_[j].values[digit_[j]];
        product_[j + 1] = product_[j] * axes_[j].probabilities[digit_[j]];
      }
    }
    std::span<const Axis> axes_;
    std::vector<std::size_t> digit_;
    std::vector<double> theta_, product_;
  };

 private:
  std::vector<Axis> axes_;
  std::size_t size_ = 1;
};

}  // namespace fisherpoint
