// States of a batch of records: long trajectories under inputs that are held from sample to sample. The pieces of a record
// follow each other; lanes = records. All records share samples and inputs; each has its own start and parameters.
//
// A piece begins with the step that the last one would have tried next, by the method that it ended with, and with fresh sides
// of all surfaces, as f changes with the input. Each lane keeps its own, so a record's states do not depend on what shares its
// pack.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <numeric>
#include <vector>

#include "fisherpoint/equations/state_equation.hpp"
#include "fisherpoint/integration/integrator.hpp"
#include "fisherpoint/kernels/points.hpp"
#include "fisherpoint/kernels/workers.hpp"

namespace fisherpoint {

struct RecordStates {
  double* x;              // (count, pieces + 1, n_x); behind a failure the last state that was reached
  Status* status;         // (count,)
  std::int64_t* reached;  // (count,), pieces that were completed
};

// How long a thread stays with one pack, so that Ctrl-C is heard in time however long a record is.
inline constexpr std::chrono::milliseconds stay{20};

template <class P>
struct RecordProgress {
  std::size_t piece = 0;
  P step{0.0};
  mask_of_lanes<P> stiff = lanes_of<P>::none();
};

// Carries the records rows[0], rows[1], ... on, until their end or for as long as a thread stays.
template <class P, class Method, class M>
void advance_records(const M& model, const Points& records, std::size_t pieces, const Parameters& parameters,
                     const Tolerance& tolerance, std::span<const std::size_t> rows, RecordProgress<P>& progress,
                     const RecordStates& out) {
  using Equation = StateEquation<M, P>;
  const auto shape = shape_of(model);
  const int used = static_cast<int>(rows.size());
  const auto state = [&](int lane, std::size_t sample) { return out.x + (rows[lane] * (pieces + 1) + sample) * shape.states; };
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
    set_lane(x, lane, state(source, progress.piece));
  }

  const auto leave = std::chrono::steady_clock::now() + stay;
  while (progress.piece < pieces && std::chrono::steady_clock::now() < leave) {
    const std::size_t piece = progress.piece++;
    P duration(0.0);
    for (int lane = 0; lane < used; ++lane)
      if (running(lane)) lanes_of<P>::set(duration, lane, records.dt[piece]);
    set_lanes(u, records.u + piece * shape.inputs);
    const Equation equation(model, theta, u);
    const auto outcome =
        Integrator<Equation, Method>(equation, tolerance).run(x, duration, progress.step, nullptr, progress.stiff);
    progress.step = outcome.next_step;
    progress.stiff = outcome.stiff;
    bool any_running = false;
    for (int lane = 0; lane < used; ++lane) {
      const bool ran = running(lane);
      get_lane(x, lane, state(lane, piece + 1));
      if (!ran) continue;
      out.status[rows[lane]] = outcome.status[lane];
      out.reached[rows[lane]] += running(lane);
      any_running = any_running || running(lane);
    }
    if (any_running) continue;
    for (; progress.piece < pieces; ++progress.piece)
      for (int lane = 0; lane < used; ++lane) get_lane(x, lane, state(lane, progress.piece + 1));
  }
}

template <class P, class Method, class M>
void record_packs(const M& model, const Points& records, std::size_t pieces, const Parameters& parameters,
                  const Tolerance& tolerance, const Workers& workers, const RecordStates& out) {
  constexpr std::size_t width = lanes_of<P>::width;
  const std::size_t n_x = shape_of(model).states;
  std::vector<std::size_t> order(records.count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  for (const std::size_t k : order) {
    std::copy_n(records.x0 + k * n_x, n_x, out.x + k * (pieces + 1) * n_x);
    out.status[k] = Status::ok;
    out.reached[k] = 0;
  }
  std::vector<RecordProgress<P>> progress((records.count + width - 1) / width);
  std::vector<std::size_t> todo(progress.size());
  std::iota(todo.begin(), todo.end(), std::size_t{0});
  while (std::erase_if(todo, [&](auto pack) { return progress[pack].piece == pieces; }), !todo.empty()) {
    if (workers.interrupted()) throw Interrupted{};
    workers.for_each(todo.size(), [&](std::size_t item) {
      const std::size_t first = todo[item] * width;
      const std::span<const std::size_t> rows(order.data() + first, std::min(width, records.count - first));
      advance_records<P, Method>(model, records, pieces, parameters, tolerance, rows, progress[todo[item]], out);
    });
  }
}

// `records` has count starts x0, and one u and one dt for each of the pieces. Compiled once per model and instruction set
// (cpp/src/records.cpp).
template <class M>
void simulate_records(const M& model, const Points& records, std::size_t pieces, const Parameters& parameters,
                      const Tolerance& tolerance, const Workers& workers, const RecordStates& out);

}  // namespace fisherpoint
