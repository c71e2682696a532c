// Whitens what sensors with a memory measured, in a time that grows as the number of samples: a Kalman filter of the noise
// alone. The noise of an output is a white part and first-order Gauss-Markov parts; white parts of several outputs may be
// correlated.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <vector>

#include "fisherpoint/kernels/workers.hpp"

namespace fisherpoint {

// Covariance std^2 exp(-|t - t'| / correlation_time) between the samples of one output.
struct GaussMarkovPart {
  std::size_t output;
  double std;
  double correlation_time;
};

// Sequences of samples, one after the other, that are whitened alike; all arrays are C-contiguous.
struct NoisySequences {
  std::size_t count, samples, outputs, columns;
  const double* times;   // (count, samples), not descending
  const double* std;     // (count, samples, outputs), of the white parts
  const bool* measured;  // (count, samples, outputs)
};

class Whitening {
 public:
  // correlation (outputs, outputs) of the white parts; positive semi-definite.
  Whitening(std::size_t outputs, const double* correlation, std::vector<GaussMarkovPart> parts)
      : outputs_(outputs), correlation_(correlation, correlation + outputs * outputs), parts_(std::move(parts)) {
    std::vector<std::size_t> first(outputs);  // of the outputs that an output is correlated with, by whichever way
    std::iota(first.begin(), first.end(), std::size_t(0));
    for (std::size_t i = 0; i < outputs; ++i)
      for (std::size_t j = 0; j < i; ++j)
        if (correlation_[i * outputs + j] != 0 && first[i] != first[j]) {
          const auto [least, other] = std::minmax(first[i], first[j]);
          std::ranges::replace(first, std::size_t(other), std::size_t(least));
        }
    for (std::size_t i = 0; i < outputs; ++i) {
      if (first[i] != i) continue;
      Group group;
      for (std::size_t j = i; j < outputs; ++j)
        if (first[j] == i) group.outputs.push_back(j);
      for (const auto& part : parts_) {
        const auto at = std::ranges::find(group.outputs, part.output);
        if (at == group.outputs.end()) continue;
        group.parts.push_back(part);
        group.place.push_back(static_cast<std::size_t>(at - group.outputs.begin()));
      }
      groups_.push_back(std::move(group));
    }
  }

  // Whitens columns (count, samples, outputs, columns) in place: each becomes R^-1/2 times itself, with the Cholesky factor in
  // the order of time. Zero where nothing is measured. log_det (count,) becomes log det R of what is measured.
  void whiten(const NoisySequences& given, double* columns, double* log_det, const Workers& workers) const {
    const std::size_t blocks = std::max<std::size_t>(1, (given.columns + at_once - 1) / at_once),
                      each = groups_.size() * blocks;
    std::vector<double> logs(given.count * groups_.size());
    workers.for_each(given.count * each, [&](std::size_t item) {
      const std::size_t k = item / each, g = item % each / blocks, block = item % blocks;
      const double found = Filter(*this, groups_[g], given, k, block * at_once).run(columns);
      if (block == 0) logs[k * groups_.size() + g] = found;
    });
    for (std::size_t k = 0; k < given.count; ++k)
      log_det[k] = std::accumulate(&logs[k * groups_.size()], &logs[k * groups_.size()] + groups_.size(), 0.0);
  }

 private:
  static constexpr std::size_t at_once = 16;  // columns
  static constexpr double again = 1e-15;      // share of the variance that is rounding

  struct Group {
    std::vector<std::size_t> outputs;
    std::vector<GaussMarkovPart> parts;
    std::vector<std::size_t> place;  // of each part's output among these
  };

  // One group of outputs of one sequence, for some of the columns. State m: the parts, with covariance P.
  class Filter {
   public:
    Filter(const Whitening& of, const Group& group, const NoisySequences& given, std::size_t k, std::size_t first)
        : of_(of),
          group_(group),
          given_(given),
          k_(k),
          first_(first),
          n_(std::min(at_once, given.columns - first)),
          d_(group.parts.size()),
          m_(d_ * n_),
          p_(d_ * d_),
          phi_(d_),
          gain_(d_),
          rows_(group.outputs.size() * n_),
          h_(group.outputs.size() * d_),
          lower_(group.outputs.size() * group.outputs.size()),
          variance_(group.outputs.size()) {
      for (std::size_t i = 0; i < d_; ++i) p_[i * d_ + i] = square(group.parts[i].std);
    }

