#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "fisherpoint/kernels/stepwise_columns.hpp"
#include "models.hpp"

using namespace fisherpoint;
using namespace fisherpoint::testing;
using M = Ball<Kind::kink>;
using P = Pack<native_lanes>;

namespace {

PointPath<M> of_two_sides() {
  PointPath<M> path;
  typename ArraysOf<M, double>::Sides side;
  side.fill(1.0);
  for (const double size : {0.1, 0.2, 0.4}) path.push_back(size, side, false);
  side[0] = -1.0;
  for (const double size : {0.3, 0.5}) path.push_back(size, side, false);
  return path;
}

double duration(const PointPath<M>& path) { return std::accumulate(path.sizes.begin(), path.sizes.end(), 0.0); }

}  // namespace

TEST_CASE("a step is divided into as many parts as its error asks for") {
  for (const double excess : {1.01, 3.0, 100.0, 1e6}) {
    const Division inside(excess, 8.0, false), beside(excess, 8.0, true);
    CHECK(inside.edge == 0.0);
    CHECK(inside.parts >= 2);
    CHECK(inside.parts <= 8);
    if (inside.parts < 8) CHECK(excess * std::pow(inside.parts, -8.0) <= 1.0);
    CHECK(beside.edge >= 0.125);
    CHECK(beside.edge <= 0.5);
    CHECK(beside.parts >= 1);
  }
  CHECK(Division(std::numeric_limits<double>::quiet_NaN(), 8.0, false).parts == 2);
  CHECK(Division(std::numeric_limits<double>::infinity(), 8.0, false).parts == 2);
}

TEST_CASE("lanes go along their paths, and divide their own steps alone") {
  std::vector<PointPath<M>> paths{of_two_sides(), of_two_sides()};
  const std::vector<std::size_t> rows{1, 0};
  LaneSteps<M, P> steps(shape_of(M{}), rows, paths);
  CHECK(steps.size[0] == 0.1);
  CHECK_FALSE(lanes_of<P>::get(steps.beside, 0));
  steps.go_on(0, 0.0, 8.0);
  steps.go_on(0, 0.0, 8.0);
  CHECK(steps.size[0] == 0.4);
  CHECK(lanes_of<P>::get(steps.beside, 0));  // ends on the kink
  steps.divide(0, 1000.0, 8.0);
  CHECK(paths[0].size() == 5);
  CHECK(paths[1].size() > 5);
  CHECK(duration(paths[1]) == doctest::Approx(1.5));
  CHECK(paths[1].sizes[paths[1].runs[0].end - 1] == doctest::Approx(0.4 * Division(1000.0, 8.0, true).edge));
  CHECK_FALSE(lanes_of<P>::get(steps.beside, 0));  // which the shorter one does not

  while (paths[1].taken < paths[1].runs[0].end) steps.go_on(0, 0.0, 8.0);
  CHECK(steps.side[0][0] == -1.0);
  CHECK(steps.size[0] == 0.3);
  CHECK(lanes_of<P>::get(steps.beside, 0));
  steps.go_on(0, 1.0, 8.0);  // as large as is allowed, and the next step is longer
  CHECK(steps.size[0] == 0.25);
  CHECK(steps.size[1] == 0.1);
  CHECK(steps.busy() == 2);
  steps.go_on(0, 0.0, 8.0);
  steps.go_on(0, 0.0, 8.0);
  CHECK(steps.done(0));
  CHECK(steps.size[0] == 0.0);
  CHECK(steps.busy() == 1);
}

TEST_CASE("a path goes on where it was left halfway") {
  std::vector<PointPath<M>> paths{of_two_sides()};
  const std::vector<std::size_t> rows{0};
  paths[0].taken = 3;
  LaneSteps<M, P> steps(shape_of(M{}), rows, paths);
  CHECK(steps.size[0] == 0.3);
  CHECK(steps.side[0][0] == -1.0);
  CHECK(lanes_of<P>::get(steps.beside, 0));
}
