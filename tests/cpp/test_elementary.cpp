#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

#include "fisherpoint/numbers/functions.hpp"

using namespace fisherpoint;
using elementary::V;

namespace {

using Whole = V (*)(V);
using Wide = long double (*)(long double);

constexpr double infinity = std::numeric_limits<double>::infinity(), no_number = std::numeric_limits<double>::quiet_NaN();
constexpr double half_pi = 1.5707963267948966;

double of_one(Whole function, double x) { return function(in_all(x))[0]; }

bool same(double a, double b) { return (std::isnan(a) && std::isnan(b)) || std::memcmp(&a, &b, sizeof a) == 0; }

// The error in units of the last place that a double has at the right value. long double has 64 bits: its functions are right
// to 0.001 of such units, where it has more than a double at all.
double units(double found, long double right) {
  const double rounded = static_cast<double>(right);
  if (std::isnan(rounded) || std::isinf(rounded)) return same(found, rounded) ? 0.0 : infinity;
  int exponent;
  std::frexp(rounded, &exponent);
  return static_cast<double>(std::fabs((found - right) / std::ldexp(1.0L, std::max(exponent - 53, -1074))));
}

struct Case {
  const char* name;
  Whole function;
  Wide right;
  double least, most;  // of numbers drawn
  double within;       // units in the last place
};

#if defined(__FMA__) || defined(__aarch64__)
constexpr double of_circle = 0.8;
#else
constexpr double of_circle = 0.9;
#endif

const std::vector<Case> cases = {
    {"exp", elementary::exp, std::exp, -708.0, 709.7, 0.75},    {"log", elementary::log, std::log, 0.0, 4.0, 0.6},
    {"sin", elementary::sin, std::sin, -1e5, 1e5, of_circle},   {"cos", elementary::cos, std::cos, -1e5, 1e5, of_circle},
    {"tan", elementary::tan, std::tan, -1e5, 1e5, 0.99},        {"sinh", elementary::sinh, std::sinh, -710.4, 710.4, 0.8},
    {"cosh", elementary::cosh, std::cosh, -710.4, 710.4, 0.75}, {"tanh", elementary::tanh, std::tanh, -25.0, 25.0, 0.8},
    {"exp", elementary::exp, std::exp, -1.0, 1.0, 0.75},        {"log", elementary::log, std::log, 0.99, 1.01, 0.6},
    {"sin", elementary::sin, std::sin, -4.0, 4.0, of_circle},   {"cos", elementary::cos, std::cos, -4.0, 4.0, of_circle},
    {"tan", elementary::tan, std::tan, -1.6, 1.6, 0.99},        {"sinh", elementary::sinh, std::sinh, -1.0, 1.0, 0.8},
    {"cosh", elementary::cosh, std::cosh, -1.0, 1.0, 0.75},     {"tanh", elementary::tanh, std::tanh, -1.0, 1.0, 0.8},
};

// Of a case: numbers on its interval, of all sizes, and nice ones with their neighbours.
std::vector<double> arguments(const Case& of) {
  std::vector<double> at;
  std::mt19937_64 draw(1);
  std::uniform_real_distribution<double> uniform(of.least, of.most), exponent(-1074.0, 1024.0);
  for (int k = 0; k < 200000; ++k) at.push_back(uniform(draw));
  for (int k = 0; k < 20000; ++k) at.push_back(std::copysign(std::exp2(exponent(draw)), uniform(draw)));
  std::vector<double> nice = {0.0,
                              1.0,
                              0.5,
                              2.0,
                              0x1p-27,
                              0x1p-26,
                              1e-300,
                              4.9e-324,
                              2.2250738585072014e-308,
                              1e5,
                              22.0,
                              1e300,
                              1.7976931348623157e308};
  for (const double x :
       {0.34657359027997264, 0.6931471805599453, 700.0, 709.782712893384, 710.4758600739439, 745.1332191019411, 746.0})
    nice.push_back(x);
  for (int k = 1; k < 200; ++k)
    nice.insert(nice.end(), {0.5 * k * half_pi, k * half_pi, 317.0 * k * half_pi, 0.1 * k, 1.0 + k});
  for (const double x : nice)
    for (const double y : {x, std::nextafter(x, infinity), std::nextafter(x, -infinity)}) at.insert(at.end(), {y, -y});
  at.insert(at.end(), {infinity, -infinity, no_number});
  return at;
}

}  // namespace

