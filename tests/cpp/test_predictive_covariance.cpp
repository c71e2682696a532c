#include <doctest/doctest.h>

#include <vector>

#include "fisherpoint/kernels/predictive_covariance.hpp"
#include "fisherpoint/prior/prior_grid.hpp"
#include "models.hpp"

using namespace fisherpoint;
using namespace fisherpoint::testing;

static PriorGrid grid_of(int levels, int varied) {
  std::vector<Axis> axes;
  for (int j = 0; j < 9; ++j) axes.push_back(cells(cylinder_theta[j], 0.1 * cylinder_theta[j], j < varied ? levels : 1, 1.5));
  return PriorGrid(std::move(axes));
}

TEST_CASE("the streamed sum is the plain one, for every remainder and any number of threads") {
  const HydraulicCylinder m;
  const std::array x0 = {0.1, 0.2, 8e6, 9e6, -0.3};
  const std::array u = {-0.5};
  const double dt = 4e-3;
  const Points point{1, x0.data(), u.data(), &dt};
  for (const auto& [levels, varied] : {std::pair{1, 1}, {7, 1}, {2, 3}, {3, 2}, {3, 7}}) {
    const PriorGrid grid = grid_of(levels, varied);
    std::array<double, 16> covariance, again;
    Status status;
    std::int64_t redone;
    std::vector<double> y(4 * grid.size());
    double lost;
    predictive_covariance(m, point, cylinder_theta.data(), grid, 0, {}, Workers(1),
                          {covariance.data(), &status, &redone, &lost});
    CHECK(status == Status::ok);
    CHECK(redone == 0);
    CHECK(lost == 0);
    predictive_covariance(m, point, cylinder_theta.data(), grid, 0, {}, Workers(5),
                          {again.data(), &status, &redone, &lost, y.data()});
    CHECK(covariance == again);

    std::array<double, 16> plain{};
    double weights = 0;
    const auto nominal = run<double>(m, x0, u, dt, cylinder_theta).first;
    constexpr std::array output = {0, 2, 3};
    for (std::size_t r = 0; r < grid.size(); ++r) {
      double weight;
      std::array<double, 9> theta;
      grid.read(r, 1, theta.data(), &weight);
      const auto x = run<double>(m, x0, u, dt, theta).first;
      for (int i = 0; i < 3; ++i) CHECK(y[4 * r + i] == doctest::Approx(x[output[i]]).epsilon(1e-5));
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
          plain[4 * i + j] += weight * (x[output[i]] - nominal[output[i]]) * (x[output[j]] - nominal[output[j]]);
      weights += weight;
    }
    for (int i = 0; i < 3; ++i) {
      CHECK(covariance[5 * i] == doctest::Approx(plain[5 * i] / weights).epsilon(1e-4));
      CHECK(covariance[12 + i] == 0.0);  // the spool, exactly
    }
  }
}

TEST_CASE("one node that fails excludes the point, and a failing point leaves the others alone") {
  const HydraulicCylinder m;
  // The second point starts slowly: fine at the mean, but not with the strongest friction.
  const std::vector<double> x0 = {0.1, 0.2, 8e6, 9e6, -0.3, 0.1, 5e-3, 8e6, 1.62e7, -0.3}, u = {-0.5, -0.5}, dt = {4e-3, 1e-3};
  std::array<double, 32> covariance;
  std::array<Status, 2> status;
  std::array<std::int64_t, 2> redone;
  std::array<double, 2> lost;
  std::vector<Axis> axes;
  for (int j = 0; j < 9; ++j) axes.push_back(cells(cylinder_theta[j], (j == 0 ? 0.9 : 0.01) * cylinder_theta[j], 3, 1.5));
  const PriorGrid grid(std::move(axes));
  for (int threads : {1, 2, 5}) {
    predictive_covariance(m, {2, x0.data(), u.data(), dt.data()}, cylinder_theta.data(), grid, 0, {}, Workers(threads),
                          {covariance.data(), status.data(), redone.data(), lost.data()});
    CHECK(status[0] == Status::ok);
    CHECK(status[1] == Status::met_jump);
    CHECK(covariance[0] > 0);
    for (int i = 16; i < 32; ++i) CHECK(covariance[i] == 0);
    CHECK(lost == std::array{0.0, 1.0});
  }
}

