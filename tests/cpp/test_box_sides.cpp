#include <doctest/doctest.h>

#include <cmath>
#include <random>
#include <vector>

#include "fisherpoint/integration/box_sides.hpp"

using namespace fisherpoint;

// R of friction: minus a positive definite matrix, its columns scaled by the sizes of the friction.
static std::vector<double> friction(int n, std::mt19937& random) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> size(0.1, 3.0);
  std::vector<double> root(n * n), r(n * n);
  for (double& entry : root) entry = normal(random);
  for (int j = 0; j < n; ++j) {
    const double scale = size(random);
    for (int i = 0; i < n; ++i) {
      double sum = i == j ? 0.1 : 0.0;
      for (int k = 0; k < n; ++k) sum += root[i * n + k] * root[j * n + k];
      r[i * n + j] = -sum * scale;
    }
  }
  return r;
}

TEST_CASE("of friction the sides are those that the rates lead to, and what holds is in balance") {
  std::mt19937 random(0);
  std::normal_distribution<double> normal;
  int held = 0, moving = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const int n = 1 + trial % 12;
    const auto r = friction(n, random);
    std::vector<double> r0(n);
    for (double& entry : r0) entry = 3.0 * normal(random);
    BoxSides sides(n, r0, r);
    REQUIRE(sides.solve());
    // With the sides known, the multipliers of what holds: by Gauss-Seidel, which the matrix allows.
    std::vector<double> s(n);
    for (int i = 0; i < n; ++i) s[i] = sides[i];
    for (int sweep = 0; sweep < 20000; ++sweep)
      for (int i = 0; i < n; ++i) {
        if (sides[i] != 0.0) continue;
        double rate = r0[i];
        for (int j = 0; j < n; ++j) rate += r[i * n + j] * s[j];
        s[i] -= rate / r[i * n + i];
      }
    for (int i = 0; i < n; ++i) {
      double rate = r0[i];
      for (int j = 0; j < n; ++j) rate += r[i * n + j] * s[j];
      if (sides[i] == 0.0) {
        CHECK(std::abs(s[i]) < 1.0 + 1e-6);
        ++held;
      } else {
        CHECK(sides[i] * rate > -1e-6);
        ++moving;
      }
    }
  }
  CHECK(held > 1000);
  CHECK(moving > 1000);
}

TEST_CASE("what leads away on both sides has no side, but where another jump decides") {
  BoxSides away(1, {0.0}, {1.0});
  CHECK_FALSE(away.solve());
  BoxSides pushed(2, {0.0, 5.0}, {1.0, 3.0, 0.0, 1.0});  // the second goes up, and takes the first along
  REQUIRE(pushed.solve());
  CHECK(pushed[0] == 1.0);
  CHECK(pushed[1] == 1.0);
}

TEST_CASE("a side that is set stays, and others follow it") {
  BoxSides sides(2, {0.5, 0.0}, {-1.0, 0.0, -0.5, -1.0});
  sides.set(0, 1.0);
  REQUIRE(sides.solve());
  CHECK(sides[0] == 1.0);
  CHECK(sides[1] == 0.0);
  CHECK_FALSE(sides.stays(0, 1e-3));
}
