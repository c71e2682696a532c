#include <doctest/doctest.h>

#include <vector>

#include "fisherpoint/predictive_covariance.hpp"
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
  for (const auto& [levels, varied] : {std::pair{1, 1}, {7, 1}, {3, 2}, {3, 7}}) {
    const PriorGrid grid = grid_of(levels, varied);
    std::array<double, 16> covariance, again;
    Status status;
    std::int64_t redone;
    std::vector<double> y(4 * grid.size());
    predictive_covariance(m, point, cylinder_theta.data(), grid, {}, Workers(1), {covariance.data(), &status, &redone});
    CHECK(status == Status::ok);
    CHECK(redone == 0);
    predictive_covariance(m, point, cylinder_theta.data(), grid, {}, Workers(5), {again.data(), &status, &redone, y.data()});
    CHECK(covariance == again);

    std::array<double, 16> plain{};
    double weights = 0;
    const auto nominal = run<double>(m, x0, u, dt, cylinder_theta).first;
    constexpr std::array output = {0, 2, 3};
    for (std::size_t r = 0; r < grid.size(); ++r) {
      const PriorGrid::Cursor node(grid, r);
      std::array<double, 9> theta;
      std::copy_n(node.theta(), 9, theta.begin());
      const auto x = run<double>(m, x0, u, dt, theta).first;
      for (int i = 0; i < 3; ++i) CHECK(y[4 * r + i] == doctest::Approx(x[output[i]]).epsilon(1e-5));
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
          plain[4 * i + j] += node.probability() * (x[output[i]] - nominal[output[i]]) * (x[output[j]] - nominal[output[j]]);
      weights += node.probability();
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
  const std::vector<double> x0 = {0.1, 0.2, 8e6, 9e6, -0.3, 0.1, 2e-3, 8e6, 1.62e7, -0.3}, u = {-0.5, -0.5}, dt = {4e-3, 1e-3};
  std::array<double, 32> covariance;
  std::array<Status, 2> status;
  std::array<std::int64_t, 2> redone;
  std::vector<Axis> axes;
  for (int j = 0; j < 9; ++j) axes.push_back(cells(cylinder_theta[j], (j == 0 ? 0.9 : 0.01) * cylinder_theta[j], 3, 1.5));
  const PriorGrid grid(std::move(axes));
  for (int threads : {1, 2, 5}) {
    predictive_covariance(m, {2, x0.data(), u.data(), dt.data()}, cylinder_theta.data(), grid, {}, Workers(threads),
                          {covariance.data(), status.data(), redone.data()});
    CHECK(status[0] == Status::ok);
    CHECK(status[1] == Status::met_jump);
    CHECK(covariance[0] > 0);
    for (int i = 16; i < 32; ++i) CHECK(covariance[i] == 0);
  }
}