TEST_CASE("a table of a grid's nodes gives the grid's covariance") {
  const HydraulicCylinder m;
  const std::array x0 = {0.1, 0.2, 8e6, 9e6, -0.3};
  const std::array u = {-0.5};
  const double dt = 4e-3;
  const Points point{1, x0.data(), u.data(), &dt};
  const PriorGrid grid = grid_of(3, 5);
  std::vector<double> theta(9 * grid.size()), weight(grid.size());
  for (std::size_t r = 0; r < grid.size(); ++r) grid.read(r, 1, &theta[9 * r], &weight[r]);
  const NodeTable table(theta, weight, grid.pilots());
  std::array<double, 16> of_grid, of_table;
  Status status;
  std::int64_t redone;
  double lost;
  predictive_covariance(m, point, cylinder_theta.data(), grid, 0, {}, Workers(1), {of_grid.data(), &status, &redone, &lost});
  predictive_covariance(m, point, cylinder_theta.data(), table, 0, {}, Workers(1), {of_table.data(), &status, &redone, &lost});
  CHECK(of_grid == of_table);
}

TEST_CASE("nodes that fail are left out up to the stated share of the absolute weight, and exclude the point above it") {
  const HydraulicCylinder m;
  const std::array x0 = {0.1, 5e-3, 8e6, 1.62e7, -0.3};
  const std::array u = {-0.5};
  const double dt = 1e-3;
  const Points point{1, x0.data(), u.data(), &dt};
  // Friction from weak, but in three nodes so strong that the piston stops; the 3000 nodes are three chunks.
  std::vector<double> theta, weight, kept;
  for (int r = 0; r < 3000; ++r) {
    auto node = cylinder_theta;
    const bool stops = r % 1000 == 999;
    node[0] = stops ? 1500 : 400 - 0.05 * r;
    theta.insert(theta.end(), node.begin(), node.end());
    weight.push_back(r % 3 ? 1.0 : -0.5);
    if (!stops) kept.insert(kept.end(), node.begin(), node.end());
  }
  std::vector<double> kept_weight;
  double all = 0, failing = 0;
  for (int r = 0; r < 3000; ++r) {
    all += std::abs(weight[r]);
    if (r % 1000 == 999)
      failing += std::abs(weight[r]);
    else
      kept_weight.push_back(weight[r]);
  }
  const NodeTable table(theta, weight, {}), only_kept(kept, kept_weight, {});
  std::array<double, 16> covariance, again, expected;
  Status status;
  std::int64_t redone;
  double lost;
  const double share = failing / all;
  predictive_covariance(m, point, cylinder_theta.data(), only_kept, 0, {}, Workers(1),
                        {expected.data(), &status, &redone, &lost});
  REQUIRE(status == Status::ok);
  REQUIRE(expected[0] != 0);
  predictive_covariance(m, point, cylinder_theta.data(), table, 1.01 * share, {}, Workers(1),
                        {covariance.data(), &status, &redone, &lost});
  CHECK(status == Status::ok);
  CHECK(lost == doctest::Approx(share).epsilon(1e-12));
  for (int i = 0; i < 16; ++i) CHECK(covariance[i] == doctest::Approx(expected[i]).epsilon(1e-9));
  for (int threads : {2, 3}) {
    predictive_covariance(m, point, cylinder_theta.data(), table, 1.01 * share, {}, Workers(threads),
                          {again.data(), &status, &redone, &lost});
    CHECK(again == covariance);
  }
  predictive_covariance(m, point, cylinder_theta.data(), table, 0.99 * share, {}, Workers(1),
                        {covariance.data(), &status, &redone, &lost});
  CHECK(status == Status::met_jump);
  CHECK(lost == doctest::Approx(share).epsilon(1e-12));
  CHECK(covariance[0] == 0);
}

TEST_CASE("lanes that rest behind the last node add nothing, even where their planned steps overflow") {
  const HydraulicCylinder m;
  const std::array x0 = {0.193, -0.036, 4.54e6, 14.4e6, 0.215};
  const std::array u = {0.936};
  const double dt = 3.89e-3;
  const Points point{1, x0.data(), u.data(), &dt};
  auto far = cylinder_theta;  // from the mean, for which alone the steps are planned
  far[3] = 3.6e9, far[5] = 5.3e-7, far[7] = 1.5e-4, far[8] = 1.2e-4;
  const NodeTable table({far.begin(), far.end()}, {1.0}, {});
  std::array<double, 16> covariance;
  Status status;
  std::int64_t redone;
  double lost;
  predictive_covariance(m, point, cylinder_theta.data(), table, 0, {}, Workers(1),
                        {covariance.data(), &status, &redone, &lost});
  CHECK(redone == 1);
  for (double c : covariance) CHECK(std::isfinite(c));
}
