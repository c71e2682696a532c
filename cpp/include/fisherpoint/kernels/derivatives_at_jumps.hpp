// Whether trajectories have derivatives where jumps are at their ends: where they start off a jump, or rest on one because as
// much moves them as holds them, and where they end next to one. Paths of which S has no value there are dropped with a status.
#pragma once

#include <span>
#include <vector>

#include "fisherpoint/integration/integrator.hpp"
#include "fisherpoint/integration/tangents.hpp"
#include "fisherpoint/kernels/moved_switches.hpp"
#include "fisherpoint/kernels/piece_samples.hpp"
#include "fisherpoint/kernels/point_paths.hpp"
#include "fisherpoint/kernels/points.hpp"
#include "fisherpoint/kernels/segment_ends.hpp"

namespace fisherpoint {

// What points have from where the segment before them ended, of runs (run_sensitivities.hpp).
struct Carried {
  const double* s;                // (count, n_x, p), dx/dtheta at the start
  double* step;                   // (count,), the first step to try, 0 to choose one; then the one to try next
  unsigned char* stiff;           // (count,), whether it is implicit, and is so next
  const unsigned char* measured;  // (count,), whether the derivative at the end is asked for
  SegmentEnd* const* ends;        // (count,), of models with jumps
  const double* came;             // (count, n_x), the states before updates at the start
  MovedStarts moved = {};
  const PieceSamples* samples = nullptr;  // of pieces of several segments
};

// Where S has no value on the side on which a trajectory starts off a jump: unless h stays zero there whatever theta, a part of
// the way was on the other side.
template <class M, class P>
[[gnu::noinline]] mask_of_lanes<P> starts_beside(const M& model, const PointPack<M, P>& pack, const Outcome<P>& outcome,
                                                 std::span<const std::size_t> rows, const Carried* carried) {
  const VariationalEquation<M, P> equation(model, pack.theta, pack.u, pack.used);
  const int n_x = equation.states, p = equation.parameters;
  auto beside = lanes_of<P>::none();
  for_each_index(Count<0>{}, equation.jumps_end, [&](auto m) {
    const auto h = equation.jump(m, pack.x0);
    P size(0.0), moves(0.0);
    for_each_index(equation.states, [&](auto i) { size += abs(h.by_state[i]) * (1.0 / equation.inverse_scale(i)); });
    for (int j = 0; j < p; ++j) {
      P by_theta = h.by_theta[j], parts = abs(by_theta);
      for (int i = 0; carried && i < n_x; ++i) {
        P s(0.0);
        for (int lane = 0; lane < pack.used; ++lane)
          lanes_of<P>::set(s, lane, carried->s[(rows[lane] * n_x + i) * p + j] + carried->moved.of(rows[lane], j, i, m, n_x));
        by_theta += h.by_state[i] * s;
        parts += abs(h.by_state[i] * s);
      }
      moves = select(abs(by_theta) > 1e-9 * parts, P(1.0), moves);
    }
    beside = beside | (outcome.starts_on_jump & (abs(h.value) <= on_surface * size) & (moves > P(0.0)));
  });
  return beside;
}

// Where a trajectory starts at rest on a jump because as much moves it as holds it, as a force that is just what friction
// bears: S has no value if that hangs on theta, as it then moves for some theta and does not for others. Where the balance is
// lost in the next moment anyway S has one.
template <class M, class P>
[[gnu::noinline]] mask_of_lanes<P> starts_in_balance(const M& model, const PointPack<M, P>& pack, const Outcome<P>& outcome,
                                                     std::span<const std::size_t> rows, const Carried* carried,
                                                     const std::vector<PointPath<M>>& paths) {
  using Equation = StateEquation<M, P>;
  constexpr double balanced = 1e-9, share = 1e-4;
  const Equation equation(model, pack.theta, pack.u, pack.used);
  typename Equation::Side side;
  typename Equation::State rates;
  fit(side, equation.sides);
  fit(rates, equation.states);
  side.fill(P(1.0));
  for (int lane = 0; lane < pack.used; ++lane)
    if (const auto& runs = paths[rows[lane]].runs; !runs.empty()) set_lane(side, lane, runs.front().side.data());
  const auto rate = [&](const Equation& f, const typename Equation::State& x, const typename Equation::Side& on, int m) {
    f.derivative(x, on, rates);
    return P(f.surface_rates(x, rates)[m]);
  };
  auto found = lanes_of<P>::none();
  const auto value = equation.surface_values(pack.x0);
  for (int m = 0; m < equation.jumps_end; ++m) {
    auto here = outcome.starts_on_jump & !slides(side[m]);
    if (!any(here)) continue;
    here = here & (abs(value[m]) <= on_surface * natural_height(equation, m, pack.x0));
    auto other = side;
    other[m] = P(0.0) - side[m];
    const P still = rate(equation, pack.x0, side, m), across = abs(rate(equation, pack.x0, other, m) - still);
    auto ahead = pack.x0;
    equation.derivative(pack.x0, side, rates);
    for_each_index(equation.states, [&](auto i) { ahead[i] += glance * pack.dt * rates[i]; });
    here = here & (abs(still) <= balanced * across) & (abs(rate(equation, ahead, side, m) - still) <= alike_rates * across);
    for (int j = 0; j < equation.parameters && any(here); ++j) {
      auto theta = pack.theta;
      auto x = pack.x0;
      const P by = select(abs(theta[j]) > P(0.0), share * abs(theta[j]), P(share));
      theta[j] += by;
      for (int i = 0; carried && i < equation.states; ++i)
        for (int lane = 0; lane < pack.used; ++lane) {
          const double s = carried->s[(rows[lane] * equation.states + i) * equation.parameters + j];
          lanes_of<P>::set(x[i], lane, lanes_of<P>::get(x[i], lane) + s * lanes_of<P>::get(by, lane));
        }
      found = found | (here & (abs(rate(Equation(model, theta, pack.u), x, side, m) - still) > hanging * share * across));
    }
  }
  return found;
}

// What paths have to do with jumps at their ends, and the statuses of those that have no derivative because of them.
template <class P, class Method, class M, class Equation>
[[gnu::noinline]] void look_at_jumps(const M& model, const Equation& equation, const PointPack<M, P>& pack,
                                     const typename Equation::State& x, const typename Equation::Side& from,
                                     const Outcome<P>& outcome, const Tolerance& tolerance, std::span<const std::size_t> rows,
                                     const Carried* carried, std::vector<PointPath<M>>& paths, Status* status) {
  note_jumps_of_paths<P>(equation, x, from, pack.dt, outcome.ends_on_jump, tolerance, rows, paths);
  auto none = lanes_of<P>::none();
  if (!tolerance.whole_first && any(outcome.starts_on_jump))
    none = starts_beside<M, P>(model, pack, outcome, rows, carried) |
           starts_in_balance<M, P>(model, pack, outcome, rows, carried, paths);
  if (carried) {
    const auto end_of = [&](int lane) -> const SegmentEnd& { return *carried->ends[rows[lane]]; };
    none = none | hangs_on_order<P, Method>(model, pack, tolerance, from, paths, rows, carried->s, end_of);
  }
  for (int lane = 0; lane < pack.used; ++lane) {
    const std::size_t k = rows[lane];
    if (paths[k].runs.empty()) continue;
    // Of pieces of a trajectory, each by itself, the others do not know on which side this one ends.
    if (!lanes_of<P>::get(none, lane) && !(tolerance.whole_first && paths[k].ends_on_jump)) continue;
    paths[k] = PointPath<M>();
    status[k] = Status::on_jump;
  }
}

// Of trajectories that end next to a jump: where the outputs there, or also the states, would have other derivatives on the
// other side, and what the next segment of a run has to know.
template <class P, class Method, class M>
[[gnu::noinline]] mask_of_lanes<P> ends_beside(const VariationalEquation<M, P>& equation,
                                               const Tangents<M, P, Method>& tangents, const ShelfVector<P>& dy,
                                               std::span<const std::size_t> rows, const std::vector<PointPath<M>>& paths,
                                               const Carried* carried, bool outputs_alone) {
  const int used = static_cast<int>(rows.size()), n_x = equation.states, p = equation.parameters;
  typename VariationalEquation<M, P>::Side last, other;
  fit(last, equation.sides);
  last.fill(P(1.0));
  other = last;
  auto doubtful = lanes_of<P>::none(), between = doubtful;
  for (int lane = 0; lane < used; ++lane) {
    const auto& path = paths[rows[lane]];
    if (!path.ends_on_jump) continue;
    lanes_of<P>::set(doubtful, lane, true);
    lanes_of<P>::set(between, lane, path.between);
    set_lane(last, lane, path.runs.back().side.data());
    set_lane(other, lane, path.between ? path.runs.back().side.data() : path.other.data());
  }
  auto otherwise = tangents;
  between = between | ((otherwise.exchange(last, other) | otherwise.hangs_on_order()) & doubtful);
  auto matters = between;
  const auto differs = tangents.differs(otherwise, alike) & doubtful;
  if (!outputs_alone) matters = matters | differs;
  typename StateEquation<M, P>::Output y;
  fit(y, equation.outputs);
  ShelfVector<P> other_dy(dy.size());
  equation.output(tangents.x, otherwise.s, y, other_dy);
  for (std::size_t e = 0; e < dy.size(); ++e)
    matters = matters | (doubtful & !(abs(dy[e] - other_dy[e]) <= alike * (abs(dy[e]) + abs(other_dy[e]))));
  for (int lane = 0; carried && lane < used; ++lane) {
    const std::size_t k = rows[lane];
    if (!paths[k].ends_on_jump) continue;
    SegmentEnd& end = *carried->ends[k];
    end.doubtful = true;
    end.between = lanes_of<P>::get(between, lane);
    end.other_side.assign(paths[k].other.begin(), paths[k].other.begin() + equation.jumps_end);
    end.other_s.assign(static_cast<std::size_t>(n_x) * p, 0.0);
    for (int j = 0; j < p; ++j) {
      const P* entry = &otherwise.s[equation.dependence.column_start[j]];
      for (int i = 0; i < n_x; ++i)
        if (equation.dependence.depends(i, j)) end.other_s[i * p + j] = lanes_of<P>::get(*entry++, lane);
    }
  }
  return matters;
}

}  // namespace fisherpoint
