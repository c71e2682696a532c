#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "fisherpoint/numbers/pack.hpp"

using namespace fisherpoint;
constexpr int W = 2 * native_lanes;
using P = Pack<W>;

static P ramp(double first, double step) {
  P r;
  for (int i = 0; i < W; ++i) r.set(i, first + step * i);
  return r;
}

TEST_CASE("arithmetic is that of the lanes") {
  const P a = ramp(1.5, 0.25), b = ramp(-3.0, 0.75) + 0.1;
  for (int i = 0; i < W; ++i) {
    CHECK((a + b)[i] == a[i] + b[i]);
    CHECK((a - b)[i] == a[i] - b[i]);
    CHECK((a * b)[i] == a[i] * b[i]);
    CHECK((a / b)[i] == a[i] / b[i]);
    CHECK((-a)[i] == -a[i]);
    CHECK(abs(b)[i] == std::abs(b[i]));
    CHECK(min(a, b)[i] == std::min(a[i], b[i]));
    CHECK(max(a, b)[i] == std::max(a[i], b[i]));
    CHECK((2.0 * a)[i] == 2.0 * a[i]);
  }
}

TEST_CASE("the square root is right to the last place, zero and NaN included") {
  double worst = 0;
  for (double a = 1e-290; a < 1e290; a *= 1.0917) {
    const double root = sqrt(P(a))[0], exact = std::sqrt(a);
    worst = std::max(worst, std::abs(root - exact) / (std::nextafter(exact, 1e300) - exact));
  }
  CHECK(worst <= 1.0);
  CHECK(sqrt(P(0.0))[1] == 0.0);
  CHECK(std::isnan(sqrt(P(-1.0))[0]));
}

TEST_CASE("masks select lane by lane, and NaN compares false") {
  P a = ramp(0.0, 1.0);
  a.set(1, std::numeric_limits<double>::quiet_NaN());
  const auto small = a <= P(1.5);
  CHECK(small[0]);
  CHECK_FALSE(small[1]);
  CHECK_FALSE((!small)[0]);
  CHECK((!small)[1]);
  CHECK(any(small));
  CHECK_FALSE(any(small & !small));
  CHECK_FALSE(any(Mask<W>::none()));
  const P chosen = select(small, P(1.0), P(2.0));
  CHECK(chosen[0] == 1.0);
  CHECK(chosen[1] == 2.0);
  for (int lane = 0; lane < W; ++lane) {
    auto one = Mask<W>::none();
    one.set(lane, true);
    CHECK(any(one));
  }
}

TEST_CASE_TEMPLATE("inverse roots are good enough for step control, and the same in pack and double", N,
                   std::integral_constant<int, 10>, std::integral_constant<int, 16>) {
  for (double a = 1e-20; a < 1e12; a *= 1.37) {
    const double root = rough_inverse_root(a, N{});
    CHECK(root * std::pow(a, 1.0 / N::value) == doctest::Approx(1.0).epsilon(0.006));
    CHECK(rough_inverse_root(P(a), N{})[W - 1] == doctest::Approx(root).epsilon(1e-14));
  }
}

TEST_CASE("quotients and roots of zeros, infinities and NaN are what IEEE 754 says") {
  const double infinity = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();
  const auto same = [](double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); };
  const double numbers[] = {0.0, -0.0, 1.0, -1.0, 3.0, -7e-200, 1e200, -1e308, 3e-308, infinity, -infinity, nan};
  for (const double a : numbers) {
    for (const double b : numbers) {
      CAPTURE(a);
      CAPTURE(b);
      const double quotient = (P(a) / P(b))[0];
      if (std::isfinite(a / b) && std::isnormal(a / b))
        CHECK(quotient == doctest::Approx(a / b).epsilon(3e-16));
      else if (a / b != 0.0 && std::isfinite(a / b))
        CHECK(quotient == doctest::Approx(a / b).epsilon(1e-12));
      else
        CHECK(same(a / b, quotient));
    }
    CAPTURE(a);
    const auto [root, slope] = root_and_slope(P(a));
    const auto [plain_root, plain_slope] = root_and_slope(a);
    if (std::isnormal(plain_root)) {
      CHECK(root[0] == doctest::Approx(plain_root).epsilon(4e-16));
      CHECK(slope[0] == doctest::Approx(plain_slope).epsilon(4e-16));
    } else {
      CHECK(same(std::sqrt(a), root[0]));
      CHECK(same(std::sqrt(a), sqrt(P(a))[W - 1]));
      if (!std::signbit(a) || a != 0.0) CHECK(same(plain_slope, slope[0]));  // 1 / -0, which no model has
    }
  }
}

TEST_CASE("a root and its derivative at once") {
  for (double a = 1e-12; a < 1e12; a *= 3.7) {
    const auto [root, slope] = root_and_slope(P(a));
    CHECK(root[0] == doctest::Approx(std::sqrt(a)).epsilon(4e-16));
    CHECK(slope[W - 1] == doctest::Approx(0.5 / std::sqrt(a)).epsilon(1e-15));
  }
}

TEST_CASE("load and store keep the order of lanes") {
  double from[W], to[W];
  for (int i = 0; i < W; ++i) from[i] = i * i;
  P::load(from).store(to);
  for (int i = 0; i < W; ++i) CHECK(to[i] == from[i]);
}
