// S of large models, step by step: a path begins with the steps of the states, and a step that is too coarse for S is taken
// back, and taken again in parts. A step takes far longer there than to look at its error, and a path that is as fine
// everywhere as its coarsest step has to be would have three times as many. Each lane goes along its own path. Where too many
// have come to the end, the others go on in another pack, so that packs stay full. No result depends on what shares its pack.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <vector>

#include "fisherpoint/integration/tangents.hpp"
#include "fisherpoint/kernels/derivatives_at_jumps.hpp"
#include "fisherpoint/kernels/point_paths.hpp"
#include "fisherpoint/kernels/points.hpp"

namespace fisherpoint {

// From so many entries of S on.
inline constexpr int many_entries = 400;

// Whether paths are followed so: of large models without jumps.
constexpr bool goes_stepwise(const auto& shape, const auto& dependence) {
  return dependence.in_columns >= many_entries && shape.holds_end == 0;
}

// Of the lanes of a pack, so many are on their way, or it ends.
inline constexpr double enough_busy = 0.8;

// How a step that is too coarse is divided: into equal parts, and a short one beside a kink, where f_x may rise like a root.
struct Division {
  static constexpr double most_parts = 8.0, order_beside_kink = 5.0, least_edge = 0.125, most_edge = 0.5;
  static constexpr double smallest = 1e-9;  // part, as a share of the duration

  double edge = 0.0;
  int parts = 1;

  // `excess`: the error over what is allowed; not a number where there is none.
  Division(double excess, double order, bool beside) {
    if (!(excess < 1e100)) excess = std::pow(2.0, order);
    if (beside) edge = std::clamp(std::pow(excess, -1.0 / order_beside_kink), least_edge, most_edge);
    const double wanted = (1.0 - edge) * std::pow(excess, 1.0 / order);
    parts = static_cast<int>(std::clamp(beside ? std::round(wanted) : std::ceil(wanted), beside ? 1.0 : 2.0, most_parts));
  }
};

// Where the lanes of a pack are on their paths.
template <class M, class P>
class LaneSteps {
  static constexpr int width = lanes_of<P>::width;

 public:
  typename ArraysOf<M, P>::Sides side;
  P size{0.0};
  mask_of_lanes<P> beside = lanes_of<P>::none();

  LaneSteps(const auto& shape, std::span<const std::size_t> rows, std::vector<PointPath<M>>& paths)
      : used_(static_cast<int>(rows.size())) {
    fit(side, shape.sides);
    side.fill(P(1.0));
    for (int lane = 0; lane < used_; ++lane) {
      path_[lane] = &paths[rows[lane]];
      while (path_[lane]->runs[run_[lane]].end <= path_[lane]->taken) ++run_[lane];
      see(lane);
    }
  }

  bool done(int lane) const { return path_[lane]->taken == path_[lane]->size(); }
  int busy() const {
    int count = 0;
    for (int lane = 0; lane < used_; ++lane) count += !done(lane);
    return count;
  }

  // The step has been taken, with an error that is so many times what is allowed. The next one on the same sides is divided
  // beforehand where this foretells that it is too coarse.
  void go_on(int lane, double share, double order) {
    PointPath<M>& path = *path_[lane];
    const double size = path.sizes[path.taken++];
    if (path.taken < path.runs[run_[lane]].end) {
      const double foretold = share * std::pow(path.sizes[path.taken] / size, order);
      if (foretold > 1.0) return divide(lane, foretold, order);
    } else if (!done(lane)) {
      ++run_[lane];
    }
    see(lane);
  }
  // The step is to be taken in parts.
  void divide(int lane, double excess, double order) {
    PointPath<M>& path = *path_[lane];
    const std::size_t n = path.taken, r = run_[lane];
    const bool behind = begins_run(path, n, r), before = !behind && ends_at_kink(path, n, r);
    const Division division(excess, order, behind || before);
    const double whole = path.sizes[n], coarse = static_cast<double>(path.size());
    std::vector<double> parts(division.parts, (1.0 - division.edge) * whole / division.parts);
    if (behind) parts.insert(parts.begin(), division.edge * whole);
    if (before) parts.push_back(division.edge * whole);
    path.sizes[n] = parts.front();
    path.sizes.insert(path.sizes.begin() + n + 1, parts.begin() + 1, parts.end());
    for (std::size_t later = r; later < path.runs.size(); ++later) path.runs[later].end += parts.size() - 1;
    path.fineness *= static_cast<double>(path.size()) / coarse;
    see(lane);
  }

