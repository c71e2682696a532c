// Crossing jumps, and sliding along them: carts with Coulomb friction and a relay, against the solutions on paper.
#include <doctest/doctest.h>

#include <cmath>

#include "fisherpoint/integration/integrator.hpp"
#include "fisherpoint/integration/tangents.hpp"
#include "fisherpoint/kernels/run_sensitivities.hpp"
#include "fisherpoint/kernels/sensitivities.hpp"
#include "fisherpoint/kernels/simulate.hpp"
#include "fisherpoint/numbers/pack.hpp"

using namespace fisherpoint;

namespace {

// v' = a u - c sign(v): a cart that is pushed against friction.
struct Cart {
  static constexpr std::string_view name = "cart";
  static constexpr std::array states = {Quantity{"s", "m", "", 1.0}, Quantity{"v", "m/s", "", 1.0}};
  static constexpr std::array inputs = {Quantity{"u", "1", "", 1.0}};
  static constexpr std::array outputs = {states[0]};
  static constexpr std::array parameters = {Quantity{"a", "m/s2", "", 1.0}, Quantity{"c", "m/s2", "", 1.0}};
  static constexpr std::array jumps = {Surface{"v"}};
  static constexpr std::array<Surface, 0> kinks = {}, domain = {};
  auto dynamics(const auto& theta) const {
    const auto& [a, c] = theta;
    return [=](const auto& x, const auto& u, const auto& side) {
      const auto& [s, v] = x;
      const auto& [push] = u;
      const auto& [direction] = side;
      return std::tuple{v, a * push - c * direction};
    };
  }
  auto output(const auto& x, const auto&, const auto&) const { return std::tuple{std::get<0>(x)}; }
  auto switching(const auto& x, const auto&, const auto&) const { return std::tuple{std::get<1>(x)}; }
  auto limits(const auto&, const auto&, const auto&) const { return std::tuple{}; }
};

// z' = 1 beyond x = b, where x' = 1: z depends on b through the time of the crossing alone.
struct Counter {
  static constexpr std::string_view name = "counter";
  static constexpr std::array states = {Quantity{"x", "1", "", 1.0}, Quantity{"z", "1", "", 1.0}};
  static constexpr std::array<Quantity, 0> inputs = {};
  static constexpr std::array outputs = {states[1]};
  static constexpr std::array parameters = {Quantity{"b", "1", "", 1.0}};
  static constexpr std::array jumps = {Surface{"x - b"}};
  static constexpr std::array<Surface, 0> kinks = {}, domain = {};
  auto dynamics(const auto&) const {
    return [](const auto&, const auto&, const auto& side) {
      const auto& [beyond] = side;
      return std::tuple{1.0, heaviside(beyond)};
    };
  }
  auto output(const auto& x, const auto&, const auto&) const { return std::tuple{std::get<1>(x)}; }
  auto switching(const auto& x, const auto&, const auto& theta) const {
    return std::tuple{std::get<0>(x) - std::get<0>(theta)};
  }
  auto limits(const auto&, const auto&, const auto&) const { return std::tuple{}; }
};

using P = Pack<native_lanes>;

struct Result {
  std::vector<double> x, y, dx, dy;
  std::vector<Status> status;
};

template <class M>
Result sensitive(const M& model, const std::vector<double>& x0, const std::vector<double>& u, const std::vector<double>& dt,
                 const std::vector<double>& theta, double rtol, bool cross = true, int threads = 1) {
  const std::size_t count = dt.size(), n_x = M::states.size(), n_y = M::outputs.size(), p = M::parameters.size();
  Result out{std::vector<double>(count * n_x), std::vector<double>(count * n_y), std::vector<double>(count * n_x * p),
             std::vector<double>(count * n_y * p), std::vector<Status>(count)};
  sensitivity_packs<P, DormandPrince853>(model, {count, x0.data(), u.data(), dt.data()}, {theta.data(), false},
                                         {.relative = rtol, .cross_jumps = cross}, Workers(threads),
                                         {out.x.data(), out.y.data(), out.dx.data(), out.dy.data(), out.status.data()});
  return out;
}

}  // namespace

