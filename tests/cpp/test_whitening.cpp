// The filter against the Cholesky factor of the whole covariance, in the order of time.
#include <doctest/doctest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "fisherpoint/kernels/whitening.hpp"

using namespace fisherpoint;

namespace {

constexpr std::size_t n = 9, n_y = 3, columns = 18;

struct Sequence {
  std::vector<double> times, std, values;
  std::unique_ptr<bool[]> measured = std::make_unique<bool[]>(n * n_y);

  Sequence() {
    for (std::size_t s = 0; s < n; ++s) times.push_back(0.1 * double(s * s));
    for (std::size_t i = 0; i < n * n_y; ++i) {
      std.push_back(0.2 + 0.05 * double(i % 4));
      measured[i] = i % 5 != 2;
    }
    for (std::size_t i = 0; i < n * n_y * columns; ++i) values.push_back(std::sin(double(i * i)));
  }

  NoisySequences given() const { return {1, n, n_y, columns, times.data(), std.data(), measured.get()}; }
};

}  // namespace

TEST_CASE("Noise with a memory, correlated outputs and missing numbers are whitened as by a whole matrix") {
  const double correlation[] = {1, 0, 0.5, 0, 1, 0, 0.5, 0, 1};
  const std::vector<GaussMarkovPart> parts = {{0, 0.3, 2.0}, {0, 0.5, 0.1}, {1, 0.4, 1.0}};
  const Sequence of;
  std::vector<std::size_t> there;
  for (std::size_t i = 0; i < n * n_y; ++i)
    if (of.measured[i]) there.push_back(i);
  const auto m = static_cast<Eigen::Index>(there.size());
  Eigen::MatrixXd r = Eigen::MatrixXd::Zero(m, m), c(m, columns);
  for (Eigen::Index a = 0; a < m; ++a) {
    const std::size_t i = there[a];
    for (std::size_t k = 0; k < columns; ++k) c(a, Eigen::Index(k)) = of.values[i * columns + k];
    for (Eigen::Index b = 0; b < m; ++b) {
      const std::size_t j = there[b];
      if (i / n_y == j / n_y) r(a, b) += correlation[i % n_y * n_y + j % n_y] * of.std[i] * of.std[j];
      for (const auto& part : parts)
        if (i % n_y == part.output && j % n_y == part.output)
          r(a, b) += part.std * part.std * std::exp(-std::abs(of.times[i / n_y] - of.times[j / n_y]) / part.correlation_time);
    }
  }
  const Eigen::LLT<Eigen::MatrixXd> factor(r);
  const Eigen::MatrixXd expected = factor.matrixL().solve(c), l = factor.matrixL();

  std::vector<double> first;
  for (const int threads : {1, 3}) {
    std::vector<double> white = of.values, log_det(1);
    Whitening(n_y, correlation, parts).whiten(of.given(), white.data(), log_det.data(), Workers(threads));
    CHECK(log_det[0] == doctest::Approx(2 * l.diagonal().array().log().sum()).epsilon(1e-12));
    for (Eigen::Index a = 0; a < m; ++a)
      for (std::size_t k = 0; k < columns; ++k)
        CHECK(white[there[a] * columns + k] == doctest::Approx(expected(a, Eigen::Index(k))).epsilon(1e-10));
    for (std::size_t i = 0; i < n * n_y; ++i)
      if (!of.measured[i]) CHECK(white[i * columns] == 0);
    if (threads == 1) first = white;
    CHECK(std::ranges::equal(white, first));
  }
}
