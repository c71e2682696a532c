#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "fisherpoint/prior/prior_grid.hpp"
#include "fisherpoint/prior/prior_nodes.hpp"

using namespace fisherpoint;

namespace {

// All nodes at once, or one by itself.
struct Nodes {
  Nodes(const PriorNodes& nodes, std::size_t first, std::size_t count)
      : count(count), values(nodes.parameters() * count), weight(count) {
    nodes.read(first, count, values.data(), weight.data());
  }
  double theta(int j, std::size_t r = 0) const { return values[j * count + r]; }
  std::size_t count;
  std::vector<double> values, weight;
};

}  // namespace

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

TEST_CASE("a grid read at once is that read node by node") {
  const PriorGrid grid({{{1, 2}, {0.5, 0.25}}, {{3}, {1}}, {{4, 5, 6}, {0.1, 0.2, 0.3}}});
  REQUIRE(grid.size() == 6);
  const Nodes all(grid, 0, 6);
  for (std::size_t r = 0; r < grid.size(); ++r) {
    const Nodes one(grid, r, 1);
    for (int j = 0; j < 3; ++j) CHECK(all.theta(j, r) == one.theta(j));
    CHECK(all.weight[r] == one.weight[0]);
  }
  CHECK(all.theta(0, 4) == 2);
  CHECK(all.theta(2, 4) == 5);
  CHECK(all.weight[4] == doctest::Approx(0.05));
}

TEST_CASE("cells between edges have their middles and probabilities") {
  const Axis axis = cells_between(std::array{-2.0, -1.0, 1.0, 5.0});
  CHECK(axis.values == std::vector<double>{-1.5, 0, 3});
  CHECK(axis.probabilities[1] == doctest::Approx(0.6826894921370859).epsilon(1e-15));
  CHECK(axis.probabilities[0] == doctest::Approx(0.1359051219832778).epsilon(1e-14));
}

TEST_CASE("a mapped grid is the affine map of its coordinates, with exponentials where asked, from any node on") {
  const std::vector<Axis> z{{{-1, 0, 1}, {0.25, 0.5, 0.25}}, {{-2, 2}, {0.5, 0.5}}};
  const std::vector<double> center{10, 0.5}, matrix{3, 0, 0.2, 0.1};
  const PriorGrid grid(z, Coordinates{center, matrix, {false, true}});
  REQUIRE(grid.size() == 6);
  REQUIRE(grid.parameters() == 2);
  const Nodes all(grid, 0, grid.size());
  for (std::size_t r = 0; r < grid.size(); ++r) {
    const double z0 = z[0].values[r / 2], z1 = z[1].values[r % 2];
    CHECK(all.theta(0, r) == doctest::Approx(10 + 3 * z0));
    CHECK(all.theta(1, r) == doctest::Approx(std::exp(0.5 + 0.2 * z0 + 0.1 * z1)));
    CHECK(all.weight[r] == doctest::Approx(z[0].probabilities[r / 2] * 0.5));
    const Nodes one(grid, r, 1);
    CHECK(one.theta(0) == all.theta(0, r));
    CHECK(one.theta(1) == all.theta(1, r));
  }
  const auto pilots = grid.pilots();
  CHECK(pilots.size() == 2 * PriorNodes::most_pilots);
  CHECK(pilots[0] == doctest::Approx(13));  // the first has the first axis alone at its upper end
  CHECK(pilots[1] == doctest::Approx(std::exp(0.5 + 0.2 - 0.2)));
}

TEST_CASE("the pilots of a grid hold every combination of three axes' ends") {
  for (int a = 0; a < 9; ++a)
    for (int b = 0; b < a; ++b)
      for (int c = 0; c < b; ++c) {
        std::array<int, 8> seen{};
        for (std::size_t k = 1; k <= PriorNodes::most_pilots; ++k)
          ++seen[PriorGrid::high(k, a) + 2 * PriorGrid::high(k, b) + 4 * PriorGrid::high(k, c)];
        CHECK(*std::min_element(seen.begin(), seen.end()) > 0);
      }
}

TEST_CASE("a table hands out its rows, from any of them on") {
  const NodeTable table({1, 2, 3, 4, 5, 6}, {0.5, -0.25, 0.75}, {5, 6});
  REQUIRE(table.size() == 3);
  CHECK(table.parameters() == 2);
  CHECK(table.pilots() == std::vector<double>{5, 6});
  const Nodes rows(table, 1, 2);
  CHECK(rows.values == std::vector<double>{3, 5, 4, 6});
  CHECK(rows.weight == std::vector<double>{-0.25, 0.75});
  CHECK_THROWS(NodeTable({}, {}, {}));
  CHECK_THROWS(NodeTable({1}, {1}, std::vector<double>(PriorNodes::most_pilots + 1, 1.0)));
}

TEST_CASE("second moments about a mean, in units of std, by hand") {
  const NodeTable table({1, 2, 3, 8}, {3, -1}, {});
  const double mean[] = {0, 4}, std[] = {1, 2};
  // d = (1, -1) and (3, 2) with weights 3 and -1, which sum to 2.
  const auto moments = second_moments(table, mean, std);
  CHECK(moments == std::vector<double>{(3 - 9) / 2.0, (-3 - 6) / 2.0, (-3 - 6) / 2.0, (3 - 4) / 2.0});
}