TEST_CASE("a state depends on what only the time of a jump depends on") {
  CHECK(Dependence<Counter>::depends(1, 0));
  CHECK(!Dependence<Counter>::depends(0, 0));
  const auto done = sensitive(Counter{}, {0.0, 0.0}, {}, {2.0}, {0.7}, 1e-10);
  REQUIRE(done.status[0] == Status::ok);
  CHECK(done.x[1] == doctest::Approx(1.3).epsilon(1e-12));
  CHECK(done.dx[1] == doctest::Approx(-1.0).epsilon(1e-12));
}

TEST_CASE("a cart reverses, and its sensitivities with it") {
  // Up to v = 0 at t = v0 / (a + c), then back with a - c.
  const double a = 3.0, c = 1.0, v0 = 2.0, dt = 1.5, turn = v0 / (a + c), rest = dt - turn;
  const auto done = sensitive(Cart{}, {0.5, v0}, {-1.0}, {dt}, {a, c}, 1e-10);
  REQUIRE(done.status[0] == Status::ok);
  CHECK(done.x[1] == doctest::Approx(-(a - c) * rest).epsilon(1e-11));
  CHECK(done.x[0] == doctest::Approx(0.5 + v0 * turn / 2 - (a - c) * rest * rest / 2).epsilon(1e-11));
  const double dturn = -v0 / ((a + c) * (a + c));  // by a and by c
  CHECK(done.dx[2] == doctest::Approx(-rest + (a - c) * dturn).epsilon(1e-10));
  CHECK(done.dx[3] == doctest::Approx(rest + (a - c) * dturn).epsilon(1e-10));
  CHECK(done.dx[0] == doctest::Approx(v0 * dturn / 2 - rest * rest / 2 + (a - c) * rest * dturn).epsilon(1e-10));
}

TEST_CASE("a cart comes to rest and sticks; from rest it breaks away or stays") {
  const double a = 1.0, c = 2.0;
  const auto done =
      sensitive(Cart{}, {0.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0}, {1.0, 0.5, 3.0, -3.0}, {5.0, 1.0, 1.0, 1.0}, {a, c}, 1e-9);
  for (const Status status : done.status) REQUIRE(status == Status::ok);
  CHECK(done.x[0] == doctest::Approx(4.5).epsilon(1e-9));  // 3^2 / (2 (c - a))
  CHECK(std::abs(done.x[1]) < 1e-12);
  CHECK(done.dx[0] == doctest::Approx(4.5).epsilon(1e-8));  // by a
  CHECK(done.dx[1] == doctest::Approx(-4.5).epsilon(1e-8));
  CHECK(std::abs(done.dx[2]) < 1e-10);
  CHECK(std::abs(done.x[2]) < 1e-12);  // stays
  CHECK(std::abs(done.dx[4]) < 1e-12);
  CHECK(done.x[5] == doctest::Approx(1.0).epsilon(1e-10));
  CHECK(done.x[7] == doctest::Approx(-1.0).epsilon(1e-10));
  CHECK(done.dx[2 * 4 + 3] == doctest::Approx(-1.0).epsilon(1e-10));
}

TEST_CASE("what has no derivative is named") {
  // Ends where it turns; and excluded where jumps are.
  CHECK(sensitive(Cart{}, {0.0, 2.0}, {-1.0}, {0.5}, {3.0, 1.0}, 1e-6).status[0] == Status::on_jump);
  CHECK(sensitive(Cart{}, {0.0, 2.0}, {-1.0}, {1.5}, {3.0, 1.0}, 1e-6, false).status[0] == Status::met_jump);
  // A start off a jump that theta moves.
  CHECK(sensitive(Counter{}, {0.7, 0.0}, {}, {1.0}, {0.7}, 1e-6).status[0] == Status::on_jump);
}

