// States, outputs and their sensitivities (8) for a batch of experiment points.
//
// First the states alone, lanes = points: the adaptive loop finds the kinks and the sizes of the steps, and how each trajectory
// ends. Then S along these steps, somewhat refined, with points of equally many steps in a pack: so the costly part runs
// without a branch on full packs, and no result depends on what shares its pack. Points whose estimated error is above the
// tolerance are done again in finer steps; those of large models step by step (stepwise_columns.hpp). S is made column by
// column (tangents.hpp), or where dy/dtheta alone is asked for and outputs are few beside parameters, row by row
// (adjoints.hpp). Implicit steps have columns alone (implicit_tangents.hpp).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>
#include <span>
#include <vector>

#include "fisherpoint/integration/adjoints.hpp"
#include "fisherpoint/integration/implicit_tangents.hpp"
#include "fisherpoint/integration/integrator.hpp"
#include "fisherpoint/integration/steep_tangents.hpp"
#include "fisherpoint/integration/tangents.hpp"
#include "fisherpoint/kernels/column_ends.hpp"
#include "fisherpoint/kernels/derivatives_at_jumps.hpp"
#include "fisherpoint/kernels/point_paths.hpp"
#include "fisherpoint/kernels/points.hpp"
#include "fisherpoint/kernels/segment_ends.hpp"
#include "fisherpoint/kernels/stepwise_columns.hpp"
#include "fisherpoint/kernels/workers.hpp"

