// Predictive covariances of experiment points over the nodes of a prior, (14)-(16) with the weights divided by their sum: lanes
// = nodes of one point, streamed.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "fisherpoint/equations/state_equation.hpp"
#include "fisherpoint/integration/integrator.hpp"
#include "fisherpoint/integration/plan.hpp"
#include "fisherpoint/integration/replay.hpp"
#include "fisherpoint/kernels/node_packs.hpp"
#include "fisherpoint/kernels/points.hpp"
#include "fisherpoint/kernels/workers.hpp"

namespace fisherpoint {

struct PredictiveCovariances {
  double* covariance;  // (count, n_y, n_y); zero where the status is not ok
  Status* status;      // (count,): the nominal trajectory's, then that of the first node that is not ok where too much is lost
  std::int64_t* redone;  // (count,): nodes for which the plan did not do
  double* lost;          // (count,): share of the absolute weight of nodes that are not ok; 1 where work ended at the first
  double* y = nullptr;   // (count, nodes, n_y) where the outputs are wanted too
};

// Weighted sum of products of the deviations y - y~, upper triangle, and the sum of the weights; N counts the outputs.
template <int n>
constexpr Count<n*(n + 1) / 2> triangle(Count<n>) {
  return {};
}
constexpr int triangle(int n) { return n * (n + 1) / 2; }

template <class T, class N>
struct DeviationSum {
  Numbers<T, decltype(triangle(N{}))> product;
  T weight;

  explicit DeviationSum(N n) : weight(0.0) {
    fit(product, triangle(n));
    product.fill(T(0.0));
  }
  void add(const Numbers<T, N>& deviation, N n, const T& w) {
    int at = 0;
    for (int i = 0; i < n; ++i) {
      const T weighted = w * deviation[i];
      for (int j = i; j < n; ++j) product[at++] += weighted * deviation[j];
    }
    weight += w;
  }
  template <class S>
  void add_lanes(const DeviationSum<S, N>& other) {
    for (int lane = 0; lane < lanes_of<S>::width; ++lane) {
      for (std::size_t i = 0; i < product.size(); ++i) product[i] += lanes_of<S>::get(other.product[i], lane);
      weight += lanes_of<S>::get(other.weight, lane);
    }
  }
};

// What one chunk of the nodes adds to the covariance of one point.
template <class N>
struct Chunk {
  DeviationSum<double, N> sum;
  Status status = Status::ok;  // of the first node that is not ok
  std::int64_t redone = 0;
  double lost = 0.0, absolute_weight = 0.0;  // of the nodes that are not ok, and of all

  explicit Chunk(N outputs) : sum(outputs) {}
  void add(const Chunk& other) {
    sum.add_lanes(other.sum);
    if (status == Status::ok) status = other.status;
    redone += other.redone;
    lost += other.lost;
    absolute_weight += other.absolute_weight;
  }
};

// Where the trajectories of one point over the prior begin, and how they are computed.
template <class M>
struct PointOverPrior {
  const double *x0, *u;
  double dt;
  double first_step = 0.0;      // of the adaptive loop
  std::optional<Plan<M>> plan;  // none: every node is integrated adaptively
  typename ArraysOf<M, double>::Outputs nominal_y;
};

// Integrates the lanes of positive duration adaptively and puts their ends into x; the statuses of the lanes.
template <class Method, class Equation, class P>
[[gnu::noinline]] auto redo(const Equation& equation, const Tolerance& tolerance, const typename Equation::State& start,
                            const P& duration, const P& first_step, typename Equation::State& x) {
  auto end = start;
  const auto outcome = Integrator<Equation, Method>(equation, tolerance).run(end, duration, first_step);
  for_each_index(equation.states, [&](auto i) { x[i] = select(duration > P(0.0), end[i], x[i]); });
  return outcome.status;
}

// The packs whose trajectories are replayed side by side. A tape's packs are wide.
template <class M>
inline constexpr int packs_side_by_side = 1;
template <Model M>
inline constexpr int packs_side_by_side<M> = 2;

// The sum over a part of the nodes of one point. With `strict` it ends at the first node that is not ok; otherwise such nodes
// count with weight zero.
template <class P, class Method, class M>
class SumOverNodes {
  using Equation = StateEquation<M, P>;
  using State = typename Equation::State;
  static constexpr int width = lanes_of<P>::width, side_by_side = packs_side_by_side<M>;
  using N = std::remove_const_t<decltype(Shape<M>::outputs)>;

