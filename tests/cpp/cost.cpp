// Fixed work, whose instructions and cache misses `python -m bench cost` counts under valgrind: one kind of it per run, named
// on the command line, for `search` with the file of its points behind it. What `counted` calls is what counts; it prints the
// number of trajectories and the compiler.
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "fisherpoint/kernels/predictive_covariance.hpp"
#include "fisherpoint/kernels/run_sensitivities.hpp"
#include "fisherpoint/kernels/sensitivities.hpp"
#include "fisherpoint/kernels/simulate.hpp"
#include "fisherpoint/models/hydraulic_cylinder.hpp"
#include "fisherpoint/prior/prior_grid.hpp"
#include "models.hpp"

using namespace fisherpoint;
using testing::cylinder_theta;

extern "C" [[gnu::noinline]] void counted(const std::function<void()>& work) {
  work();
  asm volatile("" ::: "memory");  // no jump instead of the call: valgrind looks for the return
}

namespace {

constexpr std::array relative_std = {0.3, 0.2, 0.05, 0.2, 0.2, 0.1, 0.3, 0.1, 0.1};

// As searches have it.
constexpr Tolerance over_jumps{.cross_jumps = true};

struct Batch {
  std::vector<double> x0, u, dt;

  void add(const std::array<double, 7>& row) {
    x0.insert(x0.end(), row.begin(), row.begin() + 5);
    u.push_back(row[5]);
    dt.push_back(row[6]);
  }
  Points points() const { return {dt.size(), x0.data(), u.data(), dt.data()}; }
};

// q, v, p_A, p_B, x_v, u, dt. Half of them pass x_v = 0; all nodes of both rules below survive.
Batch candidates() {
  Batch batch;
  batch.add({0.061, 0.12, 5.3e6, 3.1e6, 0.16, 0.79, 1.2e-3});
  batch.add({0.065, -0.018, 2.8e6, 16e6, 0.35, 0.61, 7.8e-3});
  batch.add({0.25, 0.15, 10e6, 11e6, -0.16, -0.2, 1.4e-3});
  batch.add({0.079, 0.027, 10e6, 8e6, 0.15, -0.53, 8.2e-3});
  batch.add({0.1, -0.091, 3.5e6, 4.9e6, -0.76, 0.68, 5.2e-3});
  batch.add({0.13, 0.094, 9.5e6, 11e6, 0.42, -0.86, 7.1e-3});
  return batch;
}

// Evenly spread over the default region; some meet v = 0 or leave the domain, as in a search.
Batch spread(int count) {
  constexpr std::array low = {0.03, -0.25, 2e6, 2e6, -0.8, -1.0, 1e-3}, high = {0.27, 0.25, 19e6, 19e6, 0.8, 1.0, 1e-2};
  Batch batch;
  for (int k = 1; k <= count; ++k) {
    std::array<double, 7> row;
    for (int i = 0; i < 7; ++i) {
      const double turns = k * std::sqrt(std::array{2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0}[i]);
      row[i] = low[i] + (high[i] - low[i]) * (turns - std::floor(turns));
    }
    batch.add(row);
  }
  return batch;
}

// Those of a file: a head, then q, v, p_A, p_B, x_v, u, dt in each line.
Batch of_file(const char* name) {
  Batch batch;
  std::ifstream file(name);
  std::string line;
  std::getline(file, line);
  while (std::getline(file, line)) {
    std::istringstream values(line);
    std::array<double, 7> row{};
    char comma;
    for (double& value : row) values >> value >> comma;
    batch.add(row);
  }
  return batch;
}

// Three values of every parameter but the last.
PriorGrid tensor() {
  std::vector<Axis> axes;
  for (int j = 0; j < 9; ++j) axes.push_back(cells(cylinder_theta[j], relative_std[j] * cylinder_theta[j], j < 8 ? 3 : 1, 1.5));
  return PriorGrid(std::move(axes));
}

// The mean, six other values of one parameter, or one of two values of each of two: as the sparse rule of level 2.
NodeTable sparse() {
  std::vector<double> theta, weight, pilots;
  const auto add = [&](double w, int i, double z_i, int j, double z_j) {
    auto node = cylinder_theta;
    node[i] *= 1 + z_i * relative_std[i];
    node[j] *= 1 + z_j * relative_std[j];
    theta.insert(theta.end(), node.begin(), node.end());
    weight.push_back(w);
    if (weight.size() % 7 == 0) pilots.insert(pilots.end(), node.begin(), node.end());
  };
  const double far = std::sqrt(3.0);
  add(10.0, 0, 0.0, 1, 0.0);
  for (int i = 0; i < 9; ++i)
    for (double z : {1.356, far, 2.857})
      for (double sign : {1.0, -1.0}) add(z == far ? -1.0 : 0.2, i, sign * z, (i + 1) % 9, 0.0);
  for (int i = 0; i < 9; ++i)
    for (int j = 0; j < i; ++j)
      for (double z_i : {-far, far})
        for (double z_j : {-far, far}) add(0.03, i, z_i, j, z_j);
  return {theta, weight, pilots};
}

std::size_t covariances(const Batch& batch, const PriorNodes& nodes) {
  const std::size_t count = batch.dt.size();
  std::vector<double> covariance(16 * count), lost(count);
  std::vector<Status> status(count);
  std::vector<std::int64_t> redone(count);
  counted([&] {
    predictive_covariance(HydraulicCylinder{}, batch.points(), cylinder_theta.data(), nodes, 1e-3, {}, Workers(1),
                          {covariance.data(), status.data(), redone.data(), lost.data()});
  });
  for (const Status s : status)
    if (s != Status::ok) return 0;
  return count * nodes.size();
}

enum class Result { states, columns, rows };

std::size_t trajectories(const Batch& batch, Result result, const Tolerance& tolerance = {}) {
  const std::size_t count = batch.dt.size();
  std::vector<double> x(5 * count), y(4 * count), lasted(count), dx(45 * count), dy(36 * count);
  std::vector<Status> status(count);
  const Parameters parameters{cylinder_theta.data(), false};
  counted([&] {
    if (result == Result::states)
      simulate(HydraulicCylinder{}, batch.points(), parameters, tolerance, Workers(1),
               {x.data(), y.data(), status.data(), lasted.data()});
    else
      sensitivities(HydraulicCylinder{}, batch.points(), parameters, tolerance, Workers(1),
                    {x.data(), y.data(), result == Result::columns ? dx.data() : nullptr, dy.data(), status.data()});
  });
  return count;
}

// Runs of the cylinder through both sides of the valve, all of whose segments are measured. A trajectory is a segment.
std::size_t runs() {
  constexpr std::size_t count = 15, segments = 24;
  std::vector<double> x0, u, dt(count * segments, 4e-3);
  for (std::size_t k = 0; k < count; ++k) {
    x0.insert(x0.end(), {0.1 + 0.01 * k, 0.02, 8e6, 9e6, 0.1});
    for (std::size_t n = 0; n < segments; ++n) u.push_back(0.3 * std::sin(0.7 * n + k));
  }
  std::vector<double> x(count * (segments + 1) * 5), y(count * segments * 4), dx(count * segments * 45),
      dy(count * segments * 36);
  std::vector<Status> status(count);
  std::vector<std::int64_t> reached(count);
  const std::vector<unsigned char> measured(count * segments, 1);
  counted([&] {
    run_sensitivities(HydraulicCylinder{}, {count, segments, x0.data(), u.data(), dt.data(), false}, {nullptr, measured.data()},
                      {cylinder_theta.data(), false}, over_jumps, Workers(1),
                      {x.data(), y.data(), dx.data(), dy.data(), status.data(), reached.data()});
  });
  std::size_t done = 0;
  for (const std::int64_t n : reached) done += n;
  return done;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string_view kind = argc >= 2 ? argv[1] : "";
  std::size_t done = 0;
  if (kind == "tensor") done = covariances(candidates(), tensor());
  if (kind == "sparse") done = covariances(candidates(), sparse());
  if (kind == "simulate") done = trajectories(spread(400), Result::states);
  if (kind == "columns") done = trajectories(spread(400), Result::columns);
  if (kind == "rows") done = trajectories(spread(400), Result::rows);
  if (kind == "search" && argc == 3) done = trajectories(of_file(argv[2]), Result::rows, over_jumps);
  if (kind == "runs") done = runs();
  if (done == 0) {
    std::fputs("expected tensor, sparse, simulate, columns, rows, search and a file, or runs, and candidates that survive\n",
               stderr);
    return 1;
  }
#if defined(__clang__)
  const char* const compiler = "clang++ " __clang_version__;
#else
  const char* const compiler = "g++ " __VERSION__;
#endif
  std::printf("%zu %s\n", done, compiler);
}