 private:
  static bool begins_run(const PointPath<M>& path, std::size_t n, std::size_t r) { return r > 0 && n == path.runs[r - 1].end; }
  static bool ends_at_kink(const PointPath<M>& path, std::size_t n, std::size_t r) {
    return r + 1 < path.runs.size() && n + 1 == path.runs[r].end;
  }

  void see(int lane) {
    const PointPath<M>& path = *path_[lane];
    const std::size_t n = path.taken, r = run_[lane];
    lanes_of<P>::set(size, lane, done(lane) ? 0.0 : path.sizes[n]);
    lanes_of<P>::set(beside, lane, !done(lane) && (begins_run(path, n, r) || ends_at_kink(path, n, r)));
    set_lane(side, lane, path.runs[r].side.data());
  }

  int used_;
  std::array<PointPath<M>*, width> path_{};
  std::array<std::size_t, width> run_{};
};

// S along paths of points[rows[0]], ... until too few lanes are busy; the others are left halfway. finish(tangents, equation,
// done) is to store what has come to its end.
template <class P, class Method, class M>
void follow_stepwise(const M& model, const Points& points, const Parameters& parameters, const Tolerance& tolerance,
                     std::span<const std::size_t> rows, const Carried* carried, std::vector<PointPath<M>>& paths,
                     Status* status, auto&& finish) {
  const auto shape = shape_of(model);
  const std::size_t n_x = shape.states, p = shape.parameters;
  const int used = static_cast<int>(rows.size());
  const PointPack<M, P> pack(shape, points, parameters, rows);
  const VariationalEquation<M, P> equation(model, pack.theta, pack.u, pack.used);
  Tangents<M, P, Method> tangents(equation, pack.x0, tolerance, true);
  for (int lane = 0; lane < used; ++lane) {
    const PointPath<M>& path = paths[rows[lane]];
    if (path.taken > 0) {
      tangents.load_lane(lane, path.halfway);
    } else if (carried) {
      tangents.start(lane, carried->s + rows[lane] * n_x * p);
    }
  }
  const Method& method = method_of<Method>(tolerance);
  const double most = method.allowed_estimate * tolerance.relative;
  LaneSteps<M, P> steps(shape, rows, paths);
  std::array<bool, lanes_of<P>::width> given_up{};
  for (int busy = used; busy > 0 && busy >= enough_busy * used;) {
    tangents.keep();
    tangents.advance(steps.size, steps.side, steps.beside);
    const P error = sqrt(tangents.squared_step_error());
    auto coarse = lanes_of<P>::none();
    for (int lane = 0; lane < used; ++lane) {
      if (steps.done(lane)) continue;
      PointPath<M>& path = paths[rows[lane]];
      // As if the path's own steps had one error each.
      const double allowed = most / std::sqrt(std::max(4.0, path.size() / path.fineness));
      const double excess = lanes_of<P>::get(error, lane) / allowed;
      if (excess <= 1.0) {
        steps.go_on(lane, excess, method.order);
      } else if (path.size() < static_cast<std::size_t>(tolerance.max_attempts) &&
                 path.sizes[path.taken] > Division::smallest * points.dt[rows[lane]]) {
        lanes_of<P>::set(coarse, lane, true);
        steps.divide(lane, excess, method.order);
      } else {
        status[rows[lane]] = excess < 1e100 ? Status::step_limit : Status::not_finite;
        given_up[lane] = true;
        path.taken = path.size();
        lanes_of<P>::set(steps.size, lane, 0.0);
      }
    }
    if (any(coarse)) tangents.take_back(coarse);
    busy = steps.busy();
  }
  for (int lane = 0; lane < used; ++lane) {
    PointPath<M>& path = paths[rows[lane]];
    if (given_up[lane]) path = PointPath<M>();
    if (!given_up[lane] && !steps.done(lane)) tangents.store_lane(lane, path.halfway);
  }
  finish(equation, tangents, [&](int lane) { return !given_up[lane] && steps.done(lane); });
}

}  // namespace fisherpoint
