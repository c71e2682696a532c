// What several threads of a Python without the interpreter lock call at the same time, with one model, one prior and one set of
// points: each gets the bits that it would get alone. `make race` has the thread sanitizer look at it.
#include <doctest/doctest.h>

#include <thread>
#include <vector>

#include "fisherpoint/kernels/predictive_covariance.hpp"
#include "fisherpoint/kernels/sensitivities.hpp"
#include "fisherpoint/kernels/simulate.hpp"
#include "fisherpoint/prior/prior_grid.hpp"
#include "models.hpp"
#include "tape_integrator.hpp"

using namespace fisherpoint;
using namespace fisherpoint::testing;

namespace {

using Values = std::vector<double>;

void check_side_by_side(const auto& work) {
  const Values alone = work(1);
  std::vector<Values> found(4);
  {
    std::vector<std::jthread> callers;
    for (Values& mine : found)
      callers.emplace_back([&] {
        for (int call = 0; call < 3; ++call) mine = work(3);
      });
  }
  for (const Values& one : found) CHECK(one == alone);
}

struct Starts {
  Values x0, u, dt;

  explicit Starts(std::size_t count) {
    for (std::size_t k = 0; k < count; ++k) {
      for (double x : {0.1 + 0.002 * k, k % 3 == 1 ? 1e-4 : 0.2, 8e6 - 2e4 * k, 9e6, k % 2 ? 0.4 : -0.3}) x0.push_back(x);
      u.push_back(-0.5 + 0.01 * k);
      dt.push_back(2e-3 + 3e-5 * k);
    }
  }
  Points points() const { return {dt.size(), x0.data(), u.data(), dt.data()}; }
};

}  // namespace

TEST_CASE("trajectories and sensitivities side by side") {
  const HydraulicCylinder m;
  const Starts starts(60);
  const Parameters parameters{cylinder_theta.data(), false};
  check_side_by_side([&](int threads) {
    Values x(5 * 60), y(4 * 60), lasted(60), dy(36 * 60);
    std::vector<Status> status(60);
    simulate(m, starts.points(), parameters, {}, Workers(threads), {x.data(), y.data(), status.data(), lasted.data()});
    sensitivities(m, starts.points(), parameters, {}, Workers(threads),
                  {x.data(), y.data(), nullptr, dy.data(), status.data()});
    dy.insert(dy.end(), lasted.begin(), lasted.end());
    return dy;
  });
}

TEST_CASE("predictive covariances side by side, over one prior") {
  const HydraulicCylinder m;
  const Starts starts(4);
  std::vector<Axis> axes;
  for (int j = 0; j < 9; ++j) axes.push_back(cells(cylinder_theta[j], 0.1 * cylinder_theta[j], j < 5 ? 3 : 1, 1.5));
  const PriorGrid grid(std::move(axes));
  check_side_by_side([&](int threads) {
    Values covariance(16 * 4), lost(4);
    std::vector<Status> status(4);
    std::vector<std::int64_t> redone(4);
    predictive_covariance(m, starts.points(), cylinder_theta.data(), grid, 0, {}, Workers(threads),
                          {covariance.data(), status.data(), redone.data(), lost.data()});
    return covariance;
  });
}

TEST_CASE("a tape side by side") {
  using O = Operation;
  const Program none{{}, {}, {}, {}, 3}, x{{}, {}, {}, {1}, 3}, jacobian{{}, {}, {}, {1, 0}, 3};
  const TapeModel decay(
      {1, 0, 1, 1, 0, 0, 0, 0}, {1.0},
      {{{}, {}, {{O::mul, 3, 0, 1, 0}}, {3}, 4}, x, none, none, none, jacobian, {{}, {}, {}, {1, 1}, 3}, none}, {}, {{0, 1}},
      {{0, 0}}, {}, {{true}, {true}, {}, {}, {}, {}, {}, {false}});
  const double rate = -0.7;
  Values x0, dt;
  for (int k = 0; k < 200; ++k) x0.push_back(1.0 + 0.01 * k), dt.push_back(0.1 + 0.01 * k);
  check_side_by_side([&](int threads) {
    Values ends(200), y(200), lasted(200);
    std::vector<Status> status(200);
    simulate_packs<Pack<tape_lanes>, Tableau>(decay, Points{200, x0.data(), nullptr, dt.data()}, {&rate, false}, {},
                                              Workers(threads), {ends.data(), y.data(), status.data(), lasted.data()});
    return ends;
  });
}
