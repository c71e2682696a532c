#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <vector>

#include "fisherpoint/integration/dormand_prince.hpp"
#include "fisherpoint/integration/dormand_prince_853.hpp"
#include "fisherpoint/integration/tableau.hpp"

using namespace fisherpoint;

// y' = y cos t, y = exp(sin t), on fixed steps.
static double f(double t, double y) { return y * std::cos(t); }
static double exact(double t) { return std::exp(std::sin(t)); }

struct Tried {
  double end, error, middle;
};
template <class M>
static Tried tried(double t, double y, double h) {
  constexpr int last = M::stages - 1;
  std::array<double, M::stages> k{};
  k[0] = f(t, y);
  double end = y;
  for (int s = 1; s <= last; ++s) {
    double sum = 0;
    for (int r = 0; r < s; ++r) sum += M::a[s][r] * k[r];
    end = y + h * sum;
    k[s] = f(t + M::c[s] * h, end);
  }
  double error = 0, bow = 0, coarse = 0;
  for (int s = 0; s <= last; ++s) error += M::error[s] * k[s], bow += M::bow[s] * k[s];
  const double middle = 0.5 * (y + end) + h / 8 * (k[0] - k[last]) + h * bow;
  error *= h;
  for (int s = 0; s < last; ++s) coarse += M::coarse[s] * k[s];
  coarse = end - y - h * coarse;
  return {end, std::sqrt(M::squared_error(error * error, coarse * coarse)), middle};
}
template <class M>
static double solve(double t, double y, double duration, int steps) {
  for (int i = 0; i < steps; ++i) y = tried<M>(t + i * duration / steps, y, duration / steps).end;
  return y;
}
static double slope(const std::vector<double>& errors) {  // of log2 over halvings, by least squares
  double sum = 0, n = static_cast<double>(errors.size());
  for (std::size_t i = 0; i < errors.size(); ++i) sum += (i - (n - 1) / 2) * std::log2(errors[i]);
  return -sum / (n * (n * n - 1) / 12);
}

struct Orders {
  double global, estimate, middle;
};
// By slope: from `steps` steps over three units of time on, doubled `doublings` times; locally from `h` on, halved four times.
// Where the estimate is taken, none of the derivatives that it sees vanishes.
template <class M>
static Orders orders(int steps, int doublings, double h, double estimated_at, double estimated_h) {
  std::vector<double> global, estimate, middle;
  for (int n = steps; n <= steps << doublings; n *= 2) global.push_back(std::abs(solve<M>(0, 1, 3, n) - exact(3)));
  for (int i = 0; i < 4; ++i, h /= 2, estimated_h /= 2) {
    estimate.push_back(tried<M>(estimated_at, exact(estimated_at), estimated_h).error);
    middle.push_back(std::abs(tried<M>(0.3, exact(0.3), h).middle - exact(0.3 + h / 2)));
  }
  return {slope(global), slope(estimate), slope(middle)};
}

TEST_CASE("orders by slope of the end, the error that controls the step, and the middle of a step") {
  const Orders of_54 = orders<DormandPrince>(32, 3, 0.2, 0.3, 0.2);
  CHECK(of_54.global == doctest::Approx(5).epsilon(0.04));
  CHECK(of_54.estimate == doctest::Approx(5).epsilon(0.04));
  CHECK(of_54.middle == doctest::Approx(5).epsilon(0.04));
  const Orders of_853 = orders<DormandPrince853>(6, 2, 0.4, 1.5, 0.8);
  CHECK(of_853.global == doctest::Approx(8).epsilon(0.05));
  CHECK(of_853.estimate == doctest::Approx(8).epsilon(0.05));
  CHECK(of_853.middle == doctest::Approx(7).epsilon(0.05));  // local: order six
}

TEST_CASE("the sum for a stage begins that for the next one where both have weights for the same stages before it") {
  const auto begun = [](const Tableau& method) {
    std::vector<int> stages;
    for (int s = 0; s < Tableau::most_stages; ++s)
      if (method.begun_before[s]) stages.push_back(s);
    return stages;
  };
  CHECK(begun(Tableau(DormandPrince{})) == std::vector{5});
  CHECK(begun(Tableau(DormandPrince853{})) == std::vector{7, 9, 11});
}