 public:
  SumOverNodes(const M& model, const PointOverPrior<M>& point, const Tolerance& tolerance, bool strict)
      : model_(model),
        shape_(shape_of(model)),
        point_(point),
        tolerance_(tolerance),
        strict_(strict),
        sum_(shape_.outputs),
        chunk_(shape_.outputs) {
    fit(start_, shape_.states);
    set_lanes(start_, point.x0);
  }

  // Of the nodes from `begin` to `end`; their outputs go to `y`, unless that is null.
  Chunk<N> over(const PriorNodes& nodes, std::size_t begin, std::size_t end, double* y) {
    typename Equation::Input input;
    typename Equation::Theta theta;
    fit(input, shape_.inputs);
    fit(theta, shape_.parameters);
    set_lanes(input, point_.u);
    NodePacks<P> packs(nodes, begin, end);
    for (std::size_t at = begin; at < end;) {
      std::array<std::optional<Equation>, side_by_side> equation;
      std::array<const Equation*, side_by_side> equations;
      std::array<State, side_by_side> x;
      std::array<P, side_by_side> weight;
      std::array<int, side_by_side> used{};
      std::size_t next = at;
      for (int q = 0; q < side_by_side; ++q) {
        if (next < end) next += used[q] = packs.next(theta, weight[q]);  // else the nodes of the pack before once more
        equations[q] = &equation[q].emplace(model_, theta, input);
        x[q] = start_;
      }
      std::array<mask_of_lanes<P>, side_by_side> believed;
      believed.fill(lanes_of<P>::none());
      if (point_.plan) {
        const auto replayed = Replay<M, P, Method, side_by_side>(equations, tolerance_)
                                  .run(x, point_.plan->stretches, Remembered{point_.plan->shared.data()});
        for (int q = 0; q < side_by_side; ++q) believed[q] = point_.plan->believed(replayed[q]);
      }
      for (int q = 0; q < side_by_side && used[q] > 0; ++q) {
        if (!add(*equations[q], x[q], believed[q], weight[q], used[q], y ? y + at * shape_.outputs : nullptr)) return chunk_;
        at += used[q];
      }
    }
    chunk_.sum.add_lanes(sum_);
    for (int lane = 0; lane < width; ++lane) chunk_.absolute_weight += lanes_of<P>::get(absolute_weight_, lane);
    return chunk_;
  }

