#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <type_traits>
#include <vector>

#include "models.hpp"
#include "rows_and_columns.hpp"

using namespace fisherpoint;
using namespace fisherpoint::testing;
using P = Pack<native_lanes>;

namespace {

const Start cylinder_start = {
    {0.0777, 0.178, 8.99e6, 1.03e7, -0.62}, {-0.86}, {cylinder_theta.begin(), cylinder_theta.end()}, {1.0, -1.0}};

}  // namespace

TEST_CASE_TEMPLATE("rows are the columns', to rounding", Method, FISHERPOINT_METHODS) {
  for (const int steps : {1, 2, 9}) {
    CHECK(difference_of_rows<double, Method>(HydraulicCylinder{}, cylinder_start, 2e-3, steps) < 1e-12);
    CHECK(difference_of_rows<P, Method>(HydraulicCylinder{}, cylinder_start, 2e-3, steps) < 1e-12);
    CHECK(difference_of_rows<P, Method>(Oscillator{}, {{1.0, 0.2}, {0.0}, {1.7}, {}}, 1.0, steps) < 1e-12);
    CHECK(difference_of_rows<P, Method>(Ball<Kind::kink>{0.0}, {{0.7, 2.1}, {0.0}, {3.0, 5.0}, {1.0}}, 0.5, steps) < 1e-12);
  }
}

TEST_CASE("so many steps that their Jacobians are not kept are linearised again") {
  CHECK(difference_of_rows<double, DormandPrince853>(HydraulicCylinder{}, cylinder_start, 5e-3, 1000) < 1e-11);
}

TEST_CASE_TEMPLATE("a row ends with the derivatives by the start", Method, FISHERPOINT_METHODS) {
  using E = VariationalEquation<Oscillator, double>;
  const double w = 1.7, t = 2.0;
  const E equation(Oscillator{}, {w}, {0.0});
  Adjoints<Oscillator, double, Method> adjoints(equation, {1.0, 0.3}, {});
  for (int n = 0; n < 64; ++n) adjoints.advance(t / 64, {});
  typename Adjoints<Oscillator, double, Method>::Rows rows;
  rows.push_back(adjoints.row());
  rows[0].lambda[0] = 1.0;
  adjoints.back(rows);
  CHECK(rows[0].lambda[0] == doctest::Approx(std::cos(w * t)).epsilon(1e-9));
  CHECK(rows[0].lambda[1] == doctest::Approx(std::sin(w * t) / w).epsilon(1e-9));
}

TEST_CASE_TEMPLATE("dy/dtheta alone, by rows, is that beside dx/dtheta, to the tolerance", Method, FISHERPOINT_METHODS) {
  const std::array x0 = {0.25, 0.15, 10e6, 11e6, -0.16};  // over x_v = 0
  const std::array u = {-0.2};
  const double dt = 1.4e-3;
  const auto method = std::is_same_v<Method, DormandPrince> ? MethodName::RK45 : MethodName::DOP853;
  const auto of_kernel = [&](double rtol, bool columns) {
    Sensitive<HydraulicCylinder> r;
    sensitivities(HydraulicCylinder{}, Points{1, x0.data(), u.data(), &dt}, Parameters{cylinder_theta.data(), false},
                  {.relative = rtol, .method = method}, Workers(1),
                  SensitiveTrajectories{r.x.data(), r.y.data(), columns ? r.dx[0].data() : nullptr, r.dy[0].data(), &r.status});
    REQUIRE(r.status == Status::ok);
    return r;
  };
  const auto exact = of_kernel(1e-12, true);
  for (const double rtol : {1e-4, 1e-6, 1e-8}) {
    const auto r = of_kernel(rtol, false);
    for (int j = 0; j < 9; ++j) {
      for (const int i : {0, 1, 2}) CHECK(r.dy[i][j] == doctest::Approx(exact.dy[i][j]).epsilon(20 * rtol));
      CHECK(r.dy[3][j] == 0.0);
    }
  }
}

TEST_CASE("the estimate of the rows' errors falls with the steps, where x stands still too") {
  // At rest x has no error; its sensitivity moves.
  using M = Ball<Kind::kink>;
  using Adjoint = Adjoints<M, double, DormandPrince853>;
  const VariationalEquation<M, double> equation(M{1.0}, {4.0, -2.0}, {0.0});
  double last = 1e300;
  for (const int steps : {1, 2, 4}) {
    Adjoint adjoints(equation, {3.0, 0.0}, {});  // -g - k (s - floor) = 0
    for (int n = 0; n < steps; ++n) adjoints.advance(3.0 / steps, {1.0});
    Adjoint::Rows rows;
    rows.push_back(adjoints.row());
    rows[0].lambda[0] = 1.0;
    adjoints.back(rows);
    const double estimate = adjoints.relative_error(), root = std::sqrt(2.0);
    CHECK(adjoints.x[0] == 3.0);
    const double error = std::abs(rows[0].gradient[0] / ((1.0 - std::cosh(3.0 * root)) / 2.0) - 1.0);
    CHECK(error < 2.0 * estimate);
    CHECK(estimate < 0.2 * last);
    last = estimate;
  }
}
