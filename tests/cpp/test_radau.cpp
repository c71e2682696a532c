#include <doctest/doctest.h>

#include <cmath>

#include "fisherpoint/integration/implicit_tangents.hpp"
#include "models.hpp"

using namespace fisherpoint;
using namespace fisherpoint::testing;
using P = Pack<native_lanes>;

namespace {

// Three reactions with rates of 0.04, 3e7 and 1e4 (H. H. Robertson, 1966).
struct Robertson {
  static constexpr std::string_view name = "robertson";
  static constexpr std::array states = {Quantity{"a", "1", "", 1.0}, Quantity{"b", "1", "", 1e-5}, Quantity{"c", "1", "", 1.0}};
  static constexpr std::array<Quantity, 0> inputs = {};
  static constexpr std::array outputs = {states[0], states[2]};
  static constexpr std::array parameters = {Quantity{"k1", "1", "", 1.0}, Quantity{"k2", "1", "", 1.0},
                                            Quantity{"k3", "1", "", 1.0}};
  static constexpr std::array<Surface, 0> jumps = {}, kinks = {}, domain = {};
  auto dynamics(const auto& theta) const {
    const auto& [k1, k2, k3] = theta;
    return [=](const auto& x, const auto&, const auto&) {
      const auto& [a, b, c] = x;
      const auto first = k1 * a - k3 * (b * c), second = k2 * (b * b);
      return std::tuple{-first, first - second, second};
    };
  }
  auto output(const auto& x, const auto&, const auto&) const { return std::tuple{std::get<0>(x), std::get<2>(x)}; }
  auto switching(const auto&, const auto&, const auto&) const { return std::tuple{}; }
  auto limits(const auto&, const auto&, const auto&) const { return std::tuple{}; }
};

const std::array<double, 3> rest = {1.0, 0.0, 0.0}, rates = {0.04, 3e7, 1e4};
const std::array<double, 0> none{};
// At t = 1e4, by SciPy's Radau at rtol 1e-12.
const std::array<double, 3> at_1e4 = {0.107300429, 4.80016697e-07, 0.892699091};

// x and dx/dw of the oscillator after `steps` equal implicit steps over two units of time.
std::array<double, 4> oscillate(int steps) {
  using Plain = StateEquation<Oscillator, double>;
  using Equation = VariationalEquation<Oscillator, double>;
  const std::array theta{1.7}, u{0.0};
  const Plain plain(Oscillator{}, theta, u);
  const Equation equation(Oscillator{}, theta, u);
  const Tolerance tolerance{1e-12};
  Tangents<Oscillator, double, DormandPrince853> tangents(equation, {1.0, 0.5}, tolerance);
  ImplicitTangents<Oscillator, double, DormandPrince853> implicit(plain, equation, tangents, tolerance);
  for (int k = 0; k < steps; ++k) implicit.advance(2.0 / steps, {});
  return {tangents.x[0], tangents.x[1], tangents.s[0], tangents.s[1]};
}

}  // namespace

TEST_CASE("implicit steps and their derivatives are of order five") {
  const double w = 1.7, t = 2.0, c = std::cos(w * t), s = std::sin(w * t);
  const std::array exact = {c + 0.5 / w * s, -w * s + 0.5 * c, -t * s - 0.5 / (w * w) * s + 0.5 * t / w * c,
                            -s - w * t * c - 0.5 * t * s};
  const auto coarse = oscillate(16), fine = oscillate(32);
  for (int i = 0; i < 4; ++i) {
    CAPTURE(i);
    CHECK(std::log2(std::abs(coarse[i] - exact[i]) / std::abs(fine[i] - exact[i])) == doctest::Approx(5.0).epsilon(0.05));
  }
}

TEST_CASE("derivatives of implicit steps are those of their stages, however long the steps are") {
  // Over one step of two units of time: differences of x by w.
  const double d = 1e-5;
  const auto at = [&](double w) {
    using Plain = StateEquation<Oscillator, double>;
    const Plain f(Oscillator{}, {w}, {0.0});
    ImplicitStep<Plain> step(f);
    const std::array x{1.0, 0.5};
    std::array<double, 2> rate;
    f.derivative(x, {}, rate);
    CHECK(step.solve(true, x, rate, 2.0, {}, 1e24));
    return std::array{step.moved(Part(0), x, 0, 1.0), step.moved(Part(0), x, 1, 1.0)};
  };
  const auto up = at(1.7 + d), down = at(1.7 - d);
  const auto taken = oscillate(1);
  for (int i = 0; i < 2; ++i) CHECK(taken[2 + i] == doctest::Approx((up[i] - down[i]) / (2 * d)).epsilon(1e-8));
}

