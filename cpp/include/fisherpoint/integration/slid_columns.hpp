// Columns of S along jumps on which a trajectory slides: members of Tangents (tangents.hpp, at whose end it is included). Their
// rates stay on the surface, and so do they.
#pragma once

#include "fisherpoint/integration/sliding_tangents.hpp"
#include "fisherpoint/integration/sliding_tangents_several.hpp"

namespace fisherpoint {

template <class M, class P, class Method>
void Tangents<M, P, Method>::keep_on(const JumpGradient<M, P>& h, const Pivot<M, P>& pivot) {
  pivot.settle(f_, h, x);
  for_each_index(f_.parameters, [&](auto j) {
    P* const column = &s[f_.dependence.column_start[j]];
    const auto rows = f_.dependence.rows(j);
    pivot.close(
        h.by_state, h.by_theta[j], [&](auto&& use) { for_each_variable(rows, use); },
        [&](auto i) -> P& { return column[detail::below(rows, i)]; });
  });
}

template <class M, class P, class Method>
void Tangents<M, P, Method>::keep_on_slides(const P& step, const Side& side) {
  const Mask moving = step > P(0.0);
  keep_on(slid_surface(f_, x, side), sliding_[stages() - 1].pivot.within(moving));
  if (any_several()) several_stages_[stages() - 1].keep_on(f_, several_ & moving, x, s);
}

template <class M, class P, class Method>
void Tangents<M, P, Method>::slide_column(auto rows, const State& column, int k, int s, State& rate) {
  const SlidingStage<M, P>& stage = sliding_[s];
  const P of_several = any_several() ? several_stages_[s].correct(f_, rows, column, k, rate) : P(0.0);
  P sum = stage.drift[k], cancelled(0.0);
  for_each_variable(rows, [&](auto i) { sum += stage.normal[i] * rate[i] + stage.turn[i] * column[i]; });
  const P share = -sum * stage.inverse;
  P rest = stage.drift[k];
  for_each_variable(rows, [&](auto i) {
    const P change = stage.d[i] * share;
    rate[i] += change;
    rest += stage.turn[i] * column[i];
    cancelled += square(change * f_.inverse_scale(i));
  });
  stage.pivot.close(
      stage.normal, rest, [&](auto&& use) { for_each_variable(rows, use); }, [&](auto i) -> P& { return rate[i]; });
  // A column that the surface holds at zero consists of rounding, which is no error.
  const double part = 1e-14 / tolerance_;
  squared_column_size_[k] = max(squared_column_size_[k], (part * part) * (cancelled + of_several));
}

}  // namespace fisherpoint
