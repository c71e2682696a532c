#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "fisherpoint/integration/plan.hpp"
#include "fisherpoint/integration/replay.hpp"
#include "fisherpoint/prior/prior_grid.hpp"
#include "models.hpp"

using namespace fisherpoint;
using namespace fisherpoint::testing;
using P = Pack<native_lanes>;

// A single stretch, every lane with the same theta.
template <class M, std::size_t n_x, std::size_t p>
static auto replay(const M& model, const std::array<double, n_x>& x0, const std::array<double, p>& theta, double duration,
                   int steps) {
  using E = StateEquation<M, P>;
  typename E::Theta packed;
  typename E::State x;
  for (std::size_t j = 0; j < p; ++j) packed[j] = P(theta[j]);
  for (std::size_t i = 0; i < n_x; ++i) x[i] = P(x0[i]);
  std::vector<Stretch<M>> stretches{{duration, steps, {}}};
  if constexpr (sizes<M>::switching > 0) {
    const auto start = to_array<double>(model.switching(x0, std::array{0.0}, theta));
    for (std::size_t m = 0; m < start.size(); ++m) stretches[0].side[m] = start[m] < 0 ? -1 : 1;
  }
  const E equation(model, packed, {P(0.0)});
  const auto replayed = fisherpoint::replay<DormandPrince853>(equation, {}, x, stretches);
  return std::pair{x, replayed};
}

static double slope(const std::vector<double>& errors) {  // of log2 over halvings, by least squares
  double sum = 0, n = static_cast<double>(errors.size());
  for (std::size_t i = 0; i < errors.size(); ++i) sum += (i - (n - 1) / 2) * std::log2(errors[i]);
  return -sum / (n * (n * n - 1) / 12);
}

TEST_CASE("replay has order 8 and an error estimate of order 5, by slope") {
  const double w = 1.7, duration = 6.0;
  std::vector<double> global, local;
  for (int n = 4; n <= 32; n *= 2) {
    const auto x = replay(Oscillator{}, std::array{1.0, 0.5}, std::array{w}, duration, n).first;
    global.push_back(std::abs(x[0][0] - (std::cos(w * duration) + 0.5 / w * std::sin(w * duration))));
  }
  for (double h = 0.4; h > 0.04; h /= 2)
    local.push_back(std::sqrt(replay(Oscillator{}, std::array{1.0, 0.5}, std::array{w}, h, 1).second.squared_error[0]));
  CHECK(slope(global) == doctest::Approx(8).epsilon(0.05));
  CHECK(slope(local) == doctest::Approx(6).epsilon(0.05));
}

TEST_CASE("a trajectory that passes a surface is not clear, one well off is, and one in between is left to the loop") {
  for (int steps : {1, 2, 7})
    for (double excess : {-0.2, -1e-3, -1e-6, 1e-6, 1e-3, 0.2}) {
      // Thrown from 1 below the surface: the top is 1 + excess above the start.
      const double g = 2.0, v = std::sqrt(2 * g * (1.0 + excess)), flight = 2 * v / g;
      const auto jump = replay(Ball<Kind::jump>{1.0}, std::array{0.0, v}, std::array{g, 0.0}, flight, steps).second.clear();
      const auto limit =
          replay(Ball<Kind::limit>{-1.0}, std::array{0.0, -v}, std::array{-g, 0.0}, flight, steps).second.clear();
      if (excess > 0) {
        CHECK(!jump[0]);
        CHECK(!limit[0]);
      }
      if (excess < -0.1 && steps > 2) {
        CHECK(jump[0]);
        CHECK(limit[0]);
      }
    }
}

TEST_CASE("NaN is not believed") {
  const auto replayed = replay(Oscillator{}, std::array{std::nan(""), 0.5}, std::array{1.0}, 1.0, 2).second;
  CHECK(!replayed.clear()[0]);
}

// The steps of a trajectory on P, as a plan starts from.
template <class M, std::size_t n_x, std::size_t p>
static auto steps_of(const M& model, const std::array<double, n_x>& x0, double u, double dt,
                     const std::array<double, p>& theta) {
  using Equation = StateEquation<M, P>;
  typename Equation::State x;
  typename Equation::Theta packed;
  for (std::size_t i = 0; i < n_x; ++i) x[i] = P(x0[i]);
  for (std::size_t j = 0; j < p; ++j) packed[j] = P(theta[j]);
  Steps<Equation> steps;
  const Equation equation(model, packed, {P(u)});
  const auto outcome = Integrator<Equation, DormandPrince853>(equation, Tolerance{}).run(x, P(dt), P(0.0), &steps);
  REQUIRE(outcome.status[0] == Status::ok);
  return steps;
}

