#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "models.hpp"

using namespace fisherpoint;
using namespace fisherpoint::testing;

TEST_CASE_TEMPLATE("the oscillator's sensitivity is the closed form's", Method, FISHERPOINT_METHODS) {
  const double w = 1.7, t = 3.0;
  const auto r = run_sensitive<double, Method>(Oscillator{}, std::array{1.0, 0.0}, std::array{0.0}, t, std::array{w}, {1e-10});
  CHECK(r.status == Status::ok);
  CHECK(r.dx[0][0] == doctest::Approx(-t * std::sin(w * t)).epsilon(1e-9));
  CHECK(r.dy[0][0] == r.dx[0][0]);
}

TEST_CASE_TEMPLATE("every column keeps to the tolerance, however small it is", Method, FISHERPOINT_METHODS) {
  // The spring's stiffness acts for a moment only: its column is 1e-4 of the other.
  const double s = -0.7, v = 2.1, g = 3.0, k = 5.0, t = 0.7;
  const std::array x0 = {s, v}, theta = {g, k};
  const std::array u = {0.0};
  const auto tight = run_sensitive<double, Method>(Ball<Kind::kink>{0.0}, x0, u, t, theta, {1e-12});
  CHECK(std::abs(tight.dx[0][1]) < 1e-3 * std::abs(tight.dx[0][0]));
  for (double rtol : {1e-4, 1e-6, 1e-8}) {
    const auto r = run_sensitive<double, Method>(Ball<Kind::kink>{0.0}, x0, u, t, theta, {rtol});
    for (int j = 0; j < 2; ++j) CHECK(r.dx[0][j] == doctest::Approx(tight.dx[0][j]).epsilon(10 * rtol));
  }
}

TEST_CASE("the pattern of S follows from the types") {
  using E = Dependence<HydraulicCylinder>;
  static_assert(E::in_columns == 4 * 9);  // the spool's row is zero
  for (int j = 0; j < 9; ++j) {
    CHECK_FALSE(E::depends(4, j));
    CHECK(E::depends(0, j));
  }
  static_assert(E::output_depends(Count<0>{}) && E::output_depends(Count<1>{}) && E::output_depends(Count<2>{}));
  static_assert(!E::output_depends(Count<3>{}));
}

TEST_CASE("f and its Jacobian, on one evaluation, against central differences") {
  using E = VariationalEquation<HydraulicCylinder, double>;
  using D = Dependence<HydraulicCylinder>;
  using Plain = StateEquation<HydraulicCylinder, double>;
  const HydraulicCylinder model;
  const std::array x = {0.0777, 0.178, 8.99e6, 1.03e7, -0.62};
  const std::array u = {-0.86};
  const std::array side = {1.0, -1.0};
  E::State rate;
  Jacobian<HydraulicCylinder, double> jacobian;
  E(model, cylinder_theta, u).linearise(x, side, rate, jacobian);
  const auto plain = [&](auto x, auto theta) {
    Plain::State dx;
    Plain(model, theta, u).derivative(x, side, dx);
    return dx;
  };
  for (int i = 0; i < 5; ++i) CHECK(rate[i] == doctest::Approx(plain(x, cylinder_theta)[i]).epsilon(1e-13));
  const auto difference = [&](int i, auto&& shifted, double h) { return (shifted(h)[i] - shifted(-h)[i]) / (2 * h); };
  for_each_index<5>([&](auto i) {
    for (int k = 0; k < 4; ++k) {
      const double h = 1e-5 * std::abs(x[k]);
      const auto by_state = [&](double h) {
        auto at = x;
        at[k] += h;
        return plain(at, cylinder_theta);
      };
      const auto coupled = D::coupled(i);
      const double slope = (coupled >> k) & 1 ? jacobian.by_state[D::state_start[i] + detail::below(coupled, k)] : 0.0;
      CHECK(slope * h == doctest::Approx(difference(i, by_state, h) * h).epsilon(1e-6));
    }
    for_each_index<9>([&](auto j) {
      const double h = 1e-5 * cylinder_theta[j];
      const auto by_theta = [&](double h) {
        auto theta = cylinder_theta;
        theta[j] += h;
        return plain(x, theta);
      };
      const auto driven = D::driven(j);
      const double slope = (driven >> i) & 1 ? jacobian.by_theta[D::theta_start[j] + detail::below(driven, i)] : 0.0;
      CHECK(slope * h == doctest::Approx(difference(i, by_theta, h) * h).epsilon(1e-6));
    });
  });
}

