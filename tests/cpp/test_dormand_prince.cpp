#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <vector>

#include "fisherpoint/dormand_prince.hpp"

using fisherpoint::DormandPrince;

// y' = y cos t, y = exp(sin t), on fixed steps.
static double f(double t, double y) { return y * std::cos(t); }
static double exact(double t) { return std::exp(std::sin(t)); }

struct Step {
  double end, error, middle;
};
static Step step(double t, double y, double h) {
  using M = DormandPrince;
  std::array<double, 7> k{};
  k[0] = f(t, y);
  double end = y;
  for (int s = 1; s < M::stages; ++s) {
    double sum = 0;
    for (int r = 0; r < s; ++r) sum += M::a[s][r] * k[r];
    end = y + h * sum;
    k[s] = f(t + M::c[s] * h, end);
  }
  double error = 0, bow = 0;
  for (int s = 0; s < M::stages; ++s) error += M::error[s] * k[s], bow += M::bow[s] * k[s];
  return {end, h * error, 0.5 * (y + end) + h / 8 * (k[0] - k[6]) + h * bow};
}
static double solve(double t, double y, double duration, int steps) {
  for (int i = 0; i < steps; ++i) y = step(t + i * duration / steps, y, duration / steps).end;
  return y;
}
static double slope(const std::vector<double>& errors) {  // of log2 over halvings, by least squares
  double sum = 0, n = static_cast<double>(errors.size());
  for (std::size_t i = 0; i < errors.size(); ++i) sum += (i - (n - 1) / 2) * std::log2(errors[i]);
  return -sum / (n * (n * n - 1) / 12);
}

TEST_CASE("global order 5, local error estimate of order 5, middle of the step of order 5, by slope") {
  std::vector<double> global, local, middle;
  for (int n = 32; n <= 256; n *= 2) global.push_back(std::abs(solve(0, 1, 3, n) - exact(3)));
  for (double h = 0.2; h > 0.02; h /= 2) {
    const Step s = step(0.3, exact(0.3), h);
    local.push_back(std::abs(s.error));
    middle.push_back(std::abs(s.middle - exact(0.3 + h / 2)));
  }
  CHECK(slope(global) == doctest::Approx(5).epsilon(0.04));
  CHECK(slope(local) == doctest::Approx(5).epsilon(0.04));
  CHECK(slope(middle) == doctest::Approx(5).epsilon(0.04));
}
