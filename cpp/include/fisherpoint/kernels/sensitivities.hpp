// States, outputs and their sensitivities (8) for a batch of experiment points.
//
// First the states alone, lanes = points: the adaptive loop finds the kinks and the sizes of the steps, and how each trajectory
// ends. Then the columns of S along these steps, somewhat refined, with points of equally many steps in a pack: so the costly
// part runs without a branch on full packs, and no result depends on what shares its pack. Points of which a column's estimated
// error is above the tolerance are done again in finer steps.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>
#include <vector>

#include "fisherpoint/integration/integrator.hpp"
#include "fisherpoint/integration/tangents.hpp"
#include "fisherpoint/kernels/points.hpp"
#include "fisherpoint/kernels/workers.hpp"

namespace fisherpoint {

struct SensitiveTrajectories {
  double *x, *y;                  // (count, n_x), (count, n_y), where the trajectory ended
  double *dx_dtheta, *dy_dtheta;  // (count, n_x, p), (count, n_y, p); zero where it is not ok
  Status* status;                 // (count,)
};

// The steps that a point takes; none where nothing is to be done any more.
template <class M>
struct PointPath {
  struct Run {  // of steps on the same sides
    std::size_t end;
    typename ArraysOf<M, double>::Sides side;
  };
  std::vector<double> sizes;
  std::vector<Run> runs;

