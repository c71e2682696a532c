#include <doctest/doctest.h>

#include <cmath>

#include "fisherpoint/numbers/quartic.hpp"

using namespace fisherpoint;

static Quartic<double> of(auto&& f, auto&& slope) {
  return Quartic<double>::through(f(0.0), slope(0.0), f(0.5), f(1.0), slope(1.0));
}

TEST_CASE("a quartic is reproduced, and its zero found") {
  const auto f = [](double s) { return (0.37 - s) * (1 + s * s) * (2 - s); };
  const auto slope = [&](double s) { return (f(s + 1e-6) - f(s - 1e-6)) / 2e-6; };
  CHECK(of(f, slope).zero() == doctest::Approx(0.37).epsilon(1e-9));
}

TEST_CASE("positive coefficients prove that there is no zero; a dip below zero between positive ends is never missed") {
  for (double depth = -0.2; depth < 0.2; depth += 0.003) {
    const auto f = [&](double s) { return 4 * (s - 0.45) * (s - 0.45) - depth; };
    const auto slope = [&](double s) { return 8 * (s - 0.45); };
    const auto q = of(f, slope);
    if (depth >= 0) CHECK_FALSE(q.clear());
  }
  CHECK(of([](double) { return 1.0; }, [](double) { return 0.0; }).clear());
}

TEST_CASE("where the curve is no cubic, its coefficients must stay well off zero") {
  const auto bump = [](double height) {  // s^4 rises late: the cubic through its ends is not far off, but is not it
    const auto f = [=](double s) { return height + s * s * s * s; };
    return of(f, [](double s) { return 4 * s * s * s; });
  };
  CHECK(bump(0.1).clear());
  CHECK(bump(0.01).least_inside() > 0);
  CHECK_FALSE(bump(0.01).clear());
}

TEST_CASE("what goes up and down wavers, what decays does not; the quartic has its value everywhere") {
  const auto f = [](double s) { return (0.37 - s) * (1 + s * s) * (2 - s); };
  const auto q = of(f, [&](double s) { return (f(s + 1e-6) - f(s - 1e-6)) / 2e-6; });
  for (double t : {0.0, 0.29, 0.74, 1.0}) CHECK(q.at(t) == doctest::Approx(f(t)).epsilon(1e-8));
  const auto wave = of([](double s) { return 1.2 + std::cos(8 * s); }, [](double s) { return -8 * std::sin(8 * s); });
  CHECK(wave.wavers());
  CHECK_FALSE(of([](double s) { return std::exp(-s); }, [](double s) { return -std::exp(-s); }).wavers());
  CHECK_FALSE(of([](double s) { return 9 + s; }, [](double) { return 1.0; }).wavers());
  CHECK_FALSE(of([](double) { return 1.0; }, [](double) { return 0.0; }).clear(1.5));  // as far off as it is high
}

TEST_CASE("what keeps off zero is clear, does not end next to it, and falls to no less than a quarter; not where it is NaN") {
  int kept = 0;
  const auto turn = [](int k, double prime) { return std::fmod(k * std::sqrt(prime), 1.0); };
  for (int k = 1; k < 20000; ++k) {
    const double start = turn(k, 2.0) - 0.1, end = turn(k, 3.0) - 0.1, middle = turn(k, 5.0) - 0.1;
    const auto q = Quartic<double>::through(start, 8 * turn(k, 7.0) - 4, middle, end, 8 * turn(k, 11.0) - 4);
    if (!q.keeps_off()) continue;
    ++kept;
    CHECK((q.b0 > 0 && q.b4 > 0 && q.clear()));
    CHECK(q.b4 > 0.1 * 4 * (q.b3 - q.b4));
    CHECK((q.b4 > 0.25 * q.b0 && q.b0 > 0.25 * q.b4));
  }
  CHECK(kept > 500);
  const double nan = std::nan("");
  CHECK(Quartic<double>::through(1.0, 0.0, 1.0, 1.0, 0.0).keeps_off());
  for (const auto& q : {Quartic<double>::through(nan, 0, 1, 1, 0), Quartic<double>::through(1, nan, 1, 1, 0),
                        Quartic<double>::through(1, 0, nan, 1, 0), Quartic<double>::through(1, 0, 1, nan, 0),
                        Quartic<double>::through(1, 0, 1, 1, nan)})
    CHECK_FALSE(q.keeps_off());
}

TEST_CASE("a start on the surface has its zero there") {
  const auto q = of([](double s) { return -s; }, [](double) { return -1.0; });
  CHECK(q.zero() == doctest::Approx(0.0));
}
