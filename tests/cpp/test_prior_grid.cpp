#include <doctest/doctest.h>

#include <cmath>

#include "fisherpoint/prior_grid.hpp"

using namespace fisherpoint;

TEST_CASE("cells far from the mean keep their digits") {
  // Mills' ratio: Q(a) ~ phi(a)/a (1 - 1/a^2 + 3/a^4 - 15/a^6 + 105/a^8).
  const auto tail = [](double a) {
    const double s = 1 / (a * a);
    return std::exp(-a * a / 2) / std::sqrt(2 * std::numbers::pi) / a * (1 - s * (1 - 3 * s * (1 - 5 * s * (1 - 7 * s))));
  };
  CHECK(normal_probability(20, 21) == doctest::Approx(tail(20) - tail(21)).epsilon(1e-8));
  CHECK(normal_probability(-21, -20) == normal_probability(20, 21));
  CHECK(normal_probability(-1, 1) == doctest::Approx(0.6826894921370859).epsilon(1e-15));
  CHECK(normal_probability(-1e9, 1e9) == 1.0);
}

TEST_CASE("the axis of the paper") {
  const Axis axis = cells(10.0, 2.0, 5, 2.0);
  CHECK(axis.values == std::vector<double>{6, 8, 10, 12, 14});
  CHECK(axis.probabilities[2] == doctest::Approx(0.38292492254802624).epsilon(1e-14));
  CHECK(axis.probabilities[0] == doctest::Approx(0.06059753594308194).epsilon(1e-14));
  CHECK(cells(3.0, 1.0, 1, 1.5).values == std::vector<double>{3.0});
}

TEST_CASE("a cursor from any node walks the same grid") {
  const PriorGrid grid({{{1, 2}, {0.5, 0.25}}, {{3}, {1}}, {{4, 5, 6}, {0.1, 0.2, 0.3}}});
  REQUIRE(grid.size() == 6);
  PriorGrid::Cursor walking(grid, 0);
  for (std::size_t r = 0; r < grid.size(); ++r) {
    const PriorGrid::Cursor direct(grid, r);
    for (int j = 0; j < 3; ++j) CHECK(walking.theta()[j] == direct.theta()[j]);
    CHECK(walking.probability() == direct.probability());
    if (r == 4) {
      CHECK(direct.theta()[0] == 2);
      CHECK(direct.theta()[2] == 5);
      CHECK(direct.probability() == doctest::Approx(0.05));
    }
    if (r + 1 < grid.size()) walking.advance();
  }
}