  std::size_t size() const { return sizes.size(); }
  void push_back(double size, const typename ArraysOf<M, double>::Sides& side) {
    if (runs.empty() || runs.back().side != side) runs.push_back({0, side});
    sizes.push_back(size);
    runs.back().end = sizes.size();
  }
};

// For which memory is taken at once.
inline constexpr std::size_t usual_steps = 64;

// The columns need finer steps than the states.
inline constexpr double first_refinement = 1.4;

// The same path in about `factor` times as many steps, whose sizes change along it as they did.
template <class M>
PointPath<M> refined(const PointPath<M>& path, double factor) {
  PointPath<M> finer;
  finer.sizes.reserve(static_cast<std::size_t>(factor * path.size()) + path.runs.size());
  finer.runs.reserve(path.runs.size());
  std::size_t first = 0;
  for (const auto& run : path.runs) {
    const double coarse = static_cast<double>(run.end - first), parts = std::ceil(coarse * factor);
    std::size_t n = first;
    double rest = 1.0;  // of step n, as a share of it
    for (int part = 0; part < parts; ++part) {
      double share = coarse / parts, size = 0.0;
      for (; share > rest && n + 1 < run.end; rest = 1.0) size += rest * path.sizes[n++], share -= rest;
      const double taken = part + 1 < parts ? std::min(share, rest) : rest;
      finer.sizes.push_back(size + taken * path.sizes[n]);
      rest -= taken;
    }
    finer.runs.push_back({finer.sizes.size(), run.side});
    first = run.end;
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
  Steps<Equation> steps;
  steps.reserve(usual_steps);
  PointPath<M> taken;
  taken.sizes.reserve(usual_steps);
  const PointPack<M, P> pack(shape, points, parameters, rows);
  const Equation equation(model, pack.theta, pack.u);
  auto x = pack.x0;
  const auto outcome =
      Integrator<Equation, Method>(equation, tolerance).run(x, pack.dt, tolerance.whole_first ? pack.dt : P(0.0), &steps);
  store_ends<P>(x, equation.output(x), outcome.status, rows, out);
  for (int lane = 0; lane < pack.used; ++lane) {
    const std::size_t k = rows[lane];
    std::fill_n(out.dx_dtheta + k * n_x * p, n_x * p, 0.0);
    std::fill_n(out.dy_dtheta + k * n_y * p, n_y * p, 0.0);
    if (out.status[k] != Status::ok) continue;
    taken.sizes.clear();
    taken.runs.clear();
    for (const auto& step : steps) {
      const double size = lanes_of<P>::get(step.size, lane);
      if (size != 0.0) taken.push_back(size, of_lane(step.side, shape.sides, lane));
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
  typename VariationalEquation<M, P>::Side side;
  fit(side, shape.sides);
  side.fill(P(1.0));
  std::array<std::size_t, lanes_of<P>::width> run{}, run_end{};  // of every lane: which is next, and where the current one ends
  for (std::size_t n = 0; n < longest; ++n) {
    P size(0.0);
    for (int lane = 0; lane < pack.used; ++lane) {
      const auto& path = paths[rows[lane]];
      if (n >= path.size()) continue;
      lanes_of<P>::set(size, lane, path.sizes[n]);
      if (n < run_end[lane]) continue;
      set_lane(side, lane, path.runs[run[lane]].side.data());
      run_end[lane] = path.runs[run[lane]++].end;
    }
    tangents.advance(size, side);
  }

  const P error = tangents.relative_error();
  typename StateEquation<M, P>::Output y;
  fit(y, shape.outputs);
  ShelfVector<P> dx(n_x * p), dy(n_y * p);
  equation.output(tangents.x, tangents.s, y, dy);
  for_each_index(shape.states, [&](auto i) {
    for_each_index(shape.parameters, [&](auto j) {
      dx[i * p + j] = P(0.0);
      if (equation.dependence.depends(i, j))
        dx[i * p + j] = tangents.s[equation.dependence.column_start[j] + detail::below(equation.dependence.rows(j), i)];
    });
  });
  const mask_of_lanes<P> whole = finite<P>(tangents.x) & finite<P>(y) & finite<P>(dx) & finite<P>(dy);
  for (int lane = 0; lane < pack.used; ++lane) {
    const std::size_t k = rows[lane];
    const double excess = lanes_of<P>::get(error, lane) / (Method::allowed_estimate * tolerance.relative);
    if (excess <= 1.0) {
      paths[k] = PointPath<M>();
      if (!lanes_of<P>::get(whole, lane)) {
        out.status[k] = Status::not_finite;
        continue;
      }
      get_lane(tangents.x, lane, out.x + k * n_x);
      get_lane(y, lane, out.y + k * n_y);
      get_lane(dx, lane, out.dx_dtheta + k * n_x * p);
      get_lane(dy, lane, out.dy_dtheta + k * n_y * p);
      continue;
    }
    const bool known = excess < 1e100;
    const double factor = known ? std::clamp(1.1 * std::pow(excess, 1.0 / Method::order), 1.1, 4.0) : 2.0;
    if (factor * paths[k].size() <= tolerance.max_attempts) {
      paths[k] = refined<M>(paths[k], factor);
    } else {
      paths[k] = PointPath<M>();
      out.status[k] = known ? Status::step_limit : Status::not_finite;
    }
  }
}

template <class P, class Method, class M>
void sensitivity_packs(const M& model, const Points& points, const Parameters& parameters, const Tolerance& tolerance,
                       const Workers& workers, const SensitiveTrajectories& out) {
  constexpr std::size_t width = lanes_of<P>::width, batch = 8192;
  std::vector<PointPath<M>> paths(points.count);
  const std::vector<std::size_t> order = by_duration(points);
  for (std::size_t from = 0; from < order.size(); from += batch) {  // so that few paths are kept at a time
    std::vector<std::size_t> todo(order.begin() + from, order.begin() + std::min(from + batch, order.size()));
    in_packs(workers, todo, width,
             [&](auto rows) { find_paths<P, Method>(model, points, parameters, tolerance, rows, paths, out); });
    while (std::erase_if(todo, [&](auto k) { return paths[k].size() == 0; }), !todo.empty()) {
      std::stable_sort(todo.begin(), todo.end(), [&](auto a, auto b) { return paths[a].size() < paths[b].size(); });
      in_packs(workers, todo, width,
               [&](auto rows) { follow_paths<P, Method>(model, points, parameters, tolerance, rows, paths, out); });
    }
  }
}

// Compiled once per model and instruction set (cpp/src/sensitivities.cpp).
template <class M>
void sensitivities(const M& model, const Points& points, const Parameters& parameters, const Tolerance& tolerance,
                   const Workers& workers, const SensitiveTrajectories& out);

}  // namespace fisherpoint