    double run(double* columns) {
      double log_det = 0;
      for (std::size_t s = 0; s < given_.samples; ++s) {
        if (s > 0) predict(s);
        read(s, columns);
        for (std::size_t i = 0; i < group_.outputs.size(); ++i) {
          double* const out = columns + at(s, i) * given_.columns + first_;
          if (given_.measured[at(s, i)])
            log_det += update(i, out);
          else
            std::fill_n(out, n_, 0.0);
        }
      }
      return log_det;
    }

   private:
    static double square(double a) { return a * a; }
    std::size_t at(std::size_t s, std::size_t i) const {
      return (k_ * given_.samples + s) * given_.outputs + group_.outputs[i];
    }

    void predict(std::size_t s) {
      const double* const t = given_.times + k_ * given_.samples;
      const double dt = t[s] - t[s - 1];
      for (std::size_t i = 0; i < d_; ++i) phi_[i] = std::exp(-dt / group_.parts[i].correlation_time);
      for (std::size_t i = 0; i < d_; ++i) {
        for (std::size_t j = 0; j < d_; ++j) p_[i * d_ + j] *= phi_[i] * phi_[j];
        p_[i * d_ + i] -= square(group_.parts[i].std) * std::expm1(-2 * dt / group_.parts[i].correlation_time);
        for (std::size_t c = 0; c < n_; ++c) m_[i * n_ + c] *= phi_[i];
      }
    }

    // The measured outputs of a sample with uncorrelated white parts: by L D L^T of the covariance of these, L unit triangular.
    void read(std::size_t s, const double* columns) {
      const std::size_t outputs = group_.outputs.size();
      for (std::size_t i = 0; i < outputs; ++i) {
        if (!given_.measured[at(s, i)]) continue;
        std::copy_n(columns + at(s, i) * given_.columns + first_, n_, &rows_[i * n_]);
        for (std::size_t a = 0; a < d_; ++a) h_[i * d_ + a] = group_.place[a] == i;
        variance_[i] = square(given_.std[at(s, i)]);
        for (std::size_t j = 0; j < i; ++j) {
          if (!given_.measured[at(s, j)]) continue;
          double& l = lower_[i * outputs + j];
          l = of_.correlation_[group_.outputs[i] * of_.outputs_ + group_.outputs[j]] * given_.std[at(s, i)] *
              given_.std[at(s, j)];
          for (std::size_t b = 0; b < j; ++b)
            if (given_.measured[at(s, b)]) l -= lower_[i * outputs + b] * lower_[j * outputs + b] * variance_[b];
          l = variance_[j] > 0 ? l / variance_[j] : 0.0;
          for (std::size_t c = 0; c < n_; ++c) rows_[i * n_ + c] -= l * rows_[j * n_ + c];
          for (std::size_t a = 0; a < d_; ++a) h_[i * d_ + a] -= l * h_[j * d_ + a];
        }
        for (std::size_t j = 0; j < i; ++j)
          if (given_.measured[at(s, j)]) variance_[i] -= square(lower_[i * outputs + j]) * variance_[j];
        variance_[i] = std::max(variance_[i], 0.0);
      }
    }

    // One output of a sample: the innovations in units of their standard deviation, and log of its square.
    double update(std::size_t i, double* out) {
      const double* const h = &h_[i * d_];
      double s = variance_[i];
      for (std::size_t a = 0; a < d_; ++a) {
        gain_[a] = 0;
        for (std::size_t b = 0; b < d_; ++b) gain_[a] += p_[a * d_ + b] * h[b];
        s += h[a] * gain_[a];
      }
      double stationary = 0;
      for (const auto& part : group_.parts) stationary += square(part.std);
      if (!(s > again * stationary)) {  // the same instant once more, without white noise: nothing new
        std::fill_n(out, n_, 0.0);
        return 0;
      }
      const double scale = 1 / std::sqrt(s);
      for (std::size_t c = 0; c < n_; ++c) {
        double e = rows_[i * n_ + c];
        for (std::size_t a = 0; a < d_; ++a) e -= h[a] * m_[a * n_ + c];
        out[c] = e * scale;
        for (std::size_t a = 0; a < d_; ++a) m_[a * n_ + c] += gain_[a] / s * e;
      }
      for (std::size_t a = 0; a < d_; ++a)
        for (std::size_t b = 0; b < d_; ++b) p_[a * d_ + b] -= gain_[a] * gain_[b] / s;
      return std::log(s);
    }

    const Whitening& of_;
    const Group& group_;
    const NoisySequences& given_;
    std::size_t k_, first_, n_, d_;
    std::vector<double> m_, p_, phi_, gain_, rows_, h_, lower_, variance_;
  };

  std::size_t outputs_;
  std::vector<double> correlation_;
  std::vector<GaussMarkovPart> parts_;
  std::vector<Group> groups_;
};

}  // namespace fisherpoint
