#include <doctest/doctest.h>

#include <Eigen/Dense>
#include <random>
#include <vector>

#include "fisherpoint/kernels/column_division.hpp"

using namespace fisherpoint;
using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

TEST_CASE("columns are divided and weighed as one after the other, for any number of them") {
  std::mt19937 generator(5);
  std::normal_distribution<double> normal;
  for (const auto& [p, n, count] : {std::array{1, 1, 1}, {3, 2, 5}, {9, 4, 37}, {2, 7, 16}, {5, 5, 40}, {4, 9, 0}}) {
    CAPTURE(p);
    CAPTURE(n);
    Matrix half = Matrix::NullaryExpr(p, 2 * p, [&](auto...) { return normal(generator); });
    const Matrix fisher = half * half.transpose(), factor = Eigen::LLT<Matrix>(fisher).matrixL();
    std::vector<double> columns(std::size_t(p) * n * count), divided(columns.size()), gains(count);
    for (double& number : columns) number = normal(generator);
    const CandidateColumns given{p, n, std::size_t(count), columns.data()};
    ColumnDivision(given, factor.data()).divide(divided.data());
    ColumnDivision(given, factor.data()).gains(gains.data());
    for (int k = 0; k < count; ++k) {
      const Matrix w = Matrix::NullaryExpr(p, n, [&](auto i, auto a) { return columns[(i * n + a) * count + k]; });
      const Matrix g = Matrix::NullaryExpr(p, n, [&](auto i, auto a) { return divided[(i * n + a) * count + k]; });
      CHECK((factor * g - w).norm() < 1e-12 * w.norm());
      CHECK(gains[k] == doctest::Approx((fisher + w * w.transpose()).determinant() / fisher.determinant()).epsilon(1e-9));
    }
  }
}
