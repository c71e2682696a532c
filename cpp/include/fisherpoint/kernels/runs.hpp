// States of a batch of runs: long trajectories under inputs that are held from sample to sample. The segments of a run follow
// each other; lanes = runs. Each run has its own start and parameters; a run's sets of unknowns share their segments.
//
// A segment begins with the step that the last one would have tried next, by the method that it ended with, and from the sides
// of jumps on which it ended (segment_ends.hpp); the sides of other surfaces are fresh, as f changes with the input. Each lane
// keeps its own, so a run's states do not depend on what shares its pack.
#pragma once

#include <algorithm>
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

  const double* u_of(std::size_t run, std::size_t segment, int n_u) const {
    return u + ((shared ? 0 : run) * segments + segment) * n_u;
  }
  // 0 behind the last segment of a run that has fewer.
  double dt_of(std::size_t run, std::size_t segment) const { return dt[(shared ? 0 : run) * segments + segment]; }
};

struct RunStates {
  double* x;              // (count, segments + 1, n_x); behind a failure the last state that was reached
  Status* status;         // (count,)
  std::int64_t* reached;  // (count,), segments that were completed
};

// How long a thread stays with one pack, so that Ctrl-C is heard in time however long a run is.
inline constexpr std::chrono::milliseconds stay{20};

template <class P>
struct RunProgress {
  std::size_t segment = 0;
  P step{0.0};
  mask_of_lanes<P> stiff = lanes_of<P>::none();
  std::vector<SegmentEnd> ends;  // of every lane, of models with jumps
};

// Carries the runs rows[0], rows[1], ... on, until their end or for as long as a thread stays.
template <class P, class Method, class M>
void advance_runs(const M& model, const Runs& runs, const Parameters& parameters, const Tolerance& tolerance,
                  std::span<const std::size_t> rows, RunProgress<P>& progress, const RunStates& out) {
  using Equation = StateEquation<M, P>;
  const auto shape = shape_of(model);
  const int used = static_cast<int>(rows.size());
  const auto state = [&](int lane, std::size_t sample) {
    return out.x + (rows[lane] * (runs.segments + 1) + sample) * shape.states;
  };
  const auto running = [&](int lane) { return lane < used && out.status[rows[lane]] == Status::ok; };

  typename Equation::Theta theta;
  typename Equation::Input u;
  typename Equation::State x;
  fit(theta, shape.parameters);
  fit(u, shape.inputs);
  fit(x, shape.states);
  for (int lane = 0; lane < lanes_of<P>::width; ++lane) {
    const int source = std::min(lane, used - 1);
    set_lane(theta, lane, parameters.of(rows[source], shape.parameters));
    set_lane(x, lane, state(source, progress.segment));
  }

  const auto leave = std::chrono::steady_clock::now() + stay;
  while (progress.segment < runs.segments && std::chrono::steady_clock::now() < leave) {
    const std::size_t segment = progress.segment++;
    const auto lasts = [&](int lane) { return running(lane) && runs.dt_of(rows[lane], segment) > 0.0; };
    P duration(0.0);
    for (int lane = 0; lane < lanes_of<P>::width; ++lane) {
      if (lasts(lane)) lanes_of<P>::set(duration, lane, runs.dt_of(rows[lane], segment));
      set_lane(u, lane, runs.u_of(rows[std::min(lane, used - 1)], segment, shape.inputs));
    }
    const Equation equation(model, theta, u);
    Integrator<Equation, Method> integrator(equation, tolerance);
    typename Equation::Side from;
    if (goes_on_from_ends(shape)) {
      progress.ends.resize(used);
      from = sides_of_ends<M, P>(model, equation, theta, x, u, used,
                                 [&](int lane) -> const SegmentEnd& { return progress.ends[lane]; });
    }
    const auto end_of = [&](int lane) { return &progress.ends[lane]; };
    if (shape.resets > 0) hold_conditions<P>(integrator.held(), used, end_of);
    const auto outcome =
        integrator.run(x, duration, progress.step, nullptr, progress.stiff, goes_on_from_ends(shape) ? &from : nullptr);
    if (shape.resets > 0) note_conditions<P>(integrator.held(), used, end_of);
    progress.step = outcome.next_step;
    progress.stiff = outcome.stiff;
    bool any_running = false;
    for (int lane = 0; lane < used; ++lane) {
      const bool ran = lasts(lane);
      get_lane(x, lane, state(lane, segment + 1));
      if (!ran) continue;
      if (goes_on_from_ends(shape)) progress.ends[lane].note(integrator.sides(), u, shape.jumps_end, lane);
      out.status[rows[lane]] = outcome.status[lane];
      out.reached[rows[lane]] += running(lane);
      any_running = any_running || running(lane);
    }
    if (any_running) continue;
    for (; progress.segment < runs.segments; ++progress.segment)
      for (int lane = 0; lane < used; ++lane) get_lane(x, lane, state(lane, progress.segment + 1));
  }
}

template <class P, class Method, class M>
void run_packs(const M& model, const Runs& runs, const Parameters& parameters, const Tolerance& tolerance,
               const Workers& workers, const RunStates& out) {
  constexpr std::size_t width = lanes_of<P>::width;
  const std::size_t n_x = shape_of(model).states;
  std::vector<std::size_t> order(runs.count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  for (const std::size_t k : order) {
    std::copy_n(runs.x0 + k * n_x, n_x, out.x + k * (runs.segments + 1) * n_x);
    out.status[k] = Status::ok;
    out.reached[k] = 0;
  }
  std::vector<RunProgress<P>> progress((runs.count + width - 1) / width);
  std::vector<std::size_t> todo(progress.size());
  std::iota(todo.begin(), todo.end(), std::size_t{0});
  while (std::erase_if(todo, [&](auto pack) { return progress[pack].segment == runs.segments; }), !todo.empty()) {
    if (workers.interrupted()) throw Interrupted{};
    workers.for_each(todo.size(), [&](std::size_t item) {
      const std::size_t first = todo[item] * width;
      const std::span<const std::size_t> rows(order.data() + first, std::min(width, runs.count - first));
      advance_runs<P, Method>(model, runs, parameters, tolerance, rows, progress[todo[item]], out);
    });
  }
}

// Compiled once per model and instruction set
// (cpp/src/runs.cpp).
template <class M>
void simulate_runs(const M& model, const Runs& runs, const Parameters& parameters, const Tolerance& tolerance,
                   const Workers& workers, const RunStates& out);

}  // namespace fisherpoint
