// States of a batch of runs: long trajectories under inputs that are held from sample to sample. The segments of a run follow
// each other; lanes = runs. Each run has its own start and parameters; a run's sets of unknowns share their segments.
//
// Segments under the same input are one piece, at whose samples there is dense output: the steps may be longer than the time
// from one sample to the next. Where a piece ends early, or has implicit steps, its segments are integrated one by one.
//
// A piece begins with the step that the last one would have tried next, by the method that it ended with, and from the sides
// of jumps on which it ended (segment_ends.hpp); the sides of other surfaces are fresh, as f changes with the input. Each lane
// keeps its own, so a run's states do not depend on what shares its pack.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <numeric>
#include <vector>

#include "fisherpoint/equations/state_equation.hpp"
#include "fisherpoint/integration/integrator.hpp"
#include "fisherpoint/kernels/points.hpp"
#include "fisherpoint/kernels/segment_ends.hpp"
#include "fisherpoint/kernels/workers.hpp"

namespace fisherpoint {

struct Runs {
  std::size_t count, segments;
  const double *x0, *u, *dt;  // (count, n_x); (count, segments, n_u) and (count, segments), or of one that all share
  bool shared;
  const std::int32_t* updates = nullptr;  // as dt: which of the model's come at the starts of segments, as bits; or none

