#include <doctest/doctest.h>

#include <cmath>

#include "fisherpoint/kernels/sensitivities.hpp"
#include "fisherpoint/kernels/simulate.hpp"
#include "models.hpp"

using namespace fisherpoint;
using namespace fisherpoint::testing;

TEST_CASE("the right-hand side by hand") {
  const HydraulicCylinder m;
  const auto f = [&](double x_v, double v) {
    const std::array x = {0.1, v, 8e6, 5e6, x_v};
    return m.dynamics(cylinder_theta)(x, std::array{0.5}, std::array{v < 0 ? -1.0 : 1.0, x_v < 0 ? -1.0 : 1.0});
  };
  const double V_A = 1.9635e-3 * 0.1 + 5e-5, V_B = 9.4562e-4 * 0.2 + 4e-5;
  const double leak_A = 2.5e-9 * (std::sqrt(13e6) - std::sqrt(7.5e6)), leak_B = 2.5e-9 * (std::sqrt(16e6) - std::sqrt(4.5e6));
  const auto [q1, v1, a1, b1, x1] = f(0.5, 0.2);
  CHECK(q1 == 0.2);
  CHECK(v1 == doctest::Approx((1.9635e-3 * 8e6 - 9.4562e-4 * 5e6 - 400 - 1500 * 0.2) / 150));
  CHECK(a1 == doctest::Approx(1.2e9 / V_A * (0.5 * 1.782e-7 * std::sqrt(13e6) + leak_A - 0.2 * 1.9635e-3)));
  CHECK(b1 == doctest::Approx(1.2e9 / V_B * (-0.5 * 1.782e-7 * std::sqrt(4.5e6) + leak_B + 0.2 * 9.4562e-4)));
  CHECK(x1 == doctest::Approx((-0.5 - 0.5) / 2.2e-3));
  const auto [q2, v2, a2, b2, x2] = f(-0.5, -0.2);
  CHECK(v2 == doctest::Approx((1.9635e-3 * 8e6 - 9.4562e-4 * 5e6 + 400 + 1500 * 0.2) / 150));
  CHECK(a2 == doctest::Approx(1.2e9 / V_A * (-0.5 * 1.782e-7 * std::sqrt(7.5e6) + leak_A + 0.2 * 1.9635e-3)));
  CHECK(b2 == doctest::Approx(1.2e9 / V_B * (0.5 * 1.782e-7 * std::sqrt(16e6) + leak_B - 0.2 * 9.4562e-4)));
}

TEST_CASE("a batch gives every point its own answer: ragged ends, resting and failing lanes") {
  const HydraulicCylinder m;
  for (std::size_t count : {1, 2, 7, 8, 9, 17}) {
    std::vector<double> x0, u, dt;
    for (std::size_t k = 0; k < count; ++k) {
      const double v = k % 3 == 1 ? 1e-4 : 0.2;  // every third point meets v = 0
      for (double x : {0.1 + 0.01 * k, v, 8e6 - 2e5 * k, 9e6, k % 2 ? 0.4 : -0.3}) x0.push_back(x);
      u.push_back(-0.5 + 0.05 * k);
      dt.push_back(2e-3 + 3e-4 * k);
    }
    const Points points{count, x0.data(), u.data(), dt.data()};
    std::vector<double> x(5 * count), y(4 * count), lasted(count), sx(5 * count), sy(4 * count), dx(45 * count), dy(36 * count);
    std::vector<Status> status(count), s_status(count);
    simulate(m, points, {cylinder_theta.data(), false}, {}, Workers(2), {x.data(), y.data(), status.data(), lasted.data()});
    sensitivities(m, points, {cylinder_theta.data(), false}, {}, Workers(2),
                  {sx.data(), sy.data(), dx.data(), dy.data(), s_status.data()});
    for (std::size_t k = 0; k < count; ++k) {
      std::array<double, 5> start;
      std::copy_n(&x0[5 * k], 5, start.begin());
      const auto [alone, outcome] = run<double>(m, start, std::array{u[k]}, dt[k], cylinder_theta);
      CHECK(status[k] == outcome.status[0]);
      CHECK(s_status[k] == status[k]);
      CHECK(lasted[k] == doctest::Approx(outcome.lasted).epsilon(1e-10));
      CHECK((status[k] == Status::ok ? lasted[k] == doctest::Approx(dt[k]) : lasted[k] < dt[k]));
      if (status[k] != Status::ok) continue;
      for (int i = 0; i < 5; ++i) {
        CHECK(x[5 * k + i] == doctest::Approx(alone[i]).epsilon(1e-10));
        CHECK(sx[5 * k + i] == doctest::Approx(alone[i]).epsilon(1e-5));
      }
      for (int j = 0; j < 9; ++j) CHECK(dy[36 * k + 27 + j] == 0.0);  // the spool knows no parameter
    }
  }
}
