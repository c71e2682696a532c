// Samples inside pieces of runs: segments under the same input are one piece (runs.hpp), and where they end x, y and their
// derivatives are known by dense output. Where that cannot be, or a jump may be met in that instant, the segments are followed
// one by one instead: `missed`.
#pragma once

#include <optional>
#include <vector>

#include "fisherpoint/equations/state_equation.hpp"
#include "fisherpoint/integration/outcome.hpp"
#include "fisherpoint/integration/tangents.hpp"
#include "fisherpoint/kernels/point_paths.hpp"
#include "fisherpoint/kernels/points.hpp"

namespace fisherpoint {

// Of pieces as points.
struct PieceSamples {
  const std::vector<double>* at;       // (count,), when a piece's segments end
  const std::size_t *state, *segment;  // (count,), number of the piece's start among the states below, and of its first segment
  const unsigned char* measured;       // of every segment, whether a derivative must exist
  double *x, *y;                       // of every state and segment
  double *dx_dtheta, *dy_dtheta;       // dx_dtheta may be none
  unsigned char* missed;               // (count,)

  std::size_t inside(std::size_t piece) const { return at[piece].size() - 1; }
  SamplesOfLane of_states(std::size_t piece, std::size_t n_x) const {
    return {std::span(at[piece]).first(inside(piece)), x + (state[piece] + 1) * n_x};
  }
};

// Whether a piece has its samples in explicit steps between surfaces, each further off the jumps that it meets than `room`.
template <class M>
bool samples_lie_between(const auto& shape, const PointPath<M>& path, const std::vector<double>& at, double room) {
  if (is_stiff(path) || meets_steep(path)) return false;
  double time = 0.0;
  std::size_t n = 0;
  for (std::size_t r = 1; r < path.runs.size(); ++r) {
    for (; n < path.runs[r - 1].end; ++n) time += path.sizes[n];
    bool met = path.runs[r].resets_end > path.runs[r].first_reset;
    for (int m = 0; m < shape.holds_end; ++m)
      met = met || ((m < shape.jumps_end || path.runs[r].side[m] == 0.0 || path.runs[r - 1].side[m] == 0.0) &&
                    path.runs[r].side[m] != path.runs[r - 1].side[m]);
    const auto next = std::lower_bound(at.begin(), at.end() - 1, time - room);
    if (met && next != at.end() - 1 && *next <= time + room) return false;
  }
  return true;
}

template <class M, class P, class Method>
class SamplesOnTheWay {
  using Equation = VariationalEquation<M, P>;

 public:
  SamplesOnTheWay(const M& model, const Equation& equation, const PointPack<M, P>& pack, std::span<const std::size_t> rows,
                  const PieceSamples& samples)
      : equation_(equation), states_(model, pack.theta, pack.u), rows_(rows), samples_(samples) {
    fit(x_, equation.states);
    fit(s_, equation.dependence.in_columns);
    fit(y_, equation.outputs);
    dy_.resize(equation.outputs * equation.parameters);
  }

  // Whether some lie in a step.
  bool in(const P& size) const {
    for (std::size_t lane = 0; lane < rows_.size(); ++lane)
      if (due(lane, size)) return true;
    return false;
  }

  // Takes those of the step that the columns have just made.
  void take(const Tangents<M, P, Method>& tangents, const P& size) {
    while (in(size)) {
      P share(0.0);
      for (std::size_t lane = 0; lane < rows_.size(); ++lane)
        if (due(lane, size))
          lanes_of<P>::set(share, lane, (next_at(lane) - lanes_of<P>::get(time_, lane)) / lanes_of<P>::get(size, lane));
      tangents.within(share, x_, s_);
      equation_.output(x_, s_, y_, dy_);
      const mask_of_lanes<P> known = finite<P>(x_) & finite<P>(s_),
                             has_outputs = finite<P>(y_) & finite<P>(dy_) & !outside_of_output<P>(states_, x_);
      for (std::size_t lane = 0; lane < rows_.size(); ++lane)
        if (due(lane, size)) put(lane, lanes_of<P>::get(known, lane), lanes_of<P>::get(has_outputs, lane));
    }
    time_ += size;
  }

  // Those that rounding has left behind the end.
  void end() const {
    for (std::size_t lane = 0; lane < rows_.size(); ++lane)
      if (done_[lane] < samples_.inside(rows_[lane])) samples_.missed[rows_[lane]] = true;
  }

 private:
  double next_at(std::size_t lane) const { return samples_.at[rows_[lane]][done_[lane]]; }
  bool due(std::size_t lane, const P& size) const {
    const double step = lanes_of<P>::get(size, lane);
    return step > 0.0 && done_[lane] < samples_.inside(rows_[lane]) && next_at(lane) <= lanes_of<P>::get(time_, lane) + step;
  }

  void put(std::size_t lane, bool known, bool has_outputs) {
    const std::size_t piece = rows_[lane], sample = done_[lane]++, at = samples_.segment[piece] + sample;
    const std::size_t n_x = equation_.states, n_y = equation_.outputs, p = equation_.parameters;
    if (!known || (!has_outputs && samples_.measured[at])) samples_.missed[piece] = true;
    if (samples_.missed[piece]) return;
    get_lane(x_, lane, samples_.x + (samples_.state[piece] + 1 + sample) * n_x);
    if (has_outputs) {
      get_lane(y_, lane, samples_.y + at * n_y);
      get_lane(dy_, lane, samples_.dy_dtheta + at * n_y * p);
    }
    if (!samples_.dx_dtheta) return;
    for_each_index(equation_.states, [&](auto i) {
      for_each_index(equation_.parameters, [&](auto j) {
        if (!equation_.dependence.depends(i, j)) return;
        const auto entry = equation_.dependence.column_start[j] + detail::below(equation_.dependence.rows(j), i);
        samples_.dx_dtheta[(at * n_x + i) * p + j] = lanes_of<P>::get(s_[entry], lane);
      });
    });
  }

  const Equation& equation_;
  const StateEquation<M, P> states_;
  std::span<const std::size_t> rows_;
  const PieceSamples& samples_;
  P time_{0.0};
  std::array<std::size_t, lanes_of<P>::width> done_{};
  typename Equation::State x_;
  Columns<M, P> s_;
  typename StateEquation<M, P>::Output y_;
  ShelfVector<P> dy_;
};

}  // namespace fisherpoint