 private:
  // Adds a pack whose trajectories end at x where they are believed, and are integrated adaptively elsewhere. Returns whether
  // to go on.
  bool add(const Equation& equation, State& x, const mask_of_lanes<P>& believed, P& weight, int used, double* y) {
    P duration(0.0), counts(0.0);              // positive in the lanes of nodes that are not lost
    for (int lane = 0; lane < used; ++lane) {  // the lanes behind the last node rest
      lanes_of<P>::set(counts, lane, 1.0);
      lanes_of<P>::set(duration, lane, point_.dt);
    }
    absolute_weight_ += abs(weight);
    std::array<Status, width> status{};
    if (any(!believed & (duration > P(0.0)))) {
      duration = select(believed, P(0.0), duration);
      for (int lane = 0; lane < width; ++lane) chunk_.redone += lanes_of<P>::get(duration, lane) > 0.0;
      status = redo<Method>(equation, tolerance_, start_, duration, P(point_.first_step), x);
    }
    auto deviation = equation.output(x);
    const mask_of_lanes<P> outside = outside_of_output<P>(equation, x);
    const mask_of_lanes<P> overflowed = (!finite<P>(deviation) | outside) & (counts > P(0.0));
    if (any(overflowed))
      for (int lane = 0; lane < width; ++lane)
        if (status[lane] == Status::ok && lanes_of<P>::get(overflowed, lane))
          status[lane] = lanes_of<P>::get(outside, lane) ? Status::left_domain : Status::not_finite;
    for (int lane = 0; lane < width; ++lane) {
      if (status[lane] == Status::ok) continue;
      if (chunk_.status == Status::ok) chunk_.status = status[lane];
      if (strict_) return false;
      chunk_.lost += std::abs(lanes_of<P>::get(weight, lane));
      lanes_of<P>::set(weight, lane, 0.0);
      lanes_of<P>::set(counts, lane, 0.0);
    }
    const auto n_y = shape_.outputs;
    if (y)
      for (int lane = 0; lane < used; ++lane) get_lane(deviation, lane, y + lane * n_y);
    for_each_index(n_y, [&](auto i) {
      if (equation.dependence.output_depends(i))
        deviation[i] -= P(point_.nominal_y[i]);
      else
        deviation[i] = P(0.0);  // not even by the rounding of other steps
    });
    if (any(!(counts > P(0.0))))  // where a trajectory has no end, there may be no output
      for_each_index(n_y, [&](auto i) { deviation[i] = select(counts > P(0.0), deviation[i], P(0.0)); });
    sum_.add(deviation, n_y, weight);
    return true;
  }

