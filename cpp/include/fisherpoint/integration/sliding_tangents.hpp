// The variational equation of a trajectory that slides along a jump (sliding.hpp): with x' = f- + a d, d = f+ - f-, the share a
// varies with x and theta so that h stays zero. For every column s of S, with theta's entry e,
//
//     s' = J s + d da,    d/dt (h_x s + h_theta e) = 0,
//
// where J s stands for f_x s + f_theta e at the share a, and therefore da = -(h_x J s + (h_x)' s + (h_theta)' e) / (h_x d).
//
// So h_x s = -h_theta e is known exactly. Rounding would leave small numbers where it is zero, which look like information to
// what divides columns by their own length. One state, the pivot, is therefore not integrated but follows from the others, in x
// as in the columns.
#pragma once

#include "fisherpoint/equations/variational_equation.hpp"
#include "fisherpoint/integration/sliding.hpp"

namespace fisherpoint {

// Of the surface that each lane slides on; zero in the lanes that do not. Of several it is the last.
template <class M, class P>
[[gnu::noinline]] JumpGradient<M, P> slid_surface(const VariationalEquation<M, P>& f, const typename ArraysOf<M, P>::States& x,
                                                  const typename ArraysOf<M, P>::Sides& side) {
  JumpGradient<M, P> slid(f);
  for_each_index(Count<0>{}, f.holds_end, [&](auto m) {
    const auto here = slides<P>(side[m]);
    if (!any(here)) return;
    const auto h = f.jump(m, x);
    slid.value = select(here, h.value, slid.value);
    for_each_index(f.states, [&](auto i) { slid.by_state[i] = select(here, h.by_state[i], slid.by_state[i]); });
    for_each_index(f.parameters, [&](auto j) { slid.by_theta[j] = select(here, h.by_theta[j], slid.by_theta[j]); });
  });
  return slid;
}

// The state by which a lane is kept on its surface: of those that the jump moves, the one that h reads most. A lane that does
// not slide has none.
template <class M, class P>
class Pivot {
  using State = typename ArraysOf<M, P>::States;
  State here_;  // 1 at the pivot, 0 elsewhere

 public:
  void fit_to(const auto& shape) {
    fit(here_, shape.states);
    here_.fill(P(0.0));
  }

  void choose(const auto& shape, const mask_of_lanes<P>& on, const State& normal, const State& d) {
    P largest(0.0), left = select(on, P(1.0), P(0.0));
    for_each_index(shape.states, [&](auto i) { largest = max(largest, abs(normal[i] * d[i])); });
    for_each_index(shape.states, [&](auto i) {
      here_[i] = select(abs(normal[i] * d[i]) >= largest, left, P(0.0));
      left -= here_[i];
    });
  }

  // The same in these lanes alone.
  Pivot within(const mask_of_lanes<P>& lanes) const {
    Pivot some = *this;
    for (P& here : some.here_) here = select(lanes, here, P(0.0));
    return some;
  }

  // Sets the pivot's entry such that `rest` plus normal times the entries, of the states that `each` goes through, is zero.
  void close(const State& normal, P rest, auto&& each, auto&& entry) const {
    each([&](auto i) { rest += select(here_[i] > P(0.5), P(0.0), normal[i] * entry(i)); });
    each([&](auto i) { entry(i) = select(here_[i] > P(0.5), P(0.0) - rest / normal[i], entry(i)); });
  }

  // Onto h = 0, along the pivot.
  void settle(const auto& shape, const JumpGradient<M, P>& h, State& x) const {
    for_each_index(shape.states, [&](auto i) { x[i] = select(here_[i] > P(0.5), x[i] - h.value / h.by_state[i], x[i]); });
  }
};

// Of one stage; zero in the lanes that do not slide.
template <class M, class P>
struct SlidingStage {
  typename ArraysOf<M, P>::States d, normal, turn;  // turn: how h_x changes over the whole step, along f
  typename ArraysOf<M, P>::Parameters drift;        // how h_theta changes
  P inverse{0.0};                                   // 1 / (h_x d)
  Pivot<M, P> pivot;

  void fit_to(const auto& shape) {
    fit(d, shape.states);
    fit(normal, shape.states);
    fit(turn, shape.states);
    fit(drift, shape.parameters);
    pivot.fit_to(shape);
  }
};

// f and its Jacobian at the share a in the place of those on the sides 1, and what columns need besides. Lanes that do not
// slide, or on several jumps, keep theirs.
template <class M, class P>
[[gnu::noinline]] void slide_linearised(const VariationalEquation<M, P>& f, const typename ArraysOf<M, P>::States& x,
                                        const typename ArraysOf<M, P>::Sides& side, const P& step,
                                        typename ArraysOf<M, P>::States& rate, Jacobian<M, P>& jacobian,
                                        SlidingStage<M, P>& stage, const mask_of_lanes<P>& several) {
  const auto on = any_slides<P>(f, side) & !several;
  auto behind = rate;
  auto jacobian_behind = jacobian;
  const auto back = beside<P>(f, side, -1.0);
  f.linearise(BesideSteep(f, x, side).at(back), back, behind, jacobian_behind);
  const auto normal = slid_surface(f, x, side);
  P r_plus(0.0), r_minus(0.0);
  for_each_index(f.states, [&](auto i) {
    r_plus += normal.by_state[i] * rate[i];
    r_minus += normal.by_state[i] * behind[i];
  });
  const P share = select(on, r_minus / (r_minus - r_plus), P(1.0));
  const auto mix = [&](auto& ahead, const auto& from) {
    for (std::size_t e = 0; e < ahead.size(); ++e) ahead[e] = select(on, from[e] + share * (ahead[e] - from[e]), ahead[e]);
  };
  for_each_index(f.states, [&](auto i) {
    stage.d[i] = select(on, rate[i] - behind[i], P(0.0));
    stage.normal[i] = select(several, P(0.0), normal.by_state[i]);
  });
  stage.inverse = select(on, 1.0 / (r_plus - r_minus), P(0.0));
  mix(rate, behind);
  mix(jacobian.by_state, jacobian_behind.by_state);
  mix(jacobian.by_theta, jacobian_behind.by_theta);
  stage.pivot.choose(f, on, stage.normal, stage.d);
  stage.pivot.close(
      stage.normal, P(0.0), [&](auto&& use) { for_each_index(f.states, use); }, [&](auto i) -> P& { return rate[i]; });

  constexpr double part = 1e-4;  // of the step
  auto before = x, after = x;
  for_each_index(f.states, [&](auto i) {
    before[i] -= part * step * rate[i];
    after[i] += part * step * rate[i];
  });
  const auto first = slid_surface(f, before, side), second = slid_surface(f, after, side);
  for_each_index(f.states, [&](auto i) {
    stage.turn[i] = select(several, P(0.0), (0.5 / part) * (second.by_state[i] - first.by_state[i]));
  });
  for_each_index(f.parameters, [&](auto j) {
    stage.drift[j] = select(several, P(0.0), (0.5 / part) * (second.by_theta[j] - first.by_theta[j]));
  });
}

}  // namespace fisherpoint
