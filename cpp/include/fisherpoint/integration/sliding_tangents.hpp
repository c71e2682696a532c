// The variational equation of a trajectory that slides along a jump (sliding.hpp): with x' = f- + a d, d = f+ - f-, the share a
// varies with x and theta so that h stays zero. For every column s of S, with theta's entry e,
//
//     s' = J s + d da,    d/dt (h_x s + h_theta e) = 0,
//
// where J s stands for f_x s + f_theta e at the share a, and therefore da = -(h_x J s + (h_x)' s + (h_theta)' e) / (h_x d).
#pragma once

#include "fisherpoint/equations/variational_equation.hpp"
#include "fisherpoint/integration/sliding.hpp"

namespace fisherpoint {

// Of one stage; zero in the lanes that do not slide.
template <class M, class P>
struct SlidingStage {
  typename ArraysOf<M, P>::States d, normal, turn;  // turn: how h_x changes over the whole step, along f
  typename ArraysOf<M, P>::Parameters drift;        // how h_theta changes
  P inverse{0.0};                                   // 1 / (h_x d)

  void fit_to(const auto& shape) {
    fit(d, shape.states);
    fit(normal, shape.states);
    fit(turn, shape.states);
    fit(drift, shape.parameters);
  }
};

// f and its Jacobian at the share a in the place of those on the sides 1, and what columns need besides. Lanes that do not
// slide keep theirs.
template <class M, class P>
[[gnu::noinline]] void slide_linearised(const VariationalEquation<M, P>& f, const typename ArraysOf<M, P>::States& x,
                                        const typename ArraysOf<M, P>::Sides& side, const P& step,
                                        typename ArraysOf<M, P>::States& rate, Jacobian<M, P>& jacobian,
                                        SlidingStage<M, P>& stage) {
  const auto on = any_slides<P>(f, side);
  auto behind = rate;
  auto jacobian_behind = jacobian;
  f.linearise(x, beside<P>(f, side, -1.0), behind, jacobian_behind);
  const auto normal_of = [&](const auto& at) {  // to the surface that each lane slides on
    JumpGradient<M, P> normal(f);
    for_each_index(Count<0>{}, f.jumps_end, [&](auto m) {
      const auto here = slides<P>(side[m]);
      if (!any(here)) return;
      const auto h = f.jump(m, at);
      for_each_index(f.states, [&](auto i) { normal.by_state[i] = select(here, h.by_state[i], normal.by_state[i]); });
      for_each_index(f.parameters, [&](auto j) { normal.by_theta[j] = select(here, h.by_theta[j], normal.by_theta[j]); });
    });
    return normal;
  };
  const auto normal = normal_of(x);
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
    stage.normal[i] = normal.by_state[i];
  });
  stage.inverse = select(on, 1.0 / (r_plus - r_minus), P(0.0));
  mix(rate, behind);
  mix(jacobian.by_state, jacobian_behind.by_state);
  mix(jacobian.by_theta, jacobian_behind.by_theta);

  constexpr double part = 1e-4;  // of the step
  auto before = x, after = x;
  for_each_index(f.states, [&](auto i) {
    before[i] -= part * step * rate[i];
    after[i] += part * step * rate[i];
  });
  const auto first = normal_of(before), second = normal_of(after);
  for_each_index(f.states, [&](auto i) { stage.turn[i] = (0.5 / part) * (second.by_state[i] - first.by_state[i]); });
  for_each_index(f.parameters, [&](auto j) { stage.drift[j] = (0.5 / part) * (second.by_theta[j] - first.by_theta[j]); });
}

}  // namespace fisherpoint
