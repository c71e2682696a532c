#include <doctest/doctest.h>

#include <cmath>

#include "fisherpoint/numbers/functions.hpp"
#include "models.hpp"

using namespace fisherpoint;
using namespace fisherpoint::testing;
using P = Pack<native_lanes>;

TEST_CASE("a smooth problem meets its tolerance") {
  for (double rtol : {1e-4, 1e-6, 1e-8, 1e-10}) {
    const auto [x, outcome] = run<double>(Oscillator{}, std::array{1.0, 0.5}, std::array{0.0}, 10.0, std::array{1.7}, {rtol});
    CHECK(outcome.status[0] == Status::ok);
    CHECK(std::abs(x[0] - (std::cos(17.0) + 0.5 / 1.7 * std::sin(17.0))) < 30 * rtol);  // ten units of time add up
  }
}

// x' = p x (1 - x) + p (sqrt(5.1 - x) - 1/2): from x = 0.866 a step of half a time constant has an embedded error of next to
// nothing. So fast a model is tried with such a step at first.
struct Growth {
  static constexpr std::string_view name = "growth";
  static constexpr std::array states = {Quantity{"x", "1", "", 1.0}};
  static constexpr std::array<Quantity, 0> inputs = {};
  static constexpr std::array outputs = {states[0]};
  static constexpr std::array parameters = {Quantity{"p", "1", "", 1.0}};
  static constexpr std::array<Surface, 0> jumps = {}, kinks = {}, domain = {};
  auto dynamics(const auto& theta) const {
    const auto& [p] = theta;
    return [=](const auto& state, const auto&, const auto&) {
      const auto& [x] = state;
      return std::tuple{p * (x * (1.0 - x) + fisherpoint::sqrt(5.1 - x) - 0.5)};
    };
  }
  auto output(const auto& state, const auto&, const auto&) const { return std::tuple{std::get<0>(state)}; }
  auto switching(const auto&, const auto&, const auto&) const { return std::tuple{}; }
  auto limits(const auto&, const auto&, const auto&) const { return std::tuple{}; }
};

TEST_CASE_TEMPLATE("no step is taken on an embedded error that vanishes by chance", Method, FISHERPOINT_METHODS) {
  for (double x0 = 0.75; x0 < 0.95; x0 += 0.0013) {
    const std::array<double, 0> u{};
    const auto [exact, tight] =
        run<double, DormandPrince853>(Growth{}, std::array{x0}, u, 1.037e-6, std::array{0.5789e6}, {1e-13});
    for (const double rtol : {1e-8, 1e-9, 1e-10}) {
      const auto [x, outcome] = run<double, Method>(Growth{}, std::array{x0}, u, 1.037e-6, std::array{0.5789e6}, {rtol});
      CAPTURE(x0);
      CAPTURE(rtol);
      CHECK(std::abs(x[0] - exact[0]) < 10 * rtol);
    }
  }
}

TEST_CASE("a pack does what a double does, and lanes do not see each other") {
  using E = StateEquation<Oscillator, P>;
  E::Theta w{P(0.0)};
  E::State x{P(1.0), P(0.5)};
  P duration(0.0);
  for (int lane = 0; lane < P::width; ++lane) {
    w[0].set(lane, 1.0 + 3.0 * lane);
    duration.set(lane, lane == 1 ? 0.0 : 2.0 / (1 + lane));  // the second lane rests
  }
  const E equation(Oscillator{}, w, {P(0.0)});
  const auto outcome = Integrator<E, DormandPrince853>(equation, Tolerance{}).run(x, duration, P(0.0));
  for (int lane = 0; lane < P::width; ++lane) {
    const auto [alone, o] = run<P>(Oscillator{}, std::array{1.0, 0.5}, std::array{0.0}, duration[lane], std::array{w[0][lane]});
    const auto [scalar, s] =
        run<double>(Oscillator{}, std::array{1.0, 0.5}, std::array{0.0}, duration[lane], std::array{w[0][lane]});
    CHECK(outcome.status[lane] == Status::ok);
    CHECK(x[0][lane] == alone[0][0]);
    CHECK(x[0][lane] == doctest::Approx(scalar[0]).epsilon(1e-12));
  }
  CHECK(x[0][1] == 1.0);
}

