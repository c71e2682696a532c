#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "fisherpoint/numbers/functions.hpp"

namespace fisherpoint {
using P = Pack<native_lanes>;

namespace {

// f on a plain number, on every lane of a pack, and on a dual, whose slope is held against a central difference.
void check(auto&& f, double at) {
  const double h = 1e-6 * std::max(1.0, std::abs(at));
  const double value = f(at), slope = (f(at + h) - f(at - h)) / (2 * h);
  const auto packed = f(Dual<P, 0b100>{P(at), {P(2.0)}});
  const auto single = f(Dual<double, 0b100>{at, {2.0}});
  CHECK(single.value == doctest::Approx(value).epsilon(1e-14));
  CHECK(single.template slope<2>() == doctest::Approx(2 * slope).epsilon(1e-7));
  for (int lane = 0; lane < native_lanes; ++lane) {
    CHECK(f(P(at))[lane] == doctest::Approx(value).epsilon(1e-14));
    CHECK(packed.value[lane] == doctest::Approx(value).epsilon(1e-14));
    CHECK(packed.template slope<2>()[lane] == doctest::Approx(2 * slope).epsilon(1e-7));
  }
}

}  // namespace

TEST_CASE("elementary functions and their slopes") {
  for (const double at : {-0.9, -0.3, 0.2, 0.7}) {
    check([](const auto& x) { return exp(x); }, 3 * at);
    check([](const auto& x) { return sin(x); }, 5 * at);
    check([](const auto& x) { return cos(x); }, 5 * at);
    check([](const auto& x) { return tan(x); }, at);
    check([](const auto& x) { return asin(x); }, at);
    check([](const auto& x) { return acos(x); }, at);
    check([](const auto& x) { return atan(x); }, 3 * at);
    check([](const auto& x) { return sinh(x); }, 2 * at);
    check([](const auto& x) { return cosh(x); }, 2 * at);
    check([](const auto& x) { return tanh(x); }, 2 * at);
    check([](const auto& x) { return log(x); }, 1 + at);
    check([](const auto& x) { return abs(x); }, at);
    check([](const auto& x) { return power(x, std::remove_cvref_t<decltype(value_of(x))>(3.0)); }, 2 * at);  // negative too
    check([](const auto& x) { return power(x, std::remove_cvref_t<decltype(value_of(x))>(-2.0)); }, 2 * at);
    check([](const auto& x) { return power(std::remove_cvref_t<decltype(value_of(x))>(1.7), x); }, 2 * at);
    check([](const auto& x) { return power(x, x); }, 1 + at);
    check([](const auto& x) { return min(x * x, std::remove_cvref_t<decltype(value_of(x))>(0.3)); }, at);
    check([](const auto& x) { return max(x * x, x); }, at);
  }
}

TEST_CASE("a choice takes the value and the slopes of its branch, and nothing of the other") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Dual<double, 0b01> a{1.5, {2.0}};
  const Dual<double, 0b10> b{nan, {nan}};
  const auto first = choose(1.0, a, b), second = choose(-1.0, b, a);
  const auto constant = choose(0.0, b, 4.0);
  CHECK(first.value == 1.5);
  CHECK(first.slope<0>() == 2.0);
  CHECK(first.slope<1>() == 0.0);
  CHECK(second.value == 1.5);
  CHECK(second.slope<1>() == 0.0);
  CHECK(constant.value == 4.0);
  CHECK(constant.slope<1>() == 0.0);
  CHECK(choose(a, 1.0, 2.0) == 1.0);  // no branch has a slope
  CHECK(sign(a) == 1.0);
  CHECK(sign(-0.5) == -1.0);
  CHECK(sign(0.0) == 0.0);
}

}  // namespace fisherpoint
