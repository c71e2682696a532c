#include <doctest/doctest.h>

#include <cmath>

#include "models.hpp"

using namespace fisherpoint;
using namespace fisherpoint::testing;

TEST_CASE("the oscillator's sensitivity is the closed form's") {
  const double w = 1.7, t = 3.0;
  const auto [y, outcome] =
      run<VariationalEquation, double>(Oscillator{}, std::array{1.0, 0.0}, std::array{0.0}, t, std::array{w}, {1e-10});
  CHECK(outcome.status[0] == Status::ok);
  CHECK(VariationalEquation<Oscillator, double>::entry<0, 0>(y) == doctest::Approx(-t * std::sin(w * t)).epsilon(1e-9));
}

TEST_CASE("the pattern of S follows from the types") {
  using E = VariationalEquation<HydraulicCylinder, double>;
  static_assert(E::size == 5 + 4 * 9);  // the spool's row is zero
  for (int j = 0; j < 9; ++j) {
    CHECK_FALSE(E::depends(4, j));
    CHECK(E::depends(0, j));
  }
  static_assert(E::output_depends<0>() && E::output_depends<1>() && E::output_depends<2>() && !E::output_depends<3>());
}

TEST_CASE("the cylinder's sensitivities against central differences of the trajectory") {
  const std::array x0 = {0.0777, 0.178, 8.99e6, 1.03e7, -0.62};
  const std::array u = {-0.86};
  const double dt = 5.7e-3;
  const auto [y, outcome] = run<VariationalEquation, double>(HydraulicCylinder{}, x0, u, dt, cylinder_theta, {1e-11});
  using E = VariationalEquation<HydraulicCylinder, double>;
  CHECK(outcome.status[0] == Status::ok);
  const auto shifted = [&](int j, double share) {
    auto theta = cylinder_theta;
    theta[j] *= 1 + share;
    return run<StateEquation, double>(HydraulicCylinder{}, x0, u, dt, theta, {1e-12}).first;
  };
  for_each_index<9>([&](auto j) {
    const auto up = shifted(j, 1e-3), down = shifted(j, -1e-3);
    for_each_index<4>([&](auto i) {
      const double scale = HydraulicCylinder::states[i].scale;
      const double difference = (up[i] - down[i]) / (2e-3 * scale), slope = E::entry<i, j>(y) * cylinder_theta[j] / scale;
      CHECK(slope == doctest::Approx(difference).epsilon(1e-4));
    });
  });
}