TEST_CASE("a plan reaches the tolerance at every node, with steps that are not many more than needed") {
  std::vector<Axis> axes{cells(1.7, 0.2, 9, 1.5)};
  const double mean = 1.7, dt = 5.0, u = 0;
  const Pilots pilots(&mean, PriorGrid(axes));
  const std::array x0 = {1.0, 0.5};
  for (double rtol : {1e-4, 1e-6, 1e-9}) {
    const auto plan = Planner<Oscillator, P, DormandPrince853>({}, x0.data(), &u, pilots)
                          .plan(steps_of(Oscillator{}, x0, u, dt, std::array{mean}), {rtol});
    REQUIRE(plan);
    REQUIRE(plan->stretches.size() == 1);
    const int steps = plan->stretches[0].steps;
    double worst = 0, worst_of_fewer = 0;
    for (double w : axes[0].values) {
      const double exact = std::cos(w * dt) + 0.5 / w * std::sin(w * dt);
      const auto [x, replayed] = replay(Oscillator{}, x0, std::array{w}, dt, steps);
      CHECK(plan->believed(replayed)[0]);
      worst = std::max(worst, std::abs(x[0][0] - exact));
      worst_of_fewer =
          std::max(worst_of_fewer, std::abs(replay(Oscillator{}, x0, std::array{w}, dt, steps * 2 / 3).first[0][0] - exact));
    }
    CHECK(worst < rtol);
    CHECK(worst_of_fewer > 0.5 * rtol);
    CHECK(plan->nominal_y[0] == doctest::Approx(std::cos(1.7 * dt) + 0.5 / 1.7 * std::sin(1.7 * dt)).epsilon(10 * rtol));
  }
}

TEST_CASE("a trajectory unlike the pilots is not believed") {
  std::vector<Axis> axes{cells(1.7, 0.2, 3, 1.5)};
  const double mean = 1.7, dt = 5.0, u = 0;
  const std::array x0 = {1.0, 0.5};
  const auto steps = steps_of(Oscillator{}, x0, u, dt, std::array{mean});
  const Pilots pilots(&mean, PriorGrid(axes));
  const auto plan = Planner<Oscillator, P, DormandPrince853>({}, x0.data(), &u, pilots).plan(steps, {});
  REQUIRE(plan);
  CHECK(!plan->believed(replay(Oscillator{}, x0, std::array{4.0}, dt, plan->stretches[0].steps).second)[0]);
}

static std::vector<Axis> cylinder_axes(double width) {
  std::vector<Axis> axes;
  for (double mean : cylinder_theta) axes.push_back(cells(mean, width * mean, 3, 1.5));
  return axes;
}

TEST_CASE("the spool's zero is where it is in closed form, and ends a stretch") {
  const HydraulicCylinder m;
  const std::array x0 = {0.1, 0.2, 8e6, 9e6, -0.3};
  const std::array u = {-0.5};  // k_u = -1: x_v goes to 0.5
  const double dt = 4e-3, zero = m.T_1 * std::log((0.5 + 0.3) / 0.5);
  const auto x = run<double>(m, x0, u, dt, cylinder_theta).first;
  const Pilots pilots(cylinder_theta.data(), PriorGrid(cylinder_axes(0.1)));
  const Planner<HydraulicCylinder, P, DormandPrince853> planner(m, x0.data(), u.data(), pilots);
  const auto plan = planner.plan(steps_of(m, x0, u[0], dt, cylinder_theta), {});
  REQUIRE(plan);
  REQUIRE(plan->stretches.size() == 2);
  CHECK(plan->stretches[0].side == std::array{1.0, -1.0});
  CHECK(plan->stretches[1].side == std::array{1.0, 1.0});
  CHECK(plan->stretches[0].duration == doctest::Approx(zero).epsilon(1e-6));
  CHECK(plan->stretches[0].duration + plan->stretches[1].duration == doctest::Approx(dt).epsilon(1e-12));
  CHECK(plan->nominal_y[1] == doctest::Approx(x[2]).epsilon(1e-5));
}

TEST_CASE("a kink whose time depends on theta is not planned for") {
  using Spring = Ball<Kind::kink>;
  using Cylinder = HydraulicCylinder;
  static_assert(!planned(Shape<Spring>{}, Dependence<Spring>{}, Count<0>{}));
  static_assert(!planned(Shape<Cylinder>{}, Dependence<Cylinder>{}, Count<0>{}) &&
                planned(Shape<Cylinder>{}, Dependence<Cylinder>{}, Count<1>{}));
  const std::array x0 = {-0.5, 2.0};
  const std::array mean = {1.0, 3.0};
  const double u = 0, dt = 1.0;
  const Pilots pilots(mean.data(), PriorGrid({cells(1.0, 0.1, 3, 1.5), cells(3.0, 0.1, 3, 1.5)}));
  const auto steps = steps_of(Spring{}, x0, u, dt, mean);
  CHECK(steps.front().side[0][0] == -1.0);
  CHECK(steps.back().side[0][0] == 1.0);
  CHECK(!Planner<Spring, P, DormandPrince853>({}, x0.data(), &u, pilots).plan(steps, {}));
}
