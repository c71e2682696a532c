// The Fisher matrix (7) of a design without a loop over its points.
//
// With s_k = vec(S_k), S_k = dy_k/dtheta, and T = sum_k s_k s_k^T, F = (2/L) sum_k S_k^T D^-1 S_k is a contraction of T with
// D^-1 over the output indices, for any D. Adding or removing a point, or changing D, costs O((n_y p)^2), whatever L is.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <limits>
#include <stdexcept>

namespace fisherpoint {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using MatrixView = Eigen::Map<const Matrix>;

// log det of symmetric matrices of one size by Cholesky after scaling their diagonal to one; minus infinity where one is not
// positive definite to working precision. Memory is taken once.
class LogDet {
 public:
  explicit LogDet(Eigen::Index size) : diagonal_(size), scale_(size), cholesky_(size) {}

  double operator()(const Matrix& a) {
    constexpr double singular = -std::numeric_limits<double>::infinity();
    diagonal_ = a.diagonal();
    if (!(diagonal_.array() > 0).all() || !a.allFinite()) return singular;
    scale_ = diagonal_.array().rsqrt();
    cholesky_.compute(scale_.asDiagonal() * a * scale_.asDiagonal());
    if (cholesky_.info() != Eigen::Success) return singular;
    const auto pivots = cholesky_.matrixLLT().diagonal().array();
    const double rounding = std::numeric_limits<double>::epsilon() * static_cast<double>(a.rows());
    if (!(pivots.square() > 4 * rounding).all()) return singular;
    return 2 * pivots.log().sum() + diagonal_.array().log().sum();
  }

 private:
  Eigen::VectorXd diagonal_, scale_;
  Eigen::LLT<Matrix> cholesky_;
};

inline double log_det(const Matrix& a) { return LogDet(a.rows())(a); }

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
    Room room(*this);
    return 2.0 / static_cast<double>(count_) * information(factor(d), room);
  }
  Matrix fisher(const OutputCovariance& d) const { return fisher(output_covariance(d)); }

  // log det (F + ridge I) of the design with each of n further points, one at a time (sign +1), or without each of n of its
  // points (-1). The ridge, a share of the prior's information, tells designs apart that are still singular. The last
  // parameters may be nuisance ones, of which each has unit information beforehand: then it is log det of the Schur complement
  // of their block, a ratio of determinants.
  void log_det_changed(int sign, std::size_t n, const double* s, const double* c, const OutputCovariance& d, double ridge,
                       int nuisance, double* out) const {
    const double count = static_cast<double>(count_) + sign;
    Eigen::LLT<Matrix> whitening(n_y_);
    Matrix before, white(n_y_, p_), own(p_, p_), fisher(p_, p_), block(nuisance, nuisance);
    Room room(*this);
    LogDet log_det_of(p_), log_det_of_nuisance(nuisance);
    if (!d.pooled) before = information(whitening = factor(d.given), room);
    std::fill_n(out, n, -std::numeric_limits<double>::infinity());
    if (count <= 0) return;
    for (std::size_t m = 0; m < n; ++m) {
      if (d.pooled) {
        whitening.compute(d.given + (predictive_ + sign * MatrixView(c + m * n_y_ * n_y_, n_y_, n_y_)) / count);
        if (whitening.info() != Eigen::Success) continue;
        before = information(whitening, room);
      }
      white = MatrixView(s + m * n_y_ * p_, n_y_, p_);
      whitening.matrixL().solveInPlace(white);
      own.noalias() = white.transpose() * white;
      fisher = 2.0 / count * (before + sign * own);
      fisher.diagonal().array() += ridge;
      if (nuisance > 0) fisher.diagonal().tail(nuisance).array() += 2.0 / count;
      out[m] = log_det_of(fisher);
      if (nuisance > 0) {
        block = fisher.bottomRightCorner(nuisance, nuisance);
        out[m] -= log_det_of_nuisance(block);
      }
    }
  }

 private:
  void change(const double* s, const double* c, int sign) {
    const Eigen::Map<const Eigen::VectorXd> column(s, n_y_ * p_);
    products_.noalias() += sign * (column * column.transpose());
    predictive_ += sign * MatrixView(c, n_y_, n_y_);
    count_ += sign;
  }

  // What the contraction below works on; taken once for many of them.
  struct Room {
    explicit Room(const FisherAccumulator& f)
        : half(f.n_y_, f.p_ * f.n_y_ * f.p_), block(f.n_y_, f.p_), sum(f.p_, f.p_), symmetric(f.p_, f.p_) {}
    Matrix half, block, sum, symmetric;
  };

  // sum_k S_k^T D^-1 S_k: with D = L L^T, both output indices of T are whitened by L^-1 and then traced over.
  const Matrix& information(const Eigen::LLT<Matrix>& d, Room& room) const {
    room.half = Eigen::Map<const Matrix>(products_.data(), n_y_, p_ * n_y_ * p_);
    d.matrixL().solveInPlace(room.half);
    room.sum.setZero();
    for (int i = 0; i < n_y_; ++i)
      for (int a = 0; a < p_; ++a) {
        room.block = Eigen::Map<const Matrix>(room.half.data() + (i * p_ + a) * n_y_ * p_, n_y_, p_);
        d.matrixL().solveInPlace(room.block);
        room.sum.row(a) += room.block.row(i);
      }
    room.symmetric = 0.5 * (room.sum + room.sum.transpose());
    return room.symmetric;
  }

  int n_y_, p_;
  Matrix products_;    // T, (n_y p, n_y p)
  Matrix predictive_;  // sum of the predictive covariances
  std::size_t count_ = 0;
};

}  // namespace fisherpoint
