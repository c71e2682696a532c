// Replays the trajectories of experiment points over a prior grid on one kind of vector, and prints the trajectories per second
// of processor time and the sum of the variances, which must not depend on the vectors.
//
// Reads the cylinder's constants, the parameters' means and standard deviations, and the points, until the input ends.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <iostream>
#include <vector>

#include "backing.hpp"
#include "fisherpoint/integration/replay.hpp"
#include "fisherpoint/kernels/predictive_covariance.hpp"
#include "fisherpoint/models/hydraulic_cylinder.hpp"
#include "fisherpoint/prior/prior_grid.hpp"

using namespace fisherpoint;
using M = HydraulicCylinder;
using Equation = StateEquation<M, Number>;
constexpr int width = Number::width, p = sizes<M>::parameters, n_y = sizes<M>::outputs;

struct Point {
  std::array<double, 5> x0;
  double u, dt;
};

// Equal steps of at most 2 ms, which is what plans for the default tolerance take, on either side of x_v = 0.
std::vector<Stretch<M>> stretches(const M& model, const Point& point) {
  const double target = model.k_u * point.u, start = point.x0[4];
  const double end = target + (start - target) * std::exp(-point.dt / model.T_1);
  const double motion = point.x0[1] < 0 ? -1 : 1, spool = start < 0 ? -1 : 1;
  const auto stretch = [&](double duration, double side) {
    return Stretch<M>{duration, static_cast<int>(std::ceil(duration / 2e-3)), {motion, side}};
  };
  if (start * end > 0) return {stretch(point.dt, spool)};
  const double zero = model.T_1 * std::log((start - target) / -target);
  return {stretch(zero, spool), stretch(point.dt - zero, -spool)};
}

double sum_of_variances(const M& model, const std::array<double, p>& mean, const Point& point, const PriorGrid& grid) {
  Equation::State start;
  for (int i = 0; i < 5; ++i) start[i] = Number(point.x0[i]);
  const Equation::Input input{Number(point.u)};
  const auto plan = stretches(model, point);
  const StateEquation<M, double> nominal(model, mean, {point.u});
  auto end = point.x0;
  std::vector<double> spool;  // the same at all nodes, so that they only remember it
  replay<DormandPrince853>(nominal, {}, end, plan, Recorded{spool});
  DeviationSum<Number, Count<n_y>> sum({});
  std::vector<double> nodes(p * grid.size()), weight(grid.size());
  grid.read(0, grid.size(), nodes.data(), weight.data());
  for (std::size_t first = 0; first < grid.size(); first += width) {
    double lanes[p][width], weights[width];
    for (int lane = 0; lane < width; ++lane) {
      const std::size_t node = std::min(first + lane, grid.size() - 1);
      for (int j = 0; j < p; ++j) lanes[j][lane] = nodes[j * grid.size() + node];
      weights[lane] = first + lane < grid.size() ? weight[node] : 0.0;
    }
    Equation::Theta theta;
    for (int j = 0; j < p; ++j) theta[j] = Number::load(lanes[j]);
    const Equation equation(model, theta, input);
    auto x = start;
    const auto clear = replay<DormandPrince853>(equation, {}, x, plan, Remembered{spool.data()}).clear();
    auto y = to_array<Number>(model.output(x, input, theta));
    for (int i = 0; i < n_y; ++i) y[i] -= start[i < 1 ? i : i + 1];  // the outputs are q, p_A, p_B, x_v
    sum.add(y, {}, select(clear, Number::load(weights), Number(0.0)));
  }
  double total = 0.0;
  for (const int diagonal : {0, 4, 7}) {
    double parts[width];
    sum.product[diagonal].store(parts);
    for (const double part : parts) total += diagonal == 0 ? 1e14 * part : part;
  }
  return total;
}

int main() {
  M model;
  std::array<double, p> mean, std;
  std::cin >> model.A_A >> model.A_B >> model.q_min >> model.q_max >> model.p_s >> model.T_1 >> model.k_u;
  for (double& value : mean) std::cin >> value;
  for (double& value : std) std::cin >> value;
  std::vector<Point> points;
  for (Point at; std::cin >> at.x0[0] >> at.x0[1] >> at.x0[2] >> at.x0[3] >> at.x0[4] >> at.u >> at.dt;) points.push_back(at);
  std::vector<Axis> axes;
  for (int j = 0; j < p; ++j) axes.push_back(cells(mean[j], std[j], j < 7 ? 3 : 1, 1.5));
  const PriorGrid grid(axes);

  double best = 1e300, spent = 0.0, total = 0.0;
  while (spent < 0.4) {
    const std::clock_t begin = std::clock();
    total = 0.0;
    for (const Point& point : points) total += sum_of_variances(model, mean, point, grid);
    const double seconds = double(std::clock() - begin) / CLOCKS_PER_SEC;
    best = std::min(best, seconds);
    spent += seconds;
  }
  std::printf("%.6g %.15g\n", static_cast<double>(points.size() * grid.size()) / best, total);
}