TEST_CASE("elementary functions are right to less than one unit in the last place") {
  if constexpr (std::numeric_limits<long double>::digits <= 53) return;  // nothing to compare with
  for (const Case& of : cases) {
    double worst = 0.0, where = 0.0;
    for (const double x : arguments(of)) {
      const long double right = of.right(static_cast<long double>(x));
      // Numbers that are not normal have fewer digits: half a unit of theirs more.
      const double allowed = std::fabs(static_cast<double>(right)) < 0x1p-1021 ? 0.5 : 0.0;
      const double error = units(of_one(of.function, x), right) - allowed;
      if (!(error <= worst)) worst = error, where = x;
    }
    INFO(of.name << " of " << where);
    CHECK(worst < of.within);
    CHECK(worst > 0.4);  // or else nothing was measured
  }
}

TEST_CASE("of zero, infinity and NaN they are what the standard library has") {
  const std::pair<Whole, double (*)(double)> pairs[] = {
      {elementary::exp, std::exp}, {elementary::log, std::log},   {elementary::sin, std::sin},   {elementary::cos, std::cos},
      {elementary::tan, std::tan}, {elementary::sinh, std::sinh}, {elementary::cosh, std::cosh}, {elementary::tanh, std::tanh}};
  for (const auto& [ours, library] : pairs)
    for (const double x : {0.0, -0.0, infinity, -infinity, no_number}) {
      INFO(x);
      CHECK(same(of_one(ours, x), library(x)));
    }
  CHECK(same(of_one(elementary::log, 1.0), 0.0));
  CHECK(std::isnan(of_one(elementary::log, -1.0)));
  CHECK(of_one(elementary::exp, 710.0) == infinity);
  CHECK(of_one(elementary::exp, -746.0) == 0.0);
  CHECK(of_one(elementary::cosh, 710.48) == infinity);
  CHECK(of_one(elementary::sinh, -710.48) == -infinity);
  CHECK(of_one(elementary::sin, 1e22) == std::sin(1e22));
}

TEST_CASE("odd and even functions are so to the last bit, tanh stays within 1, exp rises") {
  std::mt19937_64 draw(2);
  std::uniform_real_distribution<double> exponent(-40.0, 12.0);
  for (int k = 0; k < 20000; ++k) {
    const double x = std::exp2(exponent(draw));
    for (const Whole odd : {elementary::sin, elementary::tan, elementary::sinh, elementary::tanh})
      REQUIRE(same(of_one(odd, -x), -of_one(odd, x)));
    for (const Whole even : {elementary::cos, elementary::cosh}) REQUIRE(same(of_one(even, -x), of_one(even, x)));
    REQUIRE(std::fabs(of_one(elementary::tanh, x)) <= 1.0);
    REQUIRE(std::fabs(of_one(elementary::sin, x)) <= 1.0);
    REQUIRE(std::fabs(of_one(elementary::cos, x)) <= 1.0);
    REQUIRE(of_one(elementary::cosh, x) >= 1.0);
  }
  for (const double from : {0.0, 0.34657359027997264, -0.34657359027997264, 1.0, -1.0}) {
    double before = of_one(elementary::exp, from), x = from;
    for (int k = 0; k < 20000; ++k) {
      x = std::nextafter(x, infinity);
      if (from == 0.0) x = (k + 1) * 0x1p-54;
      const double next = of_one(elementary::exp, x);
      REQUIRE(next >= before);
      before = next;
    }
  }
}

TEST_CASE("a lane is what it is alone, in every pack, and as a plain number") {
  using Narrow = Pack<native_lanes>;
  using Broad = Pack<4 * native_lanes>;
  std::mt19937_64 draw(3);
  std::normal_distribution<double> normal;
  const std::vector<double> nice = {0.0,       -0.0,      1.0,    -1.0,  1e300,  -1e300, infinity,
                                    -infinity, no_number, 1e-310, 800.0, -800.0, 2e5};
  const auto check = [&](auto&& f) {
    Broad x;
    for (int lane = 0; lane < Broad::width; ++lane) x.set(lane, draw() % 4 ? 10.0 * normal(draw) : nice[draw() % nice.size()]);
    const Broad all = f(x);
    for (int lane = 0; lane < Broad::width; ++lane) {
      REQUIRE(same(all[lane], f(x[lane])));
      REQUIRE(same(all[lane], f(Narrow(x[lane]))[native_lanes - 1]));
    }
  };
  for (int round = 0; round < 500; ++round) {
    check([](const auto& x) { return fisherpoint::exp(x); });
    check([](const auto& x) { return fisherpoint::log(x); });
    check([](const auto& x) { return fisherpoint::sin(x); });
    check([](const auto& x) { return fisherpoint::cos(x); });
    check([](const auto& x) { return fisherpoint::tan(x); });
    check([](const auto& x) { return fisherpoint::sinh(x); });
    check([](const auto& x) { return fisherpoint::cosh(x); });
    check([](const auto& x) { return fisherpoint::tanh(x); });
  }
}
