// Jumps at the ends of trajectories and of the segments of runs.
//
// A trajectory that meets a jump as near to its end as the tolerance can tell has done so, or is about to: rounding decides.
// What a segment of a run leaves is therefore not the state alone but also the side of each jump to which S belongs, from which
// the next segment goes on: the jump is passed once, by whichever of them it is. Its derivative exists all the same, unless the
// output at the end sees the difference, or the input changes in that very instant: then it may matter whether the jump comes
// before. S of both cases is compared.
#pragma once

#include <span>
#include <vector>

#include "fisherpoint/equations/state_equation.hpp"
#include "fisherpoint/integration/integrator.hpp"
#include "fisherpoint/integration/tangents.hpp"
#include "fisherpoint/kernels/point_paths.hpp"
#include "fisherpoint/kernels/points.hpp"

namespace fisherpoint {

// S of both cases is the same up to this share of a column's size.
inline constexpr double alike = 1e-4;

// What the next segment of a run finds of the last one.
struct SegmentEnd {
  std::vector<double> u;     // its input
  std::vector<double> side;  // on which it ended, of every jump, 0 of one that it slid on; none before the first segment
  bool doubtful = false;     // whether a jump was met before the end; then S (n_x, p) and the sides of the other case,
  bool between = false;      // or more than two cases
  std::vector<double> other_s, other_side;
  std::vector<double> holds;  // whether the condition of every reset held at its end, 1 or 0; none before the first segment