TEST_CASE("results at jumps do not depend on the neighbours and the threads") {
  std::vector<double> x0, u, dt;
  for (int i = 0; i < 57; ++i) {
    x0.insert(x0.end(), {0.0, i % 3 ? std::sin(11.0 * i) : 0.0});
    u.push_back(2 * std::cos(7.0 * i));
    dt.push_back(0.1 + 0.05 * i);
  }
  const std::vector<double> theta = {1.5, 1.0};
  const auto all = sensitive(Cart{}, x0, u, dt, theta, 1e-6), five = sensitive(Cart{}, x0, u, dt, theta, 1e-6, true, 5);
  CHECK(all.dx == five.dx);
  CHECK(all.x == five.x);
  for (int i = 0; i < 57; ++i) {
    const auto one = sensitive(Cart{}, {x0[2 * i], x0[2 * i + 1]}, {u[i]}, {dt[i]}, theta, 1e-6);
    CHECK(one.status[0] == all.status[i]);
    for (int e = 0; e < 4; ++e) CHECK(one.dx[e] == all.dx[4 * i + e]);
  }
}

TEST_CASE("a jump at the end of a segment is passed once, and what friction holds has no sensitivities") {
  // x = t meets b at the end of the third of five segments, but for rounding: dz/db = -1 behind it.
  const std::size_t count = 5, segments = 5;
  std::vector<double> theta;
  for (const double ulps : {-2.0, -1.0, 0.0, 1.0, 2.0}) theta.push_back(0.1 + 0.1 + 0.1 + ulps * 5.6e-17);
  const auto along = [&]<class M>(const M& model, std::size_t runs, const std::vector<double>& x0, const std::vector<double>& u,
                                  const Parameters& parameters, const std::vector<unsigned char>& measured) {
    const std::size_t p = M::parameters.size();
    Result r{std::vector<double>(runs * (segments + 1) * 2), std::vector<double>(runs * segments),
             std::vector<double>(runs * segments * 2 * p), std::vector<double>(runs * segments * p), std::vector<Status>(runs)};
    std::vector<std::int64_t> reached(runs);
    const std::vector<double> dt(runs * segments, 0.1);
    run_sensitivity_packs<P, DormandPrince853>(
        model, Runs{runs, segments, x0.data(), u.data(), dt.data(), false}, RunStart{nullptr, measured.data()}, parameters,
        {.cross_jumps = true}, Workers(1), {r.x.data(), r.y.data(), r.dx.data(), r.dy.data(), r.status.data(), reached.data()});
    return r;
  };
  std::vector<unsigned char> last;
  for (std::size_t k = 0; k < count; ++k) last.insert(last.end(), {0, 0, 0, 0, 1});
  const auto done = along(Counter{}, count, std::vector<double>(2 * count), {}, {theta.data(), true}, last);
  for (std::size_t k = 0; k < count; ++k) {
    REQUIRE(done.status[k] == Status::ok);
    CHECK(done.x[(k * 6 + 5) * 2 + 1] == doctest::Approx(0.5 - theta[k]).epsilon(1e-9));
    CHECK(done.dx[(k * 5 + 4) * 2 + 1] == doctest::Approx(-1.0).epsilon(1e-9));
  }
  // Sampled there it has none, and goes on.
  const std::vector<unsigned char> all(count * segments, 1);
  const auto sampled = along(Counter{}, count, std::vector<double>(2 * count), {}, {theta.data(), true}, all);
  for (std::size_t k = 0; k < count; ++k) {
    CHECK(sampled.status[k] == Status::ok);
    CHECK(sampled.dy[k * 5 + 2] == 0.0);
    CHECK(sampled.dy[k * 5 + 4] == doctest::Approx(-1.0).epsilon(1e-9));
  }

  // A cart that comes to rest at that instant: it is stuck behind it, or pushed on, by which the order matters.
  const std::vector<double> of_cart = {1.0, 2.0}, stays = {0, 0, 0, 0.5, -0.5}, goes = {0, 0, 0, 4.0, 4.0};
  const auto stuck = along(Cart{}, 1, {0.0, 2.0 * 0.3}, stays, {of_cart.data(), false}, all);
  REQUIRE(stuck.status[0] == Status::ok);
  for (int e = 2; e < 4; ++e) CHECK(stuck.dx[4 * 4 + e] == 0.0);
  CHECK(stuck.dx[4 * 4 + 1] == doctest::Approx(-0.045).epsilon(1e-9));  // of v0^2 / (2 c)
  CHECK(along(Cart{}, 1, {0.0, 2.0 * 0.3}, goes, {of_cart.data(), false}, all).status[0] == Status::on_jump);
}