TEST_CASE("a surface is found although both ends of the step lie on one side") {
  // Thrown from 1 below the surface at speed v: the top is v^2 / 2g above the start.
  for (double excess : {-1e-3, -1e-6, 1e-6, 1e-3}) {
    const double g = 2.0, v = std::sqrt(2 * g * (1.0 + excess)), flight = 2 * v / g;
    const auto [x, outcome] =
        run<double>(Ball<Kind::jump>{1.0}, std::array{0.0, v}, std::array{0.0}, flight, std::array{g, 0.0});
    CHECK(outcome.status[0] == (excess > 0 ? Status::met_jump : Status::ok));
    const auto [y, o] = run<double>(Ball<Kind::limit>{-1.0}, std::array{0.0, -v}, std::array{0.0}, flight, std::array{-g, 0.0});
    CHECK(o.status[0] == (excess > 0 ? Status::left_domain : Status::ok));
  }
}

// x = 1 - cos(w (a - 1/2)) + d^2 beside a clock a: it falls towards a limit and turns before it, again and again; y is the
// integral of its root.
struct Dips {
  static constexpr std::string_view name = "dips";
  static constexpr std::array states = {Quantity{"a", "1", "", 1.0}, Quantity{"x", "1", "", 1.0}, Quantity{"y", "1", "", 1.0}};
  static constexpr std::array<Quantity, 0> inputs = {};
  static constexpr std::array outputs = {states[2]};
  static constexpr std::array parameters = {Quantity{"w", "1", "", 1.0}};
  static constexpr std::array<Surface, 0> jumps = {}, kinks = {};
  static constexpr std::array<Surface, 1> domain = {};
  auto dynamics(const auto& theta) const {
    const auto& [w] = theta;
    return [=](const auto& state, const auto&, const auto&) {
      const auto& [a, x, y] = state;
      return std::tuple{1.0 + 0.0 * a, w * fisherpoint::sin(w * (a - 0.5)), fisherpoint::sqrt(x)};
    };
  }
  auto output(const auto& state, const auto&, const auto&) const { return std::tuple{std::get<2>(state)}; }
  auto switching(const auto&, const auto&, const auto&) const { return std::tuple{}; }
  auto limits(const auto& state, const auto&, const auto&) const { return std::tuple{std::get<1>(state)}; }
};

TEST_CASE("next to a limit the domain is left only where the limit is as near as the last step could be") {
  // From anywhere the straight line reaches the limit after sqrt(2) d / w or later. The first try looks far past it.
  using E = StateEquation<Dips, double>;
  const double w = 20.0;
  for (const double share : {3e-5, 1e-4, 3e-4, 8e-4}) {
    const double d = share * w / std::sqrt(2.0), rtol = 1e-6;
    const auto x_at = [&](double t) { return 1.0 - std::cos(w * (t - 0.5)) + d * d; };
    double integral = 0.0;
    const int parts = 1000000;
    for (int i = 0; i < parts; ++i) integral += std::sqrt(x_at((i + 0.5) / parts)) / parts;
    E::State state{0.0, x_at(0.0), 0.0};
    const E equation(Dips{}, {w}, {});
    const auto outcome = Integrator<E, DormandPrince853>(equation, Tolerance{rtol}).run(state, 1.0, 1.0);
    CAPTURE(share);
    CHECK(outcome.status[0] == Status::ok);
    CHECK(state[2] == doctest::Approx(integral).epsilon(30 * rtol));
  }
}

TEST_CASE("a start on a jump or outside the domain ends at once") {
  const auto [x, on_jump] =
      run<double>(Ball<Kind::jump>{0.0}, std::array{0.0, 1.0}, std::array{0.0}, 0.1, std::array{1.0, 0.0});
  CHECK(on_jump.status[0] == Status::met_jump);
  const auto [y, outside] =
      run<double>(Ball<Kind::limit>{0.0}, std::array{-1.0, 1.0}, std::array{0.0}, 0.1, std::array{1.0, 0.0});
  CHECK(outside.status[0] == Status::left_domain);
  CHECK(y[0] == -1.0);
}