TEST_CASE("slopes that a model calls constant stay as they are on both sides of its kinks, others do not") {
  using E = VariationalEquation<HydraulicCylinder, double>;
  using D = Dependence<HydraulicCylinder>;
  const E equation(HydraulicCylinder{}, cylinder_theta, {-0.86});
  const auto entries_at = [&](const E::State& x, double spool) {
    std::vector<double> entries(D::changing + D::constant);
    E::State rate;
    equation.linearise(x, {1.0, spool}, rate, [&](int e, double slope) { entries[e] = slope; });
    return entries;
  };
  const auto one = entries_at({0.0777, 0.178, 8.99e6, 1.03e7, -0.62}, -1.0),
             other = entries_at({0.11, 0.05, 5e6, 6e6, 0.4}, 1.0);
  int constant = 0;
  for (int e = 0; e < D::changing + D::constant; ++e) {
    // What volumes do to the other chamber cancels: it is zero in both states.
    if (one[e] != 0.0 || other[e] != 0.0) CHECK((D::kept_at(e) < 0) == (one[e] == other[e]));
    constant += D::kept_at(e) < 0;
  }
  CHECK(constant == 5);
}

TEST_CASE_TEMPLATE("the cylinder's sensitivities against central differences of the trajectory", Method, FISHERPOINT_METHODS) {
  const std::array x0 = {0.0777, 0.178, 8.99e6, 1.03e7, -0.62};
  const std::array u = {-0.86};
  const double dt = 5.7e-3;
  const auto r = run_sensitive<double, Method>(HydraulicCylinder{}, x0, u, dt, cylinder_theta, {1e-11});
  CHECK(r.status == Status::ok);
  const auto shifted = [&](int j, double share) {
    auto theta = cylinder_theta;
    theta[j] *= 1 + share;
    return run<double>(HydraulicCylinder{}, x0, u, dt, theta, {1e-12}).first;
  };
  for (int j = 0; j < 9; ++j) {
    const auto up = shifted(j, 1e-3), down = shifted(j, -1e-3);
    for (int i = 0; i < 4; ++i) {
      const double scale = HydraulicCylinder::states[i].scale;
      const double difference = (up[i] - down[i]) / (2e-3 * scale), slope = r.dx[i][j] * cylinder_theta[j] / scale;
      CHECK(slope == doctest::Approx(difference).epsilon(1e-4));
    }
    CHECK(r.dx[4][j] == 0.0);
  }
}

TEST_CASE("a path refined keeps its ends, its kinks and the trend of its steps") {
  using M = Ball<Kind::kink>;
  PointPath<M> path;
  for (const double size : {0.1, 0.2, 0.4}) path.push_back(size, {-1.0}, false);
  path.push_back(0.3, {1.0}, false);
  REQUIRE(path.runs.size() == 2);
  for (double factor : {1.0, 1.2, 2.0, 3.7}) {
    const auto finer = refined<M>(path, factor);
    double before = 0.0, behind = 0.0;
    for (std::size_t n = 0; n < finer.size(); ++n) {
      CHECK(finer.sizes[n] > 0.0);
      (n < finer.runs[0].end ? before : behind) += finer.sizes[n];
    }
    CHECK(finer.runs[0].side[0] == -1.0);
    CHECK(finer.runs[1].side[0] == 1.0);
    CHECK(finer.runs[1].end == finer.size());
    CHECK(before == doctest::Approx(0.7).epsilon(1e-14));
    CHECK(behind == doctest::Approx(0.3).epsilon(1e-14));
    CHECK(finer.size() == std::ceil(3 * factor) + std::ceil(factor));
  }
  const auto same = refined<M>(path, 1.0);
  for (std::size_t i = 0; i < path.size(); ++i) CHECK(same.sizes[i] == doctest::Approx(path.sizes[i]).epsilon(1e-14));
}

TEST_CASE("a step away from a surface, or towards one, is parted so that the distance to it does not treble") {
  for (double growth : {1.0, 4.5, 9.0, 700.0, -4.5, -700.0}) {
    std::vector<double> shares;
    for_each_part(growth, [&](double share) { shares.push_back(share); });
    if (growth < 0.0) std::reverse(shares.begin(), shares.end());
    double at = 1.0, sum = 0.0;  // the distance, as it grows from 1 to `growth`
    for (double share : shares) {
      const double next = at + share * (std::abs(growth) - 1.0);
      CHECK(next <= 3.0 * at);
      at = next;
      sum += share;
    }
    CHECK(sum == 1.0);
  }
  std::vector<double> whole;
  for_each_part(0.0, [&](double share) { whole.push_back(share); });
  CHECK(whole == std::vector<double>{1.0});
}
