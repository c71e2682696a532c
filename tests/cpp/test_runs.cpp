#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include "fisherpoint/kernels/run_sensitivities.hpp"
#include "fisherpoint/kernels/runs.hpp"
#include "models.hpp"

using namespace fisherpoint;
using namespace fisherpoint::testing;
using P = Pack<native_lanes>;

namespace {

// x' = (u - x) / T with a kink at x = 0, behind which the rate is `slower` times as large.
struct Valve {
  static constexpr std::string_view name = "valve";
  static constexpr std::array states = {Quantity{"x", "1", "", 1.0}};
  static constexpr std::array inputs = {Quantity{"u", "1", "", 1.0}};
  static constexpr std::array outputs = {states[0]};
  static constexpr std::array parameters = {Quantity{"T", "s", "", 1.0}, Quantity{"slower", "1", "", 1.0}};
  static constexpr std::array<Surface, 0> jumps = {}, domain = {};
  static constexpr std::array<Surface, 1> kinks = {};
  auto dynamics(const auto& theta) const {
    const auto& [T, slower] = theta;
    return [=](const auto& x, const auto& u, const auto& side) {
      const auto& [position] = x;
      const auto& [above] = side;
      const auto over = position * heaviside(above);
      return std::tuple{(u[0] - position + (1.0 - slower) * over) / T};
    };
  }
  auto output(const auto& x, const auto&, const auto&) const { return std::tuple{std::get<0>(x)}; }
  auto switching(const auto& x, const auto&, const auto&) const { return std::tuple{std::get<0>(x)}; }
  auto limits(const auto&, const auto&, const auto&) const { return std::tuple{}; }
};

// One piece of the valve: below and above the kink an exponential each.
double through_kink(double x, double u, double t, double T, double slower) {
  const auto along = [&](double x, double t) {
    const double rate = x > 0 || (x == 0 && u > 0) ? slower / T : 1 / T, rest = x > 0 || (x == 0 && u > 0) ? u / slower : u;
    return std::array{rest + (x - rest) * std::exp(-rate * t), rest == x ? INFINITY : std::log((x - rest) / -rest) / rate};
  };
  const auto [end, crossing] = along(x, t);
  if (x * end >= 0) return end;
  return along(u > 0 ? 1e-300 : -1e-300, t - crossing)[0];
}

struct Result {
  std::vector<double> x;
  std::vector<Status> status;
  std::vector<std::int64_t> reached;
};

template <class P, class M>
Result simulated_records(const M& model, const std::vector<double>& x0, const std::vector<double>& u,
                         const std::vector<double>& dt, const std::vector<double>& theta, Tolerance tolerance = {},
                         const Workers& workers = Workers(1)) {
  const std::size_t n_x = sizes<M>::states, count = x0.size() / n_x;
  Result r{std::vector<double>(count * (dt.size() + 1) * n_x), std::vector<Status>(count), std::vector<std::int64_t>(count)};
  run_packs<P, DormandPrince853>(model, Runs{count, dt.size(), x0.data(), u.data(), dt.data(), true},
                                 Parameters{theta.data(), theta.size() > sizes<M>::parameters}, tolerance, workers,
                                 {r.x.data(), r.status.data(), r.reached.data()});
  return r;
}

}  // namespace

TEST_CASE("the pieces of a record are one trajectory, at unequal samples") {
  const std::vector<double> dt = {0.1, 0.5, 0.01, 2.0, 0.3};
  const double w = 1.7;
  const auto r = simulated_records<P>(Oscillator{}, {1.0, 0.5, 0.0, -1.0}, std::vector<double>(5), dt, {w}, {1e-10});
  double t = 0;
  for (std::size_t n = 0; n <= dt.size(); t += n < dt.size() ? dt[n] : 0.0, ++n) {
    CHECK(std::abs(r.x[2 * n] - (std::cos(w * t) + 0.5 / w * std::sin(w * t))) < 1e-8);
    CHECK(std::abs(r.x[2 * (6 + n)] + std::sin(w * t) / w) < 1e-8);
  }
  CHECK(r.reached == std::vector<std::int64_t>{5, 5});
}

TEST_CASE("records start on a kink, rest on it, go along it and cross it") {
  const std::vector<double> u = {0.0, 0.0, 1.0, -1.0, 0.0, 2.0, -3.0, 0.0, 0.0}, dt = {1, 2, 0.3, 1, 4, 0.7, 0.2, 30, 30};
  for (double x0 : {0.0, 0.4, -0.4}) {
    const auto r = simulated_records<double>(Valve{}, {x0}, u, dt, {0.5, 3.0}, {1e-9});
    REQUIRE(r.status[0] == Status::ok);
    for (std::size_t n = 0; n < dt.size(); ++n)
      CHECK(std::abs(r.x[n + 1] - through_kink(r.x[n], u[n], dt[n], 0.5, 3.0)) < 1e-8);
  }
  // From rest on the surface, with a rate of zero and a pull to either side: s = -g t^2 / 2, or a spring's way above it.
  const double g = 3.0, k = 50.0, t = 0.4;
  const auto down = simulated_records<double>(Ball<Kind::kink>{0.0}, {0.0, 0.0}, {0.0, 0.0}, {t, t}, {g, k}, {1e-9});
  CHECK(down.x[2] == doctest::Approx(-g * t * t / 2).epsilon(1e-8));
  CHECK(down.x[4] == doctest::Approx(-2 * g * t * t).epsilon(1e-8));
  const auto up = simulated_records<double>(Ball<Kind::kink>{0.0}, {0.0, 0.0}, {0.0}, {t}, {-g, k}, {1e-9});
  CHECK(up.x[2] == doctest::Approx(g / k * (1 - std::cos(std::sqrt(k) * t))).epsilon(1e-7));
}