  const double* u_of(std::size_t run, std::size_t segment, int n_u) const {
    return u + ((shared ? 0 : run) * segments + segment) * n_u;
  }
  // 0 behind the last segment of a run that has fewer.
  double dt_of(std::size_t run, std::size_t segment) const { return dt[(shared ? 0 : run) * segments + segment]; }
  std::int32_t updates_of(std::size_t run, std::size_t segment) const {
    return updates ? updates[(shared ? 0 : run) * segments + segment] : 0;
  }
};

// So many segments are one piece at most: all of it is done again where its samples have to be ends of steps.
inline constexpr std::size_t longest_piece = 64;

// Segments of a run from `first` on that have its input, until an update, `separate(segment)` or the last one; into `at` when
// they end.
inline void find_piece(const Runs& runs, std::size_t run, std::size_t first, int n_u, auto&& separate,
                       std::vector<double>& at) {
  const double* const u = runs.u_of(run, first, n_u);
  at.assign(1, runs.dt_of(run, first));
  for (std::size_t next = first + 1; next < runs.segments && at.size() < longest_piece; ++next) {
    const double* const other = runs.u_of(run, next, n_u);
    if (!(runs.dt_of(run, next) > 0.0) || !std::equal(u, u + n_u, other) || runs.updates_of(run, next) || separate(next))
      return;
    at.push_back(at.back() + runs.dt_of(run, next));
  }
}

struct RunStates {
  double* x;              // (count, segments + 1, n_x); behind a failure the last state that was reached
  Status* status;         // (count,)
  std::int64_t* reached;  // (count,), segments that were completed
};

// How long a thread stays with one pack, so that Ctrl-C is heard in time however long a run is.
inline constexpr std::chrono::milliseconds stay{20};

// How far the runs of a pack are, lane by lane.
template <class P>
struct RunProgress {
  std::array<std::size_t, lanes_of<P>::width> segment{}, one_by_one{};  // one_by_one: until this segment
  P step{0.0};
  mask_of_lanes<P> stiff = lanes_of<P>::none();
  std::vector<SegmentEnd> ends;  // of every lane, of models with jumps
  bool ended = false;
};

// Carries the runs rows[0], rows[1], ... on, until their end or for as long as a thread stays.
template <class P, class Method, class M>
void advance_runs(const M& model, const Runs& runs, const Parameters& parameters, const Tolerance& tolerance,
                  std::span<const std::size_t> rows, RunProgress<P>& progress, const RunStates& out) {
  using Equation = StateEquation<M, P>;
  constexpr int width = lanes_of<P>::width;
  const auto shape = shape_of(model);
  const int used = static_cast<int>(rows.size());
  const bool dense = DenseOutput::exists(method_of<Method>(tolerance)), goes_on = goes_on_from_ends(shape);
  const auto state = [&](int lane, std::size_t sample) {
    return out.x + (rows[lane] * (runs.segments + 1) + sample) * shape.states;
  };
  const auto lasts = [&](int lane) {
    const std::size_t segment = progress.segment[lane];
    return lane < used && out.status[rows[lane]] == Status::ok && segment < runs.segments &&
           runs.dt_of(rows[lane], segment) > 0.0;
  };

  typename Equation::Theta theta;
  typename Equation::Input u;
  typename Equation::State x;
  fit(theta, shape.parameters);
  fit(u, shape.inputs);
  fit(x, shape.states);
  for (int lane = 0; lane < width; ++lane) {
    const int source = std::min(lane, used - 1);
    set_lane(theta, lane, parameters.of(rows[source], shape.parameters));
    set_lane(x, lane, state(source, progress.segment[source]));
  }
  if (goes_on) progress.ends.resize(used);
  std::array<std::vector<double>, width> at;  // when the segments of a lane's piece end
  Samples<P> samples;
  std::vector<SegmentEnd> before;
  auto came = x;  // what the last pieces left, before updates

  const auto leave = std::chrono::steady_clock::now() + stay;
  while (!progress.ended && std::chrono::steady_clock::now() < leave) {
    P duration(0.0), updates(0.0);
    bool several = false, updated = false;
    for (int lane = 0; lane < width; ++lane) {
      const int source = std::min(lane, used - 1);
      const std::size_t segment = std::min(progress.segment[source], runs.segments - 1);
      set_lane(u, lane, runs.u_of(rows[source], segment, shape.inputs));
      samples.lanes[lane] = {};
      if (!lasts(lane)) continue;
      const bool alone = !dense || lanes_of<P>::get(progress.stiff, lane) || segment < progress.one_by_one[lane];
      find_piece(runs, rows[lane], segment, shape.inputs, [&](std::size_t) { return alone; }, at[lane]);
      lanes_of<P>::set(duration, lane, at[lane].back());
      samples.lanes[lane] = {std::span(at[lane]).first(at[lane].size() - 1), state(lane, segment + 1)};
      several = several || at[lane].size() > 1;
      if (const auto which = runs.updates_of(rows[lane], segment)) lanes_of<P>::set(updates, lane, which), updated = true;
    }
    const Equation equation(model, theta, u, used);
    came = x;
    if constexpr (has_resets<Equation>)
      if (updated) x = equation.update(x, updates);
    Integrator<Equation, Method> integrator(equation, tolerance);
    typename Equation::Side from;
    if (goes_on)
      from = sides_of_ends<M, P>(model, equation, theta, came, x, u, used,
                                 [&](int lane) -> const SegmentEnd& { return progress.ends[lane]; });
    const auto end_of = [&](int lane) { return &progress.ends[lane]; };
    if (shape.resets > 0) hold_conditions<P>(integrator.held(), used, end_of);
    if (several) before = progress.ends;
    const auto outcome = integrator.run(x, duration, progress.step, nullptr, progress.stiff, goes_on ? &from : nullptr,
                                        several ? &samples : nullptr);
    if (shape.resets > 0) note_conditions<P>(integrator.held(), used, end_of);
    progress.ended = true;
    for (int lane = 0; lane < used; ++lane) {
      if (!lasts(lane)) continue;
      std::size_t& segment = progress.segment[lane];
      const std::size_t inside = at[lane].size() - 1;
      if (inside > 0 &&
          (outcome.status[lane] != Status::ok || samples.lanes[lane].missed || samples.lanes[lane].done < inside)) {
        progress.one_by_one[lane] = segment + inside + 1;
        set_lane(x, lane, state(lane, segment));
        if (goes_on) progress.ends[lane] = before[lane];
        progress.ended = false;
        continue;
      }
      segment += inside + 1;
      lanes_of<P>::set(progress.step, lane, lanes_of<P>::get(outcome.next_step, lane));
      lanes_of<P>::set(progress.stiff, lane, lanes_of<P>::get(outcome.stiff, lane));
      get_lane(x, lane, state(lane, segment));
      if (goes_on) progress.ends[lane].note(integrator.sides(), u, shape.jumps_end, lane);
      out.status[rows[lane]] = outcome.status[lane];
      out.reached[rows[lane]] += outcome.status[lane] == Status::ok ? inside + 1 : 0;
      if (lasts(lane)) progress.ended = false;
    }
  }
  for (int lane = 0; progress.ended && lane < used; ++lane)
    for (std::size_t ahead = progress.segment[lane] + 1; ahead <= runs.segments; ++ahead) get_lane(x, lane, state(lane, ahead));
}

template <class P, class Method, class M>
void run_packs(const M& model, const Runs& runs, const Parameters& parameters, const Tolerance& tolerance,
               const Workers& workers, const RunStates& out) {
  const std::size_t n_x = shape_of(model).states;
  std::vector<std::size_t> order(runs.count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  for (const std::size_t k : order) {
    std::copy_n(runs.x0 + k * n_x, n_x, out.x + k * (runs.segments + 1) * n_x);
    out.status[k] = Status::ok;
    out.reached[k] = 0;
  }
  const PacksOf<M, P> packs(order, workers.threads());
  std::vector<RunProgress<P>> progress(packs.size());
  workers.for_each_until_done(packs.size(), [&](std::size_t pack) {
    advance_runs<P, Method>(model, runs, parameters, tolerance, packs[pack], progress[pack], out);
    return progress[pack].ended;
  });
}

// Compiled once per model and instruction set
// (cpp/src/runs.cpp).
template <class M>
void simulate_runs(const M& model, const Runs& runs, const Parameters& parameters, const Tolerance& tolerance,
                   const Workers& workers, const RunStates& out);

}  // namespace fisherpoint
