// The Fisher matrix (7) of a design without a loop over its points.
//
// With s_k = vec(S_k), S_k = dy_k/dtheta, and T = sum_k s_k s_k^T, F = (2/L) sum_k S_k^T D^-1 S_k is a contraction of T with
// D^-1 over the output indices, for any D. Adding or removing a point, or changing D, costs O((n_y p)^2), whatever L is.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <stdexcept>

namespace fisherpoint {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using MatrixView = Eigen::Map<const Matrix>;

// log det of a symmetric matrix by Cholesky after scaling its diagonal to one; minus infinity where it is not positive definite
// to working precision.
inline double log_det(const Matrix& a) {
  constexpr double singular = -std::numeric_limits<double>::infinity();
  const Eigen::VectorXd diagonal = a.diagonal();
  if (!(diagonal.array() > 0).all() || !a.allFinite()) return singular;
  const Eigen::VectorXd scale = diagonal.array().rsqrt();
  const Eigen::LLT<Matrix> cholesky(scale.asDiagonal() * a * scale.asDiagonal());
  if (cholesky.info() != Eigen::Success) return singular;
  const auto pivots = cholesky.matrixLLT().diagonal().array();
  const double rounding = std::numeric_limits<double>::epsilon() * static_cast<double>(a.rows());
  if (!(pivots.square() > 4 * rounding).all()) return singular;
  return 2 * pivots.log().sum() + diagonal.array().log().sum();
}

// Cholesky factor of an output covariance. Throws std::domain_error where it is not positive definite.
inline Eigen::LLT<Matrix> factor(const Matrix& d) {
  const Eigen::LLT<Matrix> cholesky(d);
  if (cholesky.info() != Eigen::Success || !(cholesky.matrixLLT().diagonal().array() > 0).all())
    throw std::domain_error("the output covariance D is not positive definite");
  return cholesky;
}

// D = given + (mean over the points of their predictive covariances, where pooled), (17).
struct OutputCovariance {
  Matrix given;
  bool pooled;
};

class FisherAccumulator {
 public:
  FisherAccumulator(int outputs, int parameters)
      : n_y_(outputs), p_(parameters), products_(Matrix::Zero(n_y_ * p_, n_y_ * p_)), predictive_(Matrix::Zero(n_y_, n_y_)) {}

  int outputs() const { return n_y_; }
  int parameters() const { return p_; }
  std::size_t count() const { return count_; }
  const Matrix& predictive_sum() const { return predictive_; }

  // s: dy/dtheta (n_y, p), row-major; c: predictive covariance (n_y, n_y).
  void add(const double* s, const double* c) { change(s, c, +1); }
  void remove(const double* s, const double* c) {
    if (count_ == 0) throw std::invalid_argument("remove: expected an accumulator with points, given an empty one");
    change(s, c, -1);
  }

  Matrix output_covariance(const OutputCovariance& d) const {
    return d.pooled && count_ > 0 ? Matrix(d.given + predictive_ / static_cast<double>(count_)) : d.given;
  }

  // F for a given D, with the 2/L of (7).
  Matrix fisher(const Matrix& d) const {
    if (count_ == 0) return Matrix::Zero(p_, p_);
    return 2.0 / static_cast<double>(count_) * information(factor(d));
  }
  Matrix fisher(const OutputCovariance& d) const { return fisher(output_covariance(d)); }

  // log det (F + ridge I) of the design with each of n further points, one at a time (sign +1), or without each of n of its
  // points (-1). The ridge, a share of the prior's information, tells designs apart that are still singular.
  void log_det_changed(int sign, std::size_t n, const double* s, const double* c, const OutputCovariance& d, double ridge,
                       double* out) const {
    const double count = static_cast<double>(count_) + sign;
    Eigen::LLT<Matrix> whitening;
    Matrix before;
    if (!d.pooled) {
      whitening = factor(d.given);
      before = information(whitening);
    }
    for (std::size_t m = 0; m < n; ++m) {
      const MatrixView sensitivity(s + m * n_y_ * p_, n_y_, p_), predictive(c + m * n_y_ * n_y_, n_y_, n_y_);
      if (count <= 0) {
        out[m] = -std::numeric_limits<double>::infinity();
        continue;
      }
      if (d.pooled) {
        whitening.compute(Matrix(d.given + (predictive_ + sign * predictive) / count));
        if (whitening.info() != Eigen::Success) {
          out[m] = -std::numeric_limits<double>::infinity();
          continue;
        }
        before = information(whitening);
      }
      const Matrix white = whitening.matrixL().solve(sensitivity);
      Matrix fisher = 2.0 / count * (before + sign * (white.transpose() * white));
      fisher.diagonal().array() += ridge;
      out[m] = log_det(fisher);
    }
  }

 private:
  void change(const double* s, const double* c, int sign) {
    const Eigen::Map<const Eigen::VectorXd> column(s, n_y_ * p_);
    products_.noalias() += sign * (column * column.transpose());
    predictive_ += sign * MatrixView(c, n_y_, n_y_);
    count_ += sign;
  }

  // sum_k S_k^T D^-1 S_k: with D = L L^T, both output indices of T are whitened by L^-1 and then traced over.
  Matrix information(const Eigen::LLT<Matrix>& d) const {
    Matrix half = Eigen::Map<const Matrix>(products_.data(), n_y_, p_ * n_y_ * p_);
    d.matrixL().solveInPlace(half);
    Matrix sum = Matrix::Zero(p_, p_), block(n_y_, p_);
    for (int i = 0; i < n_y_; ++i)
      for (int a = 0; a < p_; ++a) {
        block = Eigen::Map<const Matrix>(half.data() + (i * p_ + a) * n_y_ * p_, n_y_, p_);
        d.matrixL().solveInPlace(block);
        sum.row(a) += block.row(i);
      }
    return 0.5 * (sum + sum.transpose());
  }

  int n_y_, p_;
  Matrix products_;    // T, (n_y p, n_y p)
  Matrix predictive_;  // sum of the predictive covariances
  std::size_t count_ = 0;
};

}  // namespace fisherpoint