TEST_CASE("a record that rounding has put next to a kink crosses it") {
  for (double x0 : {3e-17, -3e-17, 1e-20, -1e-20}) {
    const double u = x0 < 0 ? 2.0 : -2.0;
    const auto r = simulated_records<double>(Valve{}, {x0}, {u, -u}, {0.5, 3.0}, {0.5, 3.0}, {1e-9});
    CHECK(r.reached[0] == 2);
    CHECK(r.x[1] == doctest::Approx(through_kink(x0, u, 0.5, 0.5, 3.0)).epsilon(1e-7));
  }
}

TEST_CASE("a record's states do not depend on what shares its pack, nor on the threads") {
  const int count = 2 * native_lanes + 3;
  std::vector<double> x0, theta, u, dt;
  for (int k = 0; k < count; ++k) x0.push_back(0.3 * k - 1), theta.push_back(0.2 + 0.1 * k), theta.push_back(1 + k);
  for (int n = 0; n < 60; ++n) u.push_back(std::sin(1.0 * n * n)), dt.push_back(0.05 + 0.01 * (n % 7));
  const auto together = simulated_records<P>(Valve{}, x0, u, dt, theta);
  CHECK(simulated_records<P>(Valve{}, x0, u, dt, theta, {}, Workers(3)).x == together.x);
  for (int k = 0; k < count; ++k) {
    const auto alone = simulated_records<P>(Valve{}, {x0[k]}, u, dt, {theta[2 * k], theta[2 * k + 1]});
    CHECK(alone.x == std::vector<double>(together.x.begin() + 61 * k, together.x.begin() + 61 * (k + 1)));
  }
}

TEST_CASE("a jump ends its record alone, which rests where it was") {
  // Thrown up from below the surface at 0: one meets it in the third piece, one never does.
  const auto r =
      simulated_records<P>(Ball<Kind::jump>{0.0}, {-1.0, 5.0, -1.0, 0.5}, {0, 0, 0, 0}, {0.1, 0.1, 0.1, 0.1}, {1.0, 0.0});
  CHECK(r.status == std::vector<Status>{Status::met_jump, Status::ok});
  CHECK(r.reached == std::vector<std::int64_t>{2, 4});
  CHECK(r.x[2 * 2] == doctest::Approx(-1 + 5 * 0.2 - 0.02));
  CHECK(r.x[2 * 3] < 0);
  CHECK(r.x[2 * 4] == r.x[2 * 3]);
  CHECK(r.x[2 * (5 + 4)] == doctest::Approx(-1 + 0.5 * 0.4 - 0.08));
  const auto outside = simulated_records<P>(Ball<Kind::limit>{0.0}, {-1.0, 1.0}, {0, 0}, {0.1, 0.1}, {1.0, 0.0});
  CHECK(outside.status[0] == Status::left_domain);
  CHECK(outside.reached[0] == 0);
  CHECK(outside.x == std::vector<double>{-1.0, 1.0, -1.0, 1.0, -1.0, 1.0});
}

TEST_CASE("a step is carried from piece to piece") {
  std::size_t steps = 0, fresh = 0;
  const std::array<double, 2> theta = {0.5, 1.0};
  double x = 1.0, first = 0.0;
  for (int n = 0; n < 100; ++n) {
    using E = StateEquation<Valve, double>;
    const E equation(Valve{}, theta, {3.0});
    for (double* step : {&first, static_cast<double*>(nullptr)}) {
      E::State end{x};
      const auto outcome = Integrator<E, DormandPrince853>(equation, {}).run(end, 0.2, step ? *step : 0.0);
      (step ? steps : fresh) += outcome.attempts;
      if (step) *step = outcome.next_step;
      if (!step) x = end[0];
    }
  }
  CHECK(steps <= 102);
  CHECK(steps < fresh);
}

TEST_CASE("a long record is interrupted") {
  const std::vector<double> dt(200000, 1.0), u(200000, 0.5);
  int asked = 0;
  const Workers impatient(1, [&] { return ++asked > 1; });
  CHECK_THROWS_AS(simulated_records<P>(Valve{}, {0.0}, u, dt, {0.01, 3.0}, {1e-9}, impatient), Interrupted);
}

