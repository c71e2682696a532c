#include <doctest/doctest.h>

#include <cmath>
#include <functional>

#include "fisherpoint/numbers/dual.hpp"

using namespace fisherpoint;

// Every operation against central differences of the same expression on doubles.
template <class F>
static void check(F&& f, double a, double b) {
  const auto dual = f(variable<0>(a), variable<1>(b));
  CHECK(dual.value == doctest::Approx(f(a, b)).epsilon(1e-15));
  const double h = 1e-6;
  CHECK(slope_of<0, double>(dual) == doctest::Approx((f(a + h, b) - f(a - h, b)) / (2 * h)).epsilon(1e-8));
  CHECK(slope_of<1, double>(dual) == doctest::Approx((f(a, b + h) - f(a, b - h)) / (2 * h)).epsilon(1e-8));
}

TEST_CASE("derivatives of every operation") {
  const double a = 1.3, b = 0.7;
  check([](auto x, auto y) { return x + y; }, a, b);
  check([](auto x, auto y) { return x - y; }, a, b);
  check([](auto x, auto y) { return x * y; }, a, b);
  check([](auto x, auto y) { return x / y; }, a, b);
  check([](auto x, auto y) { return -(x * y); }, a, b);
  check([](auto x, auto y) { return fisherpoint::sqrt(x * y); }, a, b);
  check([](auto x, auto y) { return (x + 2.0) * (2.0 + y) + x * 3.0 - 3.0 * y; }, a, b);
  check([](auto x, auto y) { return (x - 2.0) / 4.0 + (2.0 - y) + 5.0 / (x + y); }, a, b);
  check([](auto x, auto y) { return x / 2 + 3 * y / 4 - 1 / (x * 2); }, a, b);
  check([](auto x, auto y) { return x / (x + y) * fisherpoint::sqrt(3.0 - x) - y * y; }, a, b);
}

TEST_CASE("the type carries what a value depends on") {
  const auto x = variable<0>(2.0);
  const auto y = variable<5>(3.0);
  static_assert(variables_of<std::remove_cvref_t<decltype(x * y)>> == 0b100001);
  static_assert(variables_of<std::remove_cvref_t<decltype(x + 1.0)>> == 0b1);
  static_assert(sizeof(x * y) == 3 * sizeof(double));
  static_assert(variables_of<double> == 0);
  CHECK((x * y).slope<5>() == 2.0);
  CHECK(slope_of<3, double>(x * y) == 0.0);
  int visited = 0;
  for_each_variable<0b100001>([&](auto k) { visited += k; });
  CHECK(visited == 5);
}