TEST_CASE("stiff stretches are noticed, and take few steps") {
  for (const auto method : {MethodName::fastest, MethodName::Radau}) {
    for (const double rtol : {1e-4, 1e-6, 1e-8}) {
      const auto [x, outcome] = run<double>(Robertson{}, rest, none, 1e4, rates, {.relative = rtol, .method = method});
      CAPTURE(rtol);
      CHECK(outcome.status[0] == Status::ok);
      CHECK(outcome.stiff);
      CHECK(outcome.attempts < 800);
      for (int i = 0; i < 3; ++i) CHECK(std::abs(x[i] - at_1e4[i]) < rtol * Robertson::states[i].scale + 1e-9 * at_1e4[i]);
    }
  }
  const auto [x, outcome] = run<double>(Robertson{}, rest, none, 1e4, rates, {.method = MethodName::DOP853});
  CHECK(outcome.status[0] == Status::step_limit);
}

TEST_CASE("what is not stiff stays with explicit steps, however many") {
  const auto [x, outcome] = run<double>(Oscillator{}, std::array{1.0, 0.5}, std::array{0.0}, 400.0, std::array{1.7}, {1e-8});
  CHECK(outcome.status[0] == Status::ok);
  CHECK(outcome.attempts > 200);
  CHECK_FALSE(outcome.stiff);
}

TEST_CASE("sensitivities of stiff trajectories are those of differences, on one lane and on many") {
  const auto exact = run_sensitive(Robertson{}, rest, none, 1e4, rates, {.relative = 1e-10});
  REQUIRE(exact.status == Status::ok);
  const auto one = run_sensitive(Robertson{}, rest, none, 1e4, rates, {.relative = 1e-7});
  const auto many = run_sensitive<P>(Robertson{}, rest, none, 1e4, rates, {.relative = 1e-7});
  for (int j = 0; j < 3; ++j) {
    auto up = rates, down = rates;
    up[j] *= 1 + 1e-4;
    down[j] *= 1 - 1e-4;
    const auto [above, ended_above] = run<double>(Robertson{}, rest, none, 1e4, up, {.relative = 1e-10});
    const auto [below, ended_below] = run<double>(Robertson{}, rest, none, 1e4, down, {.relative = 1e-10});
    REQUIRE(ended_above.status[0] == Status::ok);
    REQUIRE(ended_below.status[0] == Status::ok);
    for (int i = 0; i < 3; ++i) {
      const double size = Robertson::states[i].scale / rates[j];
      CHECK(std::abs(exact.dx[i][j] - (above[i] - below[i]) / (2e-4 * rates[j])) < 1e-7 * size);
      CHECK(std::abs(one.dx[i][j] - exact.dx[i][j]) < 1e-6 * size);
      CHECK(std::abs(many.dx[i][j] - exact.dx[i][j]) < 1e-6 * size);
    }
  }
}

TEST_CASE("lanes of a pack do not see whether others are stiff") {
  using E = StateEquation<Robertson, P>;
  const Tolerance tolerance{1e-7};
  const auto end = [&](auto slow) {
    E::Theta theta;
    E::State x;
    set_lanes(theta, rates.data());
    set_lanes(x, rest.data());
    for (int lane = 1; lane < P::width; ++lane)
      if (slow(lane)) theta[1].set(lane, 3.0), theta[2].set(lane, 0.1);
    const E equation(Robertson{}, theta, {});
    P duration(1e3);
    for (int lane = 1; lane < P::width; ++lane)
      if (slow(lane)) duration.set(lane, 10.0);
    const auto outcome = Integrator<E, DormandPrince853>(equation, tolerance).run(x, duration, P(0.0));
    CHECK(outcome.stiff[0]);
    for (int lane = 1; lane < P::width; ++lane) CHECK(outcome.stiff[lane] == !slow(lane));
    return std::array{x[0][0], x[1][0], x[2][0]};
  };
  const auto alone = end([](int) { return true; }), together = end([](int) { return false; }),
             mixed = end([](int lane) { return lane % 2 == 1; });
  CHECK(alone == together);
  CHECK(alone == mixed);
}
