// States, outputs and their sensitivities (8) for a batch of experiment points.
//
// First the states alone, lanes = points: the adaptive loop finds the kinks and the sizes of the steps, and how each trajectory
// ends. Then the columns of S along these steps, somewhat refined, with points of equally many steps in a pack: so the costly
// part runs without a branch on full packs, and no result depends on what shares its pack. Points of which a column's estimated
// error is above the tolerance are done again in finer steps.
#pragma once

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>
#include <vector>

#include "integrate.hpp"
#include "points.hpp"
#include "tangents.hpp"
#include "workers.hpp"

namespace fisherpoint {

struct SensitiveTrajectories {
  double *x, *y;                  // (count, n_x), (count, n_y), where the trajectory ended
  double *dx_dtheta, *dy_dtheta;  // (count, n_x, p), (count, n_y, p); zero where it is not ok
  Status* status;                 // (count,)
};

template <class M>
struct PointStep {
  double size;
  typename ArraysOf<M, double>::Sides side;
};

// The steps that a point takes; none where nothing is to be done any more.
template <class M>
using PointPath = std::vector<PointStep<M>>;

// The columns need finer steps than the states.
inline constexpr double first_refinement = 1.4;

// The same path in about `factor` times as many steps, whose sizes change along it as they did.
template <class M>
PointPath<M> refined(const PointPath<M>& steps, double factor) {
  PointPath<M> finer;
  finer.reserve(static_cast<std::size_t>(factor * steps.size()) + 4);
  for (std::size_t first = 0; first < steps.size();) {
    std::size_t last = first;  // of the steps on the same sides
    while (last + 1 < steps.size() && steps[last + 1].side == steps[first].side) ++last;
    const double coarse = static_cast<double>(last + 1 - first), parts = std::ceil(coarse * factor);
    std::size_t n = first;
    double rest = 1.0;  // of step n, as a share of it
    for (int part = 0; part < parts; ++part) {
      double share = coarse / parts, size = 0.0;
      for (; share > rest && n < last; rest = 1.0) size += rest * steps[n++].size, share -= rest;
      const double taken = part + 1 < parts ? std::min(share, rest) : rest;
      finer.push_back({size + taken * steps[n].size, steps[n].side});
      rest -= taken;
    }
    first = last + 1;
  }
  return finer;
}

// Into the paths of points[rows[0]], points[rows[1]], ...: as many as the pack has lanes.
template <class P, class Method, class M>
void find_paths(const M& model, const Points& points, const Parameters& parameters, const Tolerance& tolerance,
                std::span<const std::size_t> rows, std::vector<PointPath<M>>& paths, const SensitiveTrajectories& out) {
  using Equation = StateEquation<M, P>;
  const auto shape = shape_of(model);
  const std::size_t n_x = shape.states, n_y = shape.outputs, p = shape.parameters;
  static thread_local std::vector<Step<Equation>> steps;  // kept, so that a pack allocates nothing
  static thread_local PointPath<M> taken;
  const PointPack<M, P> pack(shape, points, parameters, rows);
  const Equation equation(model, pack.theta, pack.u);
  auto x = pack.x0;
  steps.clear();
  const auto outcome =
      Integrator<Equation, Method>(equation, tolerance).run(x, pack.dt, tolerance.whole_first ? pack.dt : P(0.0), &steps);
  const auto y = equation.output(x);
  for (int lane = 0; lane < pack.used; ++lane) {
    const std::size_t k = rows[lane];
    out.status[k] = outcome.status[lane];
    get_lane(x, lane, out.x + k * n_x);
    get_lane(y, lane, out.y + k * n_y);
    std::fill_n(out.dx_dtheta + k * n_x * p, n_x * p, 0.0);
    std::fill_n(out.dy_dtheta + k * n_y * p, n_y * p, 0.0);
    if (out.status[k] != Status::ok) continue;
    taken.clear();
    for (const auto& step : steps) {
      const double size = lanes_of<P>::get(step.size, lane);
      if (size == 0.0) continue;
      taken.push_back({size, of_lane(step.side, shape.sides, lane)});
    }
    paths[k] = refined<M>(taken, first_refinement);
  }
}

// S along the paths of points[rows[0]], ...; a path that turns out too coarse is refined instead.
template <class P, class Method, class M>
void follow_paths(const M& model, const Points& points, const Parameters& parameters, const Tolerance& tolerance,
                  std::span<const std::size_t> rows, std::vector<PointPath<M>>& paths, const SensitiveTrajectories& out) {
  const auto shape = shape_of(model);
  const std::size_t n_x = shape.states, n_y = shape.outputs, p = shape.parameters;
  const PointPack<M, P> pack(shape, points, parameters, rows);
  const VariationalEquation<M, P> equation(model, pack.theta, pack.u);
  Tangents<M, P, Method> tangents(equation, pack.x0);
  std::size_t longest = 0;
  for (const std::size_t k : rows) longest = std::max(longest, paths[k].size());
  for (std::size_t n = 0; n < longest; ++n) {
    P size(0.0);
    typename VariationalEquation<M, P>::Side side;
    fit(side, shape.sides);
    side.fill(P(1.0));
    for (int lane = 0; lane < pack.used; ++lane) {
      const auto& path = paths[rows[lane]];
      if (n >= path.size()) continue;
      lanes_of<P>::set(size, lane, path[n].size);
      set_lane(side, lane, path[n].side.data());
    }
    tangents.advance(size, side);
  }

  const P error = tangents.relative_error();
  typename StateEquation<M, P>::Output y;
  fit(y, shape.outputs);
  static thread_local std::vector<P> dx, dy;
  dx.resize(n_x * p);
  dy.resize(n_y * p);
  equation.output(tangents.x, tangents.s, y, dy);
  for_each_index(shape.states, [&](auto i) {
    for_each_index(shape.parameters, [&](auto j) {
      dx[i * p + j] = P(0.0);
      if (equation.dependence.depends(i, j))
        dx[i * p + j] = tangents.s[equation.dependence.column_start[j] + detail::below(equation.dependence.rows(j), i)];
    });
  });
  for (int lane = 0; lane < pack.used; ++lane) {
    const std::size_t k = rows[lane];
    const double excess = lanes_of<P>::get(error, lane) / (Method::allowed_estimate * tolerance.relative);
    if (excess <= 1.0) {
      get_lane(tangents.x, lane, out.x + k * n_x);
      get_lane(y, lane, out.y + k * n_y);
      get_lane(dx, lane, out.dx_dtheta + k * n_x * p);
      get_lane(dy, lane, out.dy_dtheta + k * n_y * p);
      paths[k].clear();
      continue;
    }
    const bool finite = excess < 1e100;
    const double factor = finite ? std::clamp(1.1 * std::pow(excess, 1.0 / Method::order), 1.1, 4.0) : 2.0;
    if (factor * paths[k].size() <= tolerance.max_attempts) {
      paths[k] = refined<M>(paths[k], factor);
    } else {
      paths[k].clear();
      out.status[k] = finite ? Status::step_limit : Status::not_finite;
    }
  }
}

template <class P, class Method, class M>
void sensitivity_packs(const M& model, const Points& points, const Parameters& parameters, const Tolerance& tolerance,
                       const Workers& workers, const SensitiveTrajectories& out) {
  constexpr std::size_t width = lanes_of<P>::width;
  std::vector<PointPath<M>> paths(points.count);
  std::vector<std::size_t> todo = by_duration(points);
  in_packs(workers, todo, width,
           [&](auto rows) { find_paths<P, Method>(model, points, parameters, tolerance, rows, paths, out); });
  while (std::erase_if(todo, [&](auto k) { return paths[k].empty(); }), !todo.empty()) {
    std::stable_sort(todo.begin(), todo.end(), [&](auto a, auto b) { return paths[a].size() < paths[b].size(); });
    in_packs(workers, todo, width,
             [&](auto rows) { follow_paths<P, Method>(model, points, parameters, tolerance, rows, paths, out); });
  }
}

// Compiled once per model and instruction set (cpp/src/sensitivities.cpp).
template <class M>
void sensitivities(const M& model, const Points& points, const Parameters& parameters, const Tolerance& tolerance,
                   const Workers& workers, const SensitiveTrajectories& out);

}  // namespace fisherpoint
