#include <doctest/doctest.h>

#include <Eigen/LU>
#include <cmath>

#include "fisherpoint/kernels/fisher_accumulator.hpp"

using namespace fisherpoint;

static Matrix random_matrix(int rows, int cols, unsigned seed) {
  std::srand(seed);
  return Matrix::Random(rows, cols);
}

TEST_CASE("the contraction is the sum over the points, for any D") {
  constexpr int n_y = 3, p = 4, points = 6;
  FisherAccumulator f(n_y, p);
  Matrix plain = Matrix::Zero(p, p), d = random_matrix(n_y, n_y, 1);
  d = (d * d.transpose() + Matrix::Identity(n_y, n_y)).eval();
  const Matrix none = Matrix::Zero(n_y, n_y);
  for (int k = 0; k < points; ++k) {
    const Matrix s = random_matrix(n_y, p, 10 + k);
    f.add(s.data(), none.data());
    plain += 2.0 / points * s.transpose() * d.inverse() * s;
  }
  CHECK((f.fisher(d) - plain).norm() < 1e-13 * plain.norm());
  CHECK(log_det(f.fisher(d)) == doctest::Approx(std::log(plain.determinant())));

  const Matrix extra = random_matrix(n_y, p, 99), spread = d;
  const OutputCovariance pooled{d, true};
  double predicted;
  f.log_det_changed(+1, 1, extra.data(), spread.data(), pooled, 0.0, 0, &predicted);
  FisherAccumulator more = f;
  more.add(extra.data(), spread.data());
  CHECK(predicted == doctest::Approx(log_det(more.fisher(pooled.given + spread / 7.0))).epsilon(1e-12));
  more.log_det_changed(-1, 1, extra.data(), spread.data(), pooled, 0.0, 0, &predicted);
  CHECK(predicted == doctest::Approx(log_det(f.fisher(d))).epsilon(1e-10));
  more.remove(extra.data(), spread.data());
  CHECK((more.fisher(d) - plain).norm() < 1e-12 * plain.norm());
}

TEST_CASE("nuisance parameters, of which something is known, are marginalised") {
  constexpr int n_y = 2, p = 4, nuisance = 2, points = 5;
  FisherAccumulator f(n_y, p);
  Matrix sum = Matrix::Zero(p, p);
  const Matrix none = Matrix::Zero(n_y, n_y);
  for (int k = 0; k < points; ++k) {
    const Matrix s = random_matrix(n_y, p, 20 + k);
    f.add(s.data(), none.data());
    sum += s.transpose() * s;
  }
  const Matrix extra = random_matrix(n_y, p, 77);
  sum += extra.transpose() * extra;
  sum.diagonal().tail(nuisance).array() += 1;
  const Matrix marginal = sum.inverse().topLeftCorner(p - nuisance, p - nuisance).inverse() * 2.0 / (points + 1);
  double predicted;
  f.log_det_changed(+1, 1, extra.data(), none.data(), {Matrix::Identity(n_y, n_y), false}, 0.0, nuisance, &predicted);
  CHECK(predicted == doctest::Approx(std::log(marginal.determinant())).epsilon(1e-12));
}

TEST_CASE("singular is minus infinity, whatever the scales") {
  Matrix a = Matrix::Identity(3, 3);
  a(2, 2) = 1e-20;
  CHECK(log_det(a) == doctest::Approx(std::log(1e-20)));
  const Matrix v = random_matrix(3, 2, 5);
  CHECK(std::isinf(log_det(v * v.transpose())));
  CHECK(std::isinf(log_det(Matrix::Zero(2, 2))));
  Matrix bad = Matrix::Identity(2, 2);
  bad(0, 1) = bad(1, 0) = std::nan("");
  CHECK(std::isinf(log_det(bad)));
  CHECK_THROWS_AS(factor(Matrix::Zero(2, 2)), std::domain_error);
}