namespace fisherpoint {

// Every row costs about 1.4 columns, and there is one more for their error. Of a tape that is known at run time only.
constexpr bool rows_pay(int rows, int parameters) { return rows + 1 < 0.7 * parameters; }
template <class M>
inline constexpr bool rows_may_pay = true;
template <Model M>
inline constexpr bool rows_may_pay<M> = rows_pay(Dependence<M>::varying_outputs, sizes<M>::parameters);

// Whether dy/dtheta alone takes less time than with dx/dtheta.
template <class M>
bool takes_rows(const M& model) {
  return rows_pay(dependence_of(model).varying_outputs, shape_of(model).parameters);
}

// Into the paths of points[rows[0]], points[rows[1]], ...: as many as the pack has lanes.
template <class P, class Method, class M>
void find_paths(const M& model, const Points& points, const Parameters& parameters, const Tolerance& tolerance,
                std::span<const std::size_t> rows, const Carried* carried, std::vector<PointPath<M>>& paths,
                const SensitiveTrajectories& out) {
  using Equation = StateEquation<M, P>;
  const auto shape = shape_of(model);
  const std::size_t n_x = shape.states, n_y = shape.outputs, p = shape.parameters;
  Steps<Equation> steps;
  steps.reserve(usual_steps);
  PointPath<M> taken;
  taken.sizes.reserve(usual_steps);
  const PointPack<M, P> pack(shape, points, parameters, rows);
  const Equation equation(model, pack.theta, pack.u, pack.used);
  auto x = pack.x0;
  P first = tolerance.whole_first ? pack.dt : P(0.0);
  mask_of_lanes<P> stiff = lanes_of<P>::none();
  for (int lane = 0; carried && lane < pack.used; ++lane) {
    lanes_of<P>::set(first, lane, carried->step[rows[lane]]);
    lanes_of<P>::set(stiff, lane, carried->stiff[rows[lane]] != 0);
  }
  Integrator<Equation, Method> integrator(equation, tolerance);
  typename Equation::Side from;
  const bool goes_on = goes_on_from_ends(shape) && carried;
  if (goes_on) {
    from = sides_of_ends<M, P>(model, equation, pack.theta, pack.states_of(rows, carried->came), pack.x0, pack.u, pack.used,
                               [&](int lane) -> const SegmentEnd& { return *carried->ends[rows[lane]]; });
  } else if (shape.jumps_end > 0) {
    fit(from, shape.sides);
    from.fill(P(unknown_side));
  }
  Retyped<typename Equation::Side, mask_of_lanes<P>> starts_on;
  fit(starts_on, shape.sides);
  starts_on.fill(lanes_of<P>::none());
  auto starts_at_limit = lanes_of<P>::none();
  if (equation.dependence.any_steep() || equation.dependence.any_closed()) {
    const auto value = equation.surface_values(x);
    const auto is_on = [&](auto m) { return abs(value[m]) <= on_surface * natural_height(equation, m, x); };
    for_each_index(Count<0>{}, shape.kinks_end, [&](auto m) {
      if (equation.dependence.steep(m)) starts_on[m] = is_on(m);
    });
    for_each_index(shape.sides, shape.surfaces, [&](auto m) {
      if (equation.dependence.closed(m)) starts_at_limit = starts_at_limit | is_on(m);
    });
  }
  if (goes_on) hold_conditions<P>(integrator.held(), pack.used, [&](int lane) { return carried->ends[rows[lane]]; });
  const bool by_rows = !carried && !out.dx_dtheta && takes_rows(model);
  Samples<P> samples;  // so that steps are as fine as these need
  bool sampled = false;
  for (int lane = 0; carried && carried->samples && lane < pack.used; ++lane) {
    samples.lanes[lane] = carried->samples->of_states(rows[lane], n_x);
    sampled = sampled || !samples.lanes[lane].at.empty();
  }
  const auto outcome =
      integrator.run(x, pack.dt, first, &steps, stiff, goes_on ? &from : nullptr, sampled ? &samples : nullptr);
  if (goes_on) note_conditions<P>(integrator.held(), pack.used, [&](int lane) { return carried->ends[rows[lane]]; });
  store_ends<P>(x, equation.output(x), outcome.status, rows, out, outside_of_output<P>(equation, x),
                carried ? carried->measured : nullptr);
  for (int lane = 0; carried && lane < pack.used; ++lane) {
    carried->step[rows[lane]] = lanes_of<P>::get(outcome.next_step, lane);
    carried->stiff[rows[lane]] = lanes_of<P>::get(outcome.stiff, lane);
  }
  for (int lane = 0; lane < pack.used; ++lane) {
    const std::size_t k = rows[lane];
    if (out.dx_dtheta) std::fill_n(out.dx_dtheta + k * n_x * p, n_x * p, 0.0);
    std::fill_n(out.dy_dtheta + k * n_y * p, n_y * p, 0.0);
    if (out.status[k] != Status::ok) continue;
    taken.sizes.clear();
    taken.runs.clear();
    taken.resets.clear();
    auto reset = integrator.resets().begin();
    auto hold = integrator.holds().begin();
    std::size_t n = 0;
    double behind = 0.0;  // an instant behind the last step that this lane took
    for (const auto& step : steps) {
      double instant = 0.0;
      for (; hold != integrator.holds().end() && hold->step <= n; ++hold)
        instant = std::max(instant, lanes_of<P>::get(hold->instant, lane));
      for (; reset != integrator.resets().end() && reset->step <= n; ++reset)
        if (const double which = lanes_of<P>::get(reset->which, lane); which > 0.0)
          taken.resets.push_back({which, static_cast<int>(lanes_of<P>::get(reset->surface, lane))});
      ++n;
      const double size = lanes_of<P>::get(step.size, lane);
      behind = size == 0.0 ? std::max(behind, instant) : 0.0;
      if (size == 0.0) continue;
      for_each_part(lanes_of<P>::get(step.growth, lane), [&](double share) {
        taken.push_back(share * size, of_lane(step.side, shape.sides, lane), lanes_of<P>::get(step.implicit, lane), Steep::no,
                        taken.resets.size());
      });
      if (instant > 0.0) taken.runs.back().instant = instant;
    }
    // All that is left behind a jump, which it has come to in the last instant.
    bool met = false;
    for (int m = 0; m < shape.jumps_end && !taken.runs.empty(); ++m)
      met = met || lanes_of<P>::get(steps.back().side[m], lane) != taken.runs.back().side[m];
    if (met) {
      taken.push_back(least_tail * lanes_of<P>::get(pack.dt, lane), of_lane(steps.back().side, shape.sides, lane),
                      lanes_of<P>::get(steps.back().implicit, lane), Steep::no, taken.resets.size());
      if (behind > 0.0) taken.runs.back().instant = behind;
    }
    taken.starts_at_limit = lanes_of<P>::get(starts_at_limit, lane);
    taken.starts_on.clear();
    for_each_index(Count<0>{}, shape.kinks_end, [&](auto m) {
      if (lanes_of<P>::get(starts_on[m], lane) && taken.runs[0].side[m] != 0.0) taken.starts_on.push_back(m);
    });
    const bool steep = equation.dependence.any_steep() || taken.starts_steep();
    if (shape.holds_end > shape.jumps_end) taken = held_at_once(shape, taken);
    const bool inside = carried && carried->samples && carried->samples->inside(k) > 0;
    const bool moved = carried && carried->moved.each > 0;
    if (goes_stepwise(shape, equation.dependence) && !by_rows && !steep && !inside && !moved && !is_stiff(taken)) {
      paths[k] = taken;
      paths[k].stepwise = true;
      continue;
    }
    paths[k] = refined<M>(steep ? with_steep_steps(shape, equation.dependence, taken) : taken,
                          inside ? refinement_of_sampled : first_refinement);
    paths[k].fineness = 1.0;
    if (shape.holds_end > shape.jumps_end) {  // onto a surface that holds it, from either side
      paths[k].start = paths[k].runs[0].side;
      for (int m = shape.jumps_end; m < shape.holds_end; ++m)
        if (paths[k].start[m] == 0.0) paths[k].start[m] = 1.0;
    }
  }
  if (shape.jumps_end > 0)
    look_at_jumps<P, Method>(model, equation, pack, x, from, outcome, tolerance, rows, carried, paths, out.status);
}

// Whether an estimated error is small enough, and the path done with; if not, the path is refined, or given up with a status.
template <class Method, class M>
bool accepted(const Method& method, double error, double allowed, const Tolerance& tolerance, PointPath<M>& path,
              Status& status) {
  const double order = is_stiff(path) ? Radau::error_order : method.order;
  const double excess = error / (allowed * tolerance.relative);
  if (excess <= 1.0) {
    path = PointPath<M>();
    return true;
  }
  const bool known = excess < 1e100;
  const double factor = known ? std::clamp(1.1 * std::pow(excess, 1.0 / order), 1.1, 4.0) : 2.0;
  if (factor * path.size() <= tolerance.max_attempts &&
      (!meets_steep(path) || is_stiff(path) || factor * path.fineness <= finest)) {
    path = graded<M>(refined<M>(path, factor));
  } else {
    path = PointPath<M>();
    status = known ? Status::step_limit : Status::not_finite;
  }
  return false;
}

// S along the paths of points[rows[0]], ..., column by column; a path that turns out too coarse is refined instead.
template <class P, class Method, class M>
void follow_columns(const M& model, const Points& points, const Parameters& parameters, const Tolerance& tolerance,
                    std::span<const std::size_t> rows, const Carried* carried, std::vector<PointPath<M>>& paths,
                    const SensitiveTrajectories& out) {
  const auto shape = shape_of(model);
  const std::size_t n_x = shape.states, n_y = shape.outputs, p = shape.parameters;
  const PointPack<M, P> pack(shape, points, parameters, rows);
  const VariationalEquation<M, P> equation(model, pack.theta, pack.u, pack.used);
  auto x0 = pack.x0;
  if (std::any_of(rows.begin(), rows.end(), [&](auto k) { return paths[k].starts_at_limit; }))
    take_onto_limits(StateEquation<M, P>(model, pack.theta, pack.u, pack.used), !lanes_of<P>::none(), x0);
  Tangents<M, P, Method> tangents(equation, x0, tolerance);
  for (int lane = 0; carried && lane < pack.used; ++lane) tangents.start(lane, carried->s + rows[lane] * n_x * p);
  const MovedStarts moved = carried ? carried->moved : MovedStarts{};
  bool starts_moved = moved.any_of(rows);
  const auto moved_by = [&](int lane) { return std::span(moved.column + rows[lane] * moved.each, moved.each); };
  for (int lane = 0; starts_moved && lane < pack.used; ++lane)
    for (std::size_t e = 0; e < moved.each; ++e)
      if (const int j = moved_by(lane)[e]; j >= 0) tangents.add_rate(lane, j, moved.rate + (rows[lane] * moved.each + e) * n_x);
  std::optional<StateEquation<M, P>> states;  // of stiff paths
  std::optional<ImplicitTangents<M, P, Method>> implicit_tangents;
  if (std::any_of(rows.begin(), rows.end(), [&](auto k) { return is_stiff(paths[k]); })) {
    states.emplace(model, pack.theta, pack.u, pack.used);
    implicit_tangents.emplace(*states, equation, tangents, tolerance);
  }
  std::optional<SteepTangents<M, P, Method>> steep_tangents;
  if (std::any_of(rows.begin(), rows.end(), [&](auto k) { return meets_steep(paths[k]); }) ||
      (shape.holds_end > shape.jumps_end && implicit_tangents))
    steep_tangents.emplace(equation, tangents, implicit_tangents ? &*implicit_tangents : nullptr, tolerance.relative);
  std::optional<SamplesOnTheWay<M, P, Method>> samples;
  if (carried && carried->samples &&
      std::any_of(rows.begin(), rows.end(), [&](auto k) { return carried->samples->inside(k) > 0; }))
    samples.emplace(model, equation, pack, rows, *carried->samples);
  mask_of_lanes<P> grazes = lanes_of<P>::none();
  for_each_step<P, M>(
      shape, rows, paths,
      [&](const auto& before, const auto& after, const auto& resets) {
        grazes = grazes | tangents.pass(before, after, resets);
      },
      [&](P size, const auto& side, const auto& kind) {
        const P whole = size;
        const bool dense = samples && samples->in(size);
        if (starts_moved) tangents.take_off_rates(side, moved_by, pack.used), starts_moved = false;
        if (steep_tangents && any(kind.towards | kind.away)) {
          steep_tangents->leave(select(kind.away, size, P(0.0)), side, kind.other, kind.part, kind.implicit);
          steep_tangents->approach(select(kind.towards, size, P(0.0)), side, kind.other, kind.part, kind.implicit);
          size = select(kind.towards | kind.away, P(0.0), size);
        }
        if (steep_tangents) {
          steep_tangents->advance(steep_tangents->made_up(size), side, kind.implicit, kind.beside, dense);
        } else if (!implicit_tangents) {
          tangents.advance(size, side, kind.beside, dense);
        } else {
          tangents.advance(select(kind.implicit, P(0.0), size), side, kind.beside, dense);
          implicit_tangents->advance(select(kind.implicit, size, P(0.0)), side);
        }
        if (samples) samples->take(tangents, whole);
      });
  if (samples) samples->end();

  const Method& method = method_of<Method>(tolerance);
  const P error = tangents.relative_error();
  ColumnEnds<M, P> ends(equation, tangents, rows, carried);
  auto beside = lanes_of<P>::none();
  if (shape.jumps_end > 0 && std::any_of(rows.begin(), rows.end(), [&](auto k) { return paths[k].ends_on_jump; }))
    beside = ends_beside<P, Method, M>(equation, tangents, ends.dy, rows, paths, carried,
                                       carried || !(out.dx_dtheta || out.states_judge));
  for (int lane = 0; lane < pack.used; ++lane) {
    const std::size_t k = rows[lane];
    const bool without = lanes_of<P>::get(beside, lane);  // a derivative of the outputs
    if (without && !carried) {
      paths[k] = PointPath<M>();
      out.status[k] = Status::on_jump;
      continue;
    }
    const Status at_jumps = lanes_of<P>::get(grazes, lane)                        ? Status::grazes_jump
                            : lanes_of<P>::get(tangents.hangs_on_order(), lane)   ? Status::two_jumps
                            : lanes_of<P>::get(tangents.hangs_on_balance(), lane) ? Status::on_jump
                                                                                  : Status::ok;
    if (at_jumps != Status::ok) {
      paths[k] = PointPath<M>();
      out.status[k] = at_jumps;
      continue;
    }
    if (carried && shape.jumps_end > 0) {
      SegmentEnd& end = *carried->ends[k];
      end.doubtful = paths[k].ends_on_jump;
      end.side.assign(paths[k].runs.back().side.begin(), paths[k].runs.back().side.begin() + int{shape.jumps_end});
    }
    if (!accepted(method, lanes_of<P>::get(error, lane), method.allowed_estimate, tolerance, paths[k], out.status[k])) continue;
    // A sample of a run that has none adds no information; behind it the run goes on.
    ends.store(lane, k, !without || !carried->measured[k], out);
  }
}

// The same for paths that are followed step by step; some are left halfway.
template <class P, class Method, class M>
void follow_columns_stepwise(const M& model, const Points& points, const Parameters& parameters, const Tolerance& tolerance,
                             std::span<const std::size_t> rows, const Carried* carried, std::vector<PointPath<M>>& paths,
                             const SensitiveTrajectories& out) {
  const auto finish = [&](const VariationalEquation<M, P>& equation, const Tangents<M, P, Method>& tangents, auto&& done) {
    const P error = tangents.relative_error();
    const ColumnEnds<M, P> ends(equation, tangents, rows, carried);
    const Method& method = method_of<Method>(tolerance);
    for (int lane = 0; lane < static_cast<int>(rows.size()); ++lane) {
      const std::size_t k = rows[lane];
      if (done(lane) &&
          accepted(method, lanes_of<P>::get(error, lane), method.allowed_estimate, tolerance, paths[k], out.status[k]))
        ends.store(lane, k, true, out);
    }
  };
  follow_stepwise<P, Method>(model, points, parameters, tolerance, rows, carried, paths, out.status, finish);
}

// How much a row counts beside others in the estimate of their errors: none like another, so that rows of opposite outputs do
// not cancel.
inline double share_of_row(std::size_t row) {
  const double turns = 0.6180339887498949 * static_cast<double>(row + 1);
  return 0.5 + turns - std::floor(turns);
}

// The same for dy/dtheta alone, row by row; of paths of explicit steps that keep clear of jumps.
template <class P, class Method, class M>
void follow_rows(const M& model, const Points& points, const Parameters& parameters, const Tolerance& tolerance,
                 std::span<const std::size_t> rows, std::vector<PointPath<M>>& paths, const SensitiveTrajectories& out) {
  const auto shape = shape_of(model);
  const std::size_t n_x = shape.states, n_y = shape.outputs, p = shape.parameters;
  const PointPack<M, P> pack(shape, points, parameters, rows);
  const VariationalEquation<M, P> equation(model, pack.theta, pack.u, pack.used);
  Adjoints<M, P, Method> adjoints(equation, pack.x0, tolerance);
  for_each_step<P, M>(
      shape, rows, paths, [](const auto&...) {},
      [&](const P& size, const auto& side, const auto& kind) { adjoints.advance(size, side, kind.beside); });

  // lambda at the end is the output's row of g_x, against whose size in the states' scales errors are measured.
  typename Adjoints<M, P, Method>::Rows back;
  ShelfVector<std::size_t> output_of, row_of(n_y, n_y);
  for_each_index(shape.outputs, [&](auto i) {
    if (!equation.dependence.output_depends(i)) return;
    row_of[i] = output_of.size();
    output_of.push_back(i);
    back.push_back(adjoints.row());
  });
  typename StateEquation<M, P>::Output y;
  fit(y, shape.outputs);
  ShelfVector<P> dy(n_y * p, P(0.0)), size(back.size(), P(0.0));
  equation.output_slopes(
      adjoints.x, y,
      [&](auto i, auto k, const P& slope) {
        if (row_of[i] == n_y) return;
        back[row_of[i]].lambda[k] = slope;
        size[row_of[i]] += abs(slope) * (1.0 / equation.inverse_scale(k));
      },
      [&](auto i, auto j, const P& slope) { dy[i * p + j] = slope; });
  for (std::size_t r = 0; r < back.size(); ++r) back[r].inverse_scale = share_of_row(r) / (size[r] + 1e-200);
  adjoints.back(back);
  for (std::size_t r = 0; r < back.size(); ++r)
    for (std::size_t j = 0; j < p; ++j) dy[output_of[r] * p + j] += back[r].gradient[j];

  const Method& method = method_of<Method>(tolerance);
  const P error = adjoints.relative_error();
  const mask_of_lanes<P> whole = finite<P>(adjoints.x) & finite<P>(y) & finite<P>(dy);
  for (int lane = 0; lane < pack.used; ++lane) {
    const std::size_t k = rows[lane];
    if (!accepted(method, lanes_of<P>::get(error, lane), method.allowed_of_rows, tolerance, paths[k], out.status[k])) continue;
    if (!lanes_of<P>::get(whole, lane)) {
      out.status[k] = Status::not_finite;
      continue;
    }
    get_lane(adjoints.x, lane, out.x + k * n_x);
    get_lane(y, lane, out.y + k * n_y);
    get_lane(dy, lane, out.dy_dtheta + k * n_y * p);
  }
}

template <class P, class Method, class M>
void sensitivity_packs(const M& model, const Points& points, const Parameters& parameters, const Tolerance& tolerance,
                       const Workers& workers, const SensitiveTrajectories& out, const Carried* carried = nullptr) {
  constexpr std::size_t batch = 8192;
  const Shelves shelves;  // for all rounds of the calling thread
  std::vector<PointPath<M>> paths(points.count);
  const std::vector<std::size_t> order = by_duration(points);
  const bool by_rows = !out.dx_dtheta && takes_rows(model);
  for (std::size_t from = 0; from < order.size(); from += batch) {  // so that few paths are kept at a time
    std::vector<std::size_t> todo(order.begin() + from, order.begin() + std::min(from + batch, order.size()));
    in_packs<M, P>(workers, todo,
                   [&](auto rows) { find_paths<P, Method>(model, points, parameters, tolerance, rows, carried, paths, out); });
    while (std::erase_if(todo, [&](auto k) { return paths[k].size() == 0; }), !todo.empty()) {
      std::stable_sort(todo.begin(), todo.end(), [&](auto a, auto b) { return paths[a].size() < paths[b].size(); });
      std::vector<std::size_t> in_columns, stepwise;
      for (const std::size_t k : todo)
        if (paths[k].stepwise) stepwise.push_back(k);
      std::erase_if(todo, [&](auto k) { return paths[k].stepwise; });
      in_packs<M, P>(workers, stepwise, [&](auto rows) {
        follow_columns_stepwise<P, Method>(model, points, parameters, tolerance, rows, carried, paths, out);
      });
      if constexpr (rows_may_pay<M>) {
        if (by_rows) {
          std::vector<std::size_t> in_rows;
          for (const std::size_t k : todo)
            (is_stiff(paths[k]) || meets_jump(shape_of(model), paths[k]) || meets_steep(paths[k]) ? in_columns : in_rows)
                .push_back(k);
          in_packs<M, P>(workers, in_rows,
                         [&](auto rows) { follow_rows<P, Method>(model, points, parameters, tolerance, rows, paths, out); });
        }
      }
      const auto& by_columns = by_rows ? in_columns : todo;
      in_packs<M, P>(workers, by_columns, [&](auto rows) {
        follow_columns<P, Method>(model, points, parameters, tolerance, rows, carried, paths, out);
      });
      todo.insert(todo.end(), stepwise.begin(), stepwise.end());
    }
  }
}

// Compiled once per model and instruction set (cpp/src/sensitivities.cpp).
template <class M>
void sensitivities(const M& model, const Points& points, const Parameters& parameters, const Tolerance& tolerance,
                   const Workers& workers, const SensitiveTrajectories& out);

}  // namespace fisherpoint