  const M& model_;
  const decltype(shape_of(std::declval<const M&>())) shape_;
  const PointOverPrior<M>& point_;
  const Tolerance& tolerance_;
  const bool strict_;
  State start_;
  DeviationSum<P, N> sum_;
  P absolute_weight_{0.0};
  Chunk<N> chunk_;
};

// The nominal trajectory and, where it is ok, the plan for the others.
template <class P, class Method, class M>
Status prepare(const M& model, const Pilots& pilots, const Tolerance& tolerance, PointOverPrior<M>& point) {
  using Equation = StateEquation<M, P>;
  typename Equation::State x;
  typename Equation::Input u;
  typename Equation::Theta theta;
  const auto shape = shape_of(model);
  fit(x, shape.states);
  fit(u, shape.inputs);
  fit(theta, shape.parameters);
  set_lanes(x, point.x0);
  set_lanes(u, point.u);
  set_lanes(theta, pilots[0]);
  P duration(0.0);
  lanes_of<P>::set(duration, 0, point.dt);
  const Equation equation(model, theta, u);
  Steps<Equation> steps;
  const auto outcome = Integrator<Equation, Method>(equation, tolerance).run(x, duration, P(0.0), &steps);
  if (outcome.status[0] != Status::ok) return outcome.status[0];
  point.first_step = lanes_of<P>::get(outcome.first_step, 0);
  point.nominal_y = of_lane(equation.output(x), shape.outputs);
  if (lanes_of<P>::get(outside_of_output<P>(equation, x), 0)) return Status::left_domain;
  // Equal steps for all nodes have no places at which states are set anew.
  if (shape.resets == 0) point.plan = Planner<M, P, Method>(model, point.x0, point.u, pilots).plan(steps, tolerance);
  if (point.plan) point.nominal_y = point.plan->nominal_y;
  return finite<double>(point.nominal_y) ? Status::ok : Status::not_finite;
}

// Nodes that are not ok exclude their point where their share of the absolute weight exceeds `max_lost`; with 0 any one does.
template <class P, class Method, class M>
void predictive_covariance_packs(const M& model, const Points& points, const double* nominal_theta, const PriorNodes& nodes,
                                 double max_lost, const Tolerance& tolerance, const Workers& workers,
                                 const PredictiveCovariances& out) {
  const auto shape = shape_of(model);
  const int n_y = shape.outputs;
  const Pilots pilots(nominal_theta, nodes);
  std::vector<PointOverPrior<M>> point(points.count);
  workers.for_each(points.count, [&](std::size_t k) {
    point[k].x0 = points.x0 + k * shape.states;
    point[k].u = points.u + k * shape.inputs;
    point[k].dt = points.dt[k];
    out.status[k] = prepare<P, Method>(model, pilots, tolerance, point[k]);
  });

  // Chunks depend on the nodes alone and are summed in their order, so that the result does not depend on the threads; they are
  // worked off in batches, so that memory does not grow with the number of nodes.
  constexpr std::size_t chunk_nodes = 1024, batch = 4096;
  const bool strict = max_lost == 0;
  const std::size_t chunks = (nodes.size() + chunk_nodes - 1) / chunk_nodes, items = points.count * chunks;
  const Chunk none(shape.outputs);
  std::vector<std::remove_const_t<decltype(none)>> total(points.count, none);
  std::vector<std::atomic<std::size_t>> failed(points.count);  // first chunk that ended early: later ones need not be done
  for (auto& chunk : failed) chunk = chunks;
  std::vector<std::remove_const_t<decltype(none)>> part(std::min(batch, items), none);
  for (std::size_t from = 0; from < items; from += batch) {
    const std::size_t count = std::min(batch, items - from);
    workers.for_each(count, [&](std::size_t item) {
      const std::size_t k = (from + item) / chunks, c = (from + item) % chunks;
      if (out.status[k] != Status::ok || c > failed[k].load(std::memory_order_relaxed)) return;
      part[item] = SumOverNodes<P, Method, M>(model, point[k], tolerance, strict)
                       .over(nodes, c * chunk_nodes, std::min(nodes.size(), (c + 1) * chunk_nodes),
                             out.y ? out.y + k * nodes.size() * n_y : nullptr);
      if (!strict || part[item].status == Status::ok) return;
      std::size_t known = failed[k].load();
      while (c < known && !failed[k].compare_exchange_weak(known, c)) {
      }
    });
    for (std::size_t item = 0; item < count; ++item) {
      const std::size_t k = (from + item) / chunks, c = (from + item) % chunks;
      if (out.status[k] == Status::ok && c <= failed[k]) total[k].add(part[item]);
    }
  }
  for (std::size_t k = 0; k < points.count; ++k) {
    const auto& all = total[k];
    double* covariance = out.covariance + k * n_y * n_y;
    std::fill_n(covariance, n_y * n_y, 0.0);
    out.redone[k] = all.redone;
    out.lost[k] = 1.0;
    if (out.status[k] == Status::ok && strict) out.status[k] = all.status;
    if (out.status[k] != Status::ok) continue;
    out.lost[k] = all.lost > 0 ? all.lost / all.absolute_weight : 0.0;
    if (out.lost[k] > max_lost) out.status[k] = all.status;
    // Weights that underflow, or of both signs, may leave nothing to divide by.
    if (!(all.sum.weight > 0)) out.status[k] = all.status != Status::ok ? all.status : Status::not_finite;
    if (out.status[k] != Status::ok) continue;
    int at = 0;
    for (int i = 0; i < n_y; ++i)
      for (int j = i; j < n_y; ++j) covariance[i * n_y + j] = covariance[j * n_y + i] = all.sum.product[at++] / all.sum.weight;
    if (finite<double>(std::span(covariance, n_y * n_y))) continue;  // products overflow where no output does
    out.status[k] = Status::not_finite;
    std::fill_n(covariance, n_y * n_y, 0.0);
  }
}

// Compiled once per model and instruction set (cpp/src/predictive_covariance.cpp).
template <class M>
void predictive_covariance(const M& model, const Points& points, const double* nominal_theta, const PriorNodes& nodes,
                           double max_lost, const Tolerance& tolerance, const Workers& workers,
                           const PredictiveCovariances& out);

}  // namespace fisherpoint