  void note(const auto& sides, const auto& input, int jumps, int lane) {
    u.resize(input.size());
    get_lane(input, lane, u.data());
    side.clear();
    for (int m = 0; m < jumps; ++m) side.push_back(lanes_of<std::remove_cvref_t<decltype(sides[m])>>::get(sides[m], lane));
  }
};

// Of every lane, which conditions of resets held at its last end: into and out of the numbers of the integrator.
template <class P>
void hold_conditions(auto& held, int used, auto&& end_of) {
  for (std::size_t k = 0; k < held.size(); ++k)
    for (int lane = 0; lane < used; ++lane)
      if (const auto* end = end_of(lane); !end->holds.empty()) lanes_of<P>::set(held[k], lane, end->holds[k]);
}
template <class P>
void note_conditions(const auto& held, int used, auto&& end_of) {
  for (int lane = 0; lane < used; ++lane) {
    auto& holds = end_of(lane)->holds;
    holds.clear();
    for (const P& of : held) holds.push_back(lanes_of<P>::get(of, lane));
  }
}

// The sides from which lanes come: those where they ended, but of a surface that a change of the input has moved, or an update
// of the states from `came` to x.
template <class M, class P, class Equation>
typename Equation::Side sides_of_ends(const M& model, const Equation& equation, const typename Equation::Theta& theta,
                                      const typename Equation::State& came, const typename Equation::State& x,
                                      const typename Equation::Input& u, int used, auto&& end_of) {
  const auto shape = shape_of(model);
  typename Equation::Side from;
  fit(from, shape.sides);
  from.fill(P(unknown_side));
  auto before = u;
  bool changed = false;
  for (int lane = 0; lane < used; ++lane) {
    const SegmentEnd& end = end_of(lane);
    if (end.side.empty()) continue;
    for (int m = 0; m < shape.jumps_end; ++m) lanes_of<P>::set(from[m], lane, end.side[m]);
    set_lane(before, lane, end.u.data());
    for (int i = 0; i < shape.inputs; ++i) changed = changed || end.u[i] != lanes_of<P>::get(u[i], lane);
    for (int i = 0; i < shape.states; ++i) changed = changed || lanes_of<P>::get(came[i], lane) != lanes_of<P>::get(x[i], lane);
  }
  if (!changed) return from;
  const auto now = equation.surface_values(x), then = Equation(model, theta, before).surface_values(came);
  for_each_index(Count<0>{}, shape.jumps_end,
                 [&](auto m) { from[m] = select((now[m] < then[m]) | (now[m] > then[m]), P(unknown_side), from[m]); });
  return from;
}

// Whether a path changes its sides twice just before its end.
template <class M>
bool turns_at_once(const PointPath<M>& path, double room) {
  if (path.runs.size() < 3) return false;
  double lasts = 0.0;
  for (std::size_t n = path.runs[path.runs.size() - 3].end; n < path.size(); ++n) lasts += path.sizes[n];
  return lasts <= room;
}

// Notes in a path where the trajectory comes from, and whether it ends next to a jump; `near` is told by the integrator.
template <class P, class M, class Equation>
[[gnu::noinline]] void note_jumps_of_paths(const Equation& equation, const typename Equation::State& x,
                                           const typename Equation::Side& from, const P& duration, const mask_of_lanes<P>& near,
                                           const Tolerance& tolerance, std::span<const std::size_t> rows,
                                           std::vector<PointPath<M>>& paths) {
  const int used = static_cast<int>(rows.size()), jumps = equation.jumps_end;
  typename Equation::Side last, other;
  fit(last, equation.sides);
  last.fill(P(1.0));
  P tail(std::numeric_limits<double>::infinity());  // how long it has been on these sides
  other = last;
  for (int lane = 0; lane < used; ++lane) {
    PointPath<M>& path = paths[rows[lane]];
    if (path.runs.empty()) continue;
    path.start = path.runs[0].side;
    for (int m = 0; m < jumps; ++m) {
      const double came = lanes_of<P>::get(from[m], lane);
      if (came != unknown_side)
        path.start[m] = came;
      else if (path.start[m] == 0.0)  // onto a slide, from either side
        path.start[m] = 1.0;
    }
    for (int m = jumps; m < equation.holds_end; ++m)
      if (path.start[m] == 0.0) path.start[m] = 1.0;
    path.other = path.runs.back().side;
    set_lane(last, lane, path.runs.back().side.data());
    set_lane(other, lane, path.runs.back().side.data());
    if (path.runs.size() < 2) continue;
    const auto& before = path.runs[path.runs.size() - 2];
    double lasts = 0.0;
    for (std::size_t n = before.end; n < path.size(); ++n) lasts += path.sizes[n];
    lanes_of<P>::set(tail, lane, lasts);
    set_lane(other, lane, before.side.data());
  }
  const P room = next_to_jump * tolerance.relative * duration;
  // Beside the instant in which states are set anew they have two values.
  auto anew = lanes_of<P>::none();
  if constexpr (has_resets<Equation>) {
    for (int lane = 0; lane < used; ++lane) {
      const PointPath<M>& path = paths[rows[lane]];
      if (path.runs.empty() || path.runs.back().resets_end == path.runs.back().first_reset) continue;
      const int surface = path.resets.back().surface;
      if (surface >= 0 && equation.dependence.switching_depends(surface)) lanes_of<P>::set(anew, lane, true);
    }
  }
  anew = anew & (tail <= room);
  const auto turned = tail <= (tolerance.whole_first ? P(1e300) : room);
  if (!any(near | turned)) return;

  typename Equation::State rates;
  fit(rates, equation.states);
  rates_along(equation, x, other, rates);
  const auto rate_before = equation.surface_rates(x, rates);
  rates_along(equation, x, last, rates);
  const auto value = equation.surface_values(x), rate = equation.surface_rates(x, rates);
  P count(0.0);
  auto grazes = lanes_of<P>::none();
  for_each_index(Count<0>{}, equation.jumps_end, [&](auto m) {
    const auto met = turned & (abs(last[m] - other[m]) > P(0.5)) & !slides(other[m]);
    auto just = met & (tail <= room), next = near & !met & !slides(last[m]) & (last[m] * rate[m] < P(0.0));
    P height = room * abs(rate[m]);
    if (tolerance.whole_first) {  // as far as another integration of the same piece may be off
      const P off = 2.0 * tolerance.relative * natural_height(equation, m, x);
      just = met & ((tail <= room) | (tail * abs(rate_before[m]) <= off));
      height = max(height, off);
    }
    next = next & (abs(value[m]) <= height);
    other[m] = select(just, other[m], last[m]);
    if constexpr (has_resets<Equation>) {
      if (equation.resets > 0 && any(next)) {
        auto tried = last;
        tried[m] = select(next, -last[m], last[m]);
        const auto now = equation.reset_conditions(x, last), then = equation.reset_conditions(x, tried);
        for (int k = 0; k < equation.resets; ++k) anew = anew | (next & (then[k] > P(0.0)) & !(now[k] > P(0.0)));
      }
    }
    if (equation.dependence.switching_depends(m)) {
      count += select(just | next, P(1.0), P(0.0));
      if (any(next)) {
        auto tried = last;
        tried[m] = select(next, -last[m], last[m]);
        rates_along(equation, x, tried, rates);
        const P behind = last[m] * equation.surface_rates(x, rates)[m];
        other[m] = select(next & (behind < P(0.0)), -last[m], select(next & (behind > P(0.0)), P(0.0), other[m]));
        grazes = grazes | (next & !(abs(behind) > P(0.0)));
      }
    } else {
      other[m] = last[m];
    }
  });
  for (int lane = 0; lane < used; ++lane) {
    PointPath<M>& path = paths[rows[lane]];
    const double doubts = lanes_of<P>::get(count, lane);
    const bool set = lanes_of<P>::get(anew, lane);
    if (path.runs.empty() || (doubts == 0.0 && !set)) continue;
    path.ends_on_jump = true;
    path.between = set || lanes_of<P>::get(grazes, lane) || turns_at_once(path, lanes_of<P>::get(room, lane));
    for (int m = 0; m < jumps; ++m) path.other[m] = lanes_of<P>::get(other[m], lane);
  }
}

// Where the input changes in the instant in which a jump is met: lanes in which it matters whether the jump comes before. S is
// taken over it from either side, and onto the sides on which this segment begins.
template <class P, class Method, class M>
[[gnu::noinline]] mask_of_lanes<P> hangs_on_order(const M& model, const PointPack<M, P>& pack, const Tolerance& tolerance,
                                                  const typename StateEquation<M, P>::Side& from,
                                                  const std::vector<PointPath<M>>& paths, std::span<const std::size_t> rows,
                                                  const double* s, auto&& end_of) {
  using Equation = StateEquation<M, P>;
  const auto shape = shape_of(model);
  const std::size_t entries = static_cast<std::size_t>(shape.states) * shape.parameters;
  auto hangs = lanes_of<P>::none(), doubtful = hangs;
  auto other = from;
  for (int lane = 0; lane < pack.used; ++lane) {
    const SegmentEnd& end = end_of(lane);
    bool changed = false;
    for (int i = 0; i < shape.inputs && end.doubtful; ++i) changed = changed || end.u[i] != lanes_of<P>::get(pack.u[i], lane);
    if (!changed || paths[rows[lane]].runs.empty()) continue;
    lanes_of<P>::set(doubtful, lane, true);
    if (end.between) lanes_of<P>::set(hangs, lane, true);
    for (int m = 0; m < shape.jumps_end && !end.between; ++m)
      if (lanes_of<P>::get(from[m], lane) != unknown_side) lanes_of<P>::set(other[m], lane, end.other_side[m]);
  }
  if (!any(doubtful)) return hangs;

  auto met = from;
  for_each_index(shape.sides, [&](auto m) { met[m] = select(abs(other[m] - from[m]) > P(0.5), P(1.0), P(0.0)); });
  const Equation states(model, pack.theta, pack.u, pack.used);
  auto stopped = lanes_of<P>::none();
  const auto begins = [&](const auto& sides) {
    const auto first = Integrator<Equation, Method>(states, tolerance).sides_from(pack.x0, pack.dt, sides, met, stopped);
    hangs = hangs | (doubtful & stopped);
    return first;
  };
  const auto first = begins(from), other_first = begins(other);
  auto start = first, other_start = first;
  for_each_index(Count<0>{}, shape.jumps_end, [&](auto m) {
    hangs = hangs | (doubtful & (abs(other_first[m] - first[m]) > P(0.5)));
    const auto known = abs(from[m]) < P(0.5 * (1.0 + unknown_side));
    start[m] = select(known, from[m], first[m]);
    other_start[m] = select(known, other[m], first[m]);
  });
  const VariationalEquation<M, P> equation(model, pack.theta, pack.u, pack.used);
  Tangents<M, P, Method> as_it_is(equation, pack.x0, tolerance), otherwise = as_it_is;
  for (int lane = 0; lane < pack.used; ++lane) {
    if (!lanes_of<P>::get(doubtful, lane) || end_of(lane).between) continue;
    as_it_is.start(lane, s + rows[lane] * entries);
    otherwise.start(lane, end_of(lane).other_s.data());
  }
  as_it_is.pass(start, first);
  otherwise.pass(other_start, first);
  return hangs | (doubtful & as_it_is.differs(otherwise, alike));
}

}  // namespace fisherpoint