TEST_CASE("sensitivities are carried along runs, whatever shares a pack, and from where they start") {
  // x'' = -w^2 x: by w, S of a run of three segments is that of one; started at S0 it has the homogeneous part besides.
  const Oscillator model;
  const double w = 1.7, parts[] = {0.3, 0.5, 0.2};
  const std::size_t count = 11, segments = 3;
  std::vector<double> x0, u(count * segments), dt, s0;
  for (std::size_t k = 0; k < count; ++k) {
    x0.insert(x0.end(), {1.0 + 0.1 * k, 0.5 - 0.2 * k});
    for (std::size_t n = 0; n < segments; ++n) dt.push_back(k == 4 && n == 2 ? 0.0 : parts[n]);  // one of two segments
    s0.insert(s0.end(), {0.2, -0.1});
  }
  const std::vector<unsigned char> measured(count * segments, 1);
  const auto along = [&](std::size_t first, std::size_t last, const double* s, int threads) {
    const std::size_t some = last - first;
    struct {
      std::vector<double> x, y, dx, dy;
      std::vector<Status> status;
      std::vector<std::int64_t> reached;
    } r{std::vector<double>(some * 4 * 2), std::vector<double>(some * 3), std::vector<double>(some * 3 * 2),
        std::vector<double>(some * 3),     std::vector<Status>(some),     std::vector<std::int64_t>(some)};
    run_sensitivity_packs<P, DormandPrince853>(
        model, Runs{some, segments, x0.data() + 2 * first, u.data(), dt.data() + segments * first, false},
        RunStart{s ? s + 2 * first : nullptr, measured.data()}, Parameters{&w, false}, {1e-10}, Workers(threads),
        {r.x.data(), r.y.data(), r.dx.data(), r.dy.data(), r.status.data(), r.reached.data()});
    return r;
  };
  const auto all = along(0, count, s0.data(), 1), threaded = along(0, count, s0.data(), 3);
  CHECK(all.dx == threaded.dx);
  for (std::size_t k = 0; k < count; ++k) {
    CHECK(all.status[k] == Status::ok);
    CHECK(all.reached[k] == (k == 4 ? 2 : 3));
    const auto alone = along(k, k + 1, s0.data(), 1);
    double t = 0.0;
    for (std::size_t n = 0; n < static_cast<std::size_t>(all.reached[k]); ++n) {
      t += parts[n];
      const double a = x0[2 * k], b = x0[2 * k + 1], c = std::cos(w * t), s = std::sin(w * t);
      CHECK(std::abs(all.x[(k * 4 + n + 1) * 2] - (a * c + b / w * s)) < 1e-8);
      const double by_w = -a * t * s - b / (w * w) * s + b * t / w * c, by_start = 0.2 * c - 0.1 / w * s;
      CHECK(std::abs(all.dx[(k * 3 + n) * 2] - (by_w + by_start)) < 1e-8);
      CHECK(all.dx[(k * 3 + n) * 2] == alone.dx[n * 2]);
    }
  }
}

TEST_CASE("runs whose segments take other numbers of steps go on at their own pace, to the same bits as alone") {
  const Oscillator model;
  const std::size_t count = 23, segments = 9;
  std::vector<double> x0, u(count * segments), dt, w;
  for (std::size_t k = 0; k < count; ++k) {
    x0.insert(x0.end(), {1.0, 0.1 * k});
    w.push_back(0.5 + (7 * k % count) * (k % 5 == 0 ? 10.0 : 0.3));
    for (std::size_t n = 0; n < segments; ++n)
      dt.push_back(k % 6 == 1 && n + k % 4 >= segments ? 0.0 : 0.1 + 0.5 * ((n + k) % 3));
  }
  const std::vector<unsigned char> measured(count * segments, 1);
  const auto along = [&](std::size_t first, std::size_t last) {
    const std::size_t some = last - first;
    struct {
      std::vector<double> x, y, dx, dy;
      std::vector<Status> status;
      std::vector<std::int64_t> reached;
    } r{std::vector<double>(some * (segments + 1) * 2),
        std::vector<double>(some * segments),
        std::vector<double>(some * segments * 2),
        std::vector<double>(some * segments),
        std::vector<Status>(some),
        std::vector<std::int64_t>(some)};
    run_sensitivity_packs<P, DormandPrince853>(
        model, Runs{some, segments, x0.data() + 2 * first, u.data(), dt.data() + segments * first, false},
        RunStart{nullptr, measured.data()}, Parameters{w.data() + first, true}, {1e-9}, Workers(1),
        {r.x.data(), r.y.data(), r.dx.data(), r.dy.data(), r.status.data(), r.reached.data()});
    return r;
  };
  const auto all = along(0, count);
  const auto of_run = [](const std::vector<double>& values, std::size_t k, std::size_t each) {
    return std::vector<double>(values.begin() + k * each, values.begin() + (k + 1) * each);
  };
  for (std::size_t k = 0; k < count; ++k) {
    const auto alone = along(k, k + 1);
    CHECK(all.status[k] == Status::ok);
    CHECK(all.reached[k] == alone.reached[0]);
    CHECK(of_run(all.x, k, (segments + 1) * 2) == alone.x);
    CHECK(of_run(all.y, k, segments) == alone.y);
    CHECK(of_run(all.dx, k, segments * 2) == alone.dx);
    CHECK(of_run(all.dy, k, segments) == alone.dy);
  }
}