// The ball's exact way through the spring: parabola below, oscillation above, parabola again.
static std::array<double, 2> through_spring(double s, double v, double g, double k, double t) {
  const auto parabola = [&](double s, double v, double t) { return std::array{s + v * t - g * t * t / 2, v - g * t}; };
  const double up = (v - std::sqrt(v * v + 2 * g * s)) / g;  // s < 0: time to the surface
  if (t <= up) return parabola(s, v, t);
  const double w = std::sqrt(k), speed = parabola(s, v, up)[1], centre = -g / k;
  const auto above = [&](double t) {
    return std::array{centre - centre * std::cos(w * t) + speed / w * std::sin(w * t),
                      centre * w * std::sin(w * t) + speed * std::cos(w * t)};
  };
  double down = M_PI / w;  // back at the surface: Newton
  for (int i = 0; i < 50; ++i) down -= above(down)[0] / above(down)[1];
  if (t - up <= down) return above(t - up);
  return parabola(0, above(down)[1], t - up - down);
}

TEST_CASE("kinks are crossed in both directions without loss, at every tolerance") {
  const double s = -0.7, v = 4.0, g = 3.0, k = 50.0;
  for (double rtol : {1e-5, 1e-7, 1e-9})
    for (double t : {0.1, 0.3, 0.6, 1.5}) {
      const auto [x, outcome] =
          run<double>(Ball<Kind::kink>{0.0}, std::array{s, v}, std::array{0.0}, t, std::array{g, k}, {rtol});
      const auto exact = through_spring(s, v, g, k, t);
      CHECK(outcome.status[0] == Status::ok);
      CHECK(std::abs(x[0] - exact[0]) < 20 * rtol);
      CHECK(std::abs(x[1] - exact[1]) < 100 * rtol);
      CHECK(outcome.attempts < 60 * std::pow(1e-5 / rtol, 0.2) + 20);  // not by shrinking steps around the kink
    }
  Tolerance strict;
  strict.cross_kinks = false;
  const auto [x, outcome] =
      run<double>(Ball<Kind::kink>{0.0}, std::array{s, v}, std::array{0.0}, 0.6, std::array{g, k}, strict);
  CHECK(outcome.status[0] == Status::met_kink);
}

TEST_CASE("sensitivities cross a kink that depends on the parameter") {
  const double s = -0.7, v = 4.0, g = 3.0, k = 50.0, h = 1e-5;
  for (double t : {0.3, 1.5}) {
    const auto r = run_sensitive(Ball<Kind::kink>{0.0}, std::array{s, v}, std::array{0.0}, t, std::array{g, k}, {1e-10});
    const double by_g = (through_spring(s, v, g + h, k, t)[0] - through_spring(s, v, g - h, k, t)[0]) / (2 * h);
    const double by_k = (through_spring(s, v, g, k + h, t)[0] - through_spring(s, v, g, k - h, t)[0]) / (2 * h);
    CHECK(r.dx[0][0] == doctest::Approx(by_g).epsilon(1e-6));
    CHECK(r.dx[0][1] == doctest::Approx(by_k).epsilon(1e-6));
  }
}

TEST_CASE("an impossible tolerance is a status") {
  Tolerance few;
  few.max_attempts = 3;
  const auto [x, outcome] = run<double>(Oscillator{}, std::array{1.0, 0.0}, std::array{0.0}, 100.0, std::array{1.0}, few);
  CHECK(outcome.status[0] == Status::step_limit);
  const auto [y, overflow] = run<double>(Oscillator{}, std::array{1.0, 0.0}, std::array{0.0}, 1.0, std::array{1e200});
  CHECK(overflow.status[0] != Status::ok);
  CHECK(std::isfinite(y[0]));
}
