// What the variational equation does at jumps: members of Tangents (tangents.hpp, at whose end it is included). S over a jump,
// onto one to slide, and over several that are met in one instant.
#pragma once

#include "fisherpoint/integration/sliding_tangents.hpp"
#include "fisherpoint/integration/sliding_tangents_several.hpp"
#include "fisherpoint/integration/step_control.hpp"

namespace fisherpoint {

// From one jump to the other side of it, or onto it to slide: where `before` and `after` differ. With G = h_x S + h_theta, S
// grows by (f_after - f_before) G / (h_x f_before). The trajectory is taken onto the surface for it, and back in time.
// Returns where the jump is grazed: S grows past all bounds there. Several jumps at once are passed one after the other.
template <class M, class P, class Method>
auto Tangents<M, P, Method>::pass(const Side& before, const Side& after) -> Mask {
  auto grazes = lanes_of<P>::none(), once = grazes, several = grazes;
  for_each_index(Count<0>{}, f_.holds_end, [&](auto m) {
    const auto here = meets(m, before, after);
    several = several | (once & here);
    once = once | here;
  });
  for_each_index(Count<0>{}, f_.holds_end, [&](auto m) {
    const auto here = meets(m, before, after) & !several;
    if (any(here)) grazes = grazes | pass_jump(m, here, before, after);
  });
  return any(several) ? grazes | pass_several(several, before, after) : grazes;
}

// S for the case in which a jump that the trajectory ends next to was met before the end, where it was not, or was not met,
// where it was: on the sides `other` instead of `last`. Returns where that is grazed.
template <class M, class P, class Method>
auto Tangents<M, P, Method>::exchange(const Side& last, const Side& other) -> Mask {
  for_each_index(Count<0>{}, f_.jumps_end, [&](auto m) {
    const auto entered = slides(last[m]) & !slides(other[m]);  // a slide, which has forgotten from where
    if (!any(entered) || entered_.empty()) return;
    for (std::size_t e = 0; e < s.size(); ++e) s[e] = select(entered, entered_[e], s[e]);
  });
  return pass(last, other);
}

// Lanes that meet jump m: they cross it or begin to slide. One that has ended to hold them is left behind without a change. At
// a kink S changes only where it begins to hold them.
template <class M, class P, class Method>
auto Tangents<M, P, Method>::meets(auto m, const Side& before, const Side& after) const -> Mask {
  const Mask meets = !slides(before[m]) & (abs(after[m] - before[m]) > P(0.5));
  return m < f_.jumps_end ? meets : meets & slides(after[m]);
}

// In the order of the jumps, and in the other one: which of them is first may hang on a parameter.
template <class M, class P, class Method>
auto Tangents<M, P, Method>::pass_several(const Mask& lanes, const Side& before, const Side& after) -> Mask {
  Mask in_order = lanes_of<P>::none();  // in which it meets a jump too
  for_each_index(Count<0>{}, f_.jumps_end, [&](auto m) { in_order = in_order | (lanes & meets(m, before, after)); });
  if (const Mask held = lanes & !in_order; any(held)) hold_on_several(held, after);
  if (!any(in_order)) return in_order;
  auto otherwise = *this;
  const auto grazes = pass_in_order(in_order, before, after, false) | otherwise.pass_in_order(in_order, before, after, true);
  hangs_on_order_ = hangs_on_order_ | (in_order & differs(otherwise, 1e-4));
  return grazes;
}

// Onto several surfaces that begin to hold these lanes in one instant, along what the root at each of them moves.
template <class M, class P, class Method>
void Tangents<M, P, Method>::hold_on_several(const Mask& lanes, const Side& after) {
  SeveralStage<M, P> stage;
  Jacobian<M, P> unused = jacobian_[0];
  State there;
  fit(there, f_.states);
  linearise_ahead(x, after, true, there, unused);
  stage.linearise(f_, x, after, P(0.0), lanes, there, unused);
  stage.enter(f_, lanes, x, s);
  stage.keep_on(f_, lanes, x, s);
}

template <class M, class P, class Method>
auto Tangents<M, P, Method>::pass_in_order(const Mask& lanes, const Side& before, const Side& after, bool backwards) -> Mask {
  auto grazes = lanes_of<P>::none();
  P left(0.0);  // of the jumps
  for_each_index(Count<0>{}, f_.holds_end, [&](auto m) { left += select(lanes & meets(m, before, after), P(1.0), P(0.0)); });
  Side from = before;
  for (int k = 0; k < f_.holds_end; ++k) {
    const int m = backwards ? f_.holds_end - 1 - k : k;
    const Mask here = lanes & meets(m, before, after);
    if (!any(here)) continue;
    left -= select(here, P(1.0), P(0.0));
    Side to = from;
    to[m] = select(here, after[m], from[m]);
    // What held before is left with the last jump.
    for_each_index(f_.sides, [&](auto i) { to[i] = select(here & (left < P(0.5)), after[i], to[i]); });
    grazes = grazes | pass_jump(m, here, from, to);
    from = to;
  }
  return grazes;
}

template <class M, class P, class Method>
auto Tangents<M, P, Method>::pass_jump(auto m, const mask_of_lanes<P>& here, const Side& before, const Side& after) -> Mask {
  const auto in_time = [&](const P& time, const Side& side) { advance_briefly(select(here, time, P(0.0)), side); };
  const auto growth = [&](const JumpGradient<M, P>& h, const State& rate) {
    P sum(0.0);
    for_each_index(f_.states, [&](auto i) { sum += h.by_state[i] * rate[i]; });
    return sum;
  };
  // What begins to slide is taken onto the surface along f_behind - f_before, wherever it comes from: with f on the other
  // side instead of f_behind, that is the formula where h_x f_before may be zero.
  // Where another jump lets go in that instant, f is not on a line between these sides: there it is the formula as it stands.
  auto released = lanes_of<P>::none();
  for_each_index(Count<0>{}, f_.jumps_end,
                 [&](auto other) { released = released | (slides(before[other]) & !slides(after[other])); });
  const auto begins = here & slides(after[m]), slides_on = f_.dependence.steep(m) ? begins : begins & !released,
             goes_through = here & !slides_on;
  Side beyond = after;
  beyond[m] = select(slides_on, -before[m], after[m]);
  State rate, rate_behind;
  fit_all_two(rate, rate_behind);
  const auto off = f_.jump(m, x);
  rates(x, before, rate);
  const P growth_off = growth(off, rate);
  rates(x, after, rate_behind);
  const auto passes = goes_through & (abs(growth_off) > alike_rates * abs(growth(off, rate_behind)));
  const P time = select(passes, -off.value / growth_off, P(0.0));
  in_time(time, before);

  const auto h = f_.jump(m, x);
  if (f_.dependence.steep(m) && any(begins)) {  // on the surface itself f has no jump
    const BesideSteep beside_it(f_, x, hold_height, [&](int n) { return n == m ? begins : here & slides(after[n]); });
    Side from = after;
    from[m] = select(begins, before[m], after[m]);
    rates(beside_it.at(from, m), from, rate);
    rates(beside_it.at(beyond, m), beyond, rate_behind);
  } else {
    rates(x, before, rate);
    rates(x, beyond, rate_behind);
  }
  const P fall = growth(h, rate), fall_behind = growth(h, rate_behind);
  // What leaves a rest takes S with it, and what comes to rest stays on the surface.
  const auto leaves_rest = here & !begins & !(abs(fall) > alike_rates * abs(fall_behind));
  const auto rests = here & !begins & !leaves_rest & (abs(fall_behind) <= alike_rates * abs(fall)), stays = begins | rests;
  auto jumps = lanes_of<P>::none();  // as f need not, beside the centre of a dead zone
  for_each_index(f_.states, [&](auto i) {
    jumps = jumps | (abs(rate_behind[i] - rate[i]) > 1e-13 * (abs(rate_behind[i]) + abs(rate[i])));
  });
  const P weight = select(here & jumps & !leaves_rest, 1.0 / select(slides_on, fall - fall_behind, fall), P(0.0));
  const P height = select(slides_on, h.value, P(0.0));
  if (any(begins)) {
    entered_.resize(s.size(), P(0.0));
    for (std::size_t e = 0; e < s.size(); ++e) entered_[e] = select(begins, s[e], entered_[e]);
  }
  for_each_index(f_.states, [&](auto i) { x[i] += (rate_behind[i] - rate[i]) * (height * weight); });
  for (int j = 0; j < f_.parameters; ++j) {
    P* const column = &s[f_.dependence.column_start[j]];
    P shift = h.by_theta[j];
    for_each_row(j, [&](int i, int at) { shift += h.by_state[i] * column[at]; });
    for_each_row(j, [&](int i, int at) { column[at] += (rate_behind[i] - rate[i]) * (shift * weight); });
  }
  const Mask on_several = f_.holds_end > 1 && any(begins) ? begins & several_slides<P>(f_, after) : lanes_of<P>::none();
  if (any(on_several)) {
    SeveralStage<M, P> stage;
    Jacobian<M, P> unused = jacobian_[0];
    State there = rate;
    linearise_ahead(x, after, true, there, unused);
    stage.linearise(f_, x, after, P(0.0), on_several, there, unused);
    stage.keep_on(f_, on_several, x, s);
  }
  if (any(stays & !on_several)) {
    State d;
    fit(d, f_.states);
    for_each_index(f_.states, [&](auto i) { d[i] = rate_behind[i] - rate[i]; });
    const auto on = f_.jump(m, x);
    Pivot<M, P> pivot;
    pivot.fit_to(f_);
    pivot.choose(f_, stays & !on_several, on.by_state, d);
    keep_on(on, pivot);
  }
  // What the state's error makes of `fall` by the time the jump is met.
  P size(0.0);
  for_each_index(f_.states, [&](auto i) { size += abs(h.by_state[i]) * (1.0 / f_.inverse_scale(i)); });
  State ahead = x;
  const P span = 1e-6 * size / (abs(fall) + P(1e-300));
  for_each_index(f_.states, [&](auto i) { ahead[i] += span * rate[i]; });
  State rate_ahead = rate;
  rates(ahead, before, rate_ahead);
  const P bend = abs(growth(f_.jump(m, ahead), rate_ahead) - fall) / span;
  if (const Mask there = rests & jumps; any(there)) note_balance(h, there, after, span, fall);
  in_time(-time, after);
  return goes_through & jumps & !leaves_rest & !(fall * fall > graze * tolerance_ * size * bend);
}

// Of lanes that have come to rest on a jump, which led onto it by `fall`: whether that hangs on theta, as where a force is just
// what friction bears. They then move on for some theta and do not for others. `span`: a moment, after which it may be lost
// anyway.
template <class M, class P, class Method>
void Tangents<M, P, Method>::note_balance(const JumpGradient<M, P>& h, const Mask& lanes, const Side& after, const P& span,
                                          const P& fall) {
  see_slides(after);
  State rate, ahead, column;
  fit_all_two(rate, ahead);
  fit(column, f_.states);
  linearise_briefly(x, after, P(1.0), rate, 0);
  for_each_index(f_.states, [&](auto i) { ahead[i] = x[i] + span * rate[i]; });
  rates(ahead, after, column);
  P change(0.0);
  for_each_index(f_.states, [&](auto i) { change += h.by_state[i] * (column[i] - rate[i]); });
  const Mask lasts = lanes & (abs(change) <= alike_rates * abs(fall));
  if (!any(lasts)) return;
  for_each_index(f_.parameters, [&](auto j) {
    if (f_.dependence.leader(j) != j) return;
    for (int k = j; k < f_.parameters; k = f_.dependence.next_alike(k)) {
      const auto rows = f_.dependence.rows(j);
      const P* const own = &s[f_.dependence.column_start[k]];
      for_each_variable(rows, [&](auto i) { column[i] = own[detail::below(rows, i)]; });
      column_rate(j, k, 0, column, rate);
      P sum(0.0);
      for_each_variable(rows, [&](auto i) { sum += h.by_state[i] * rate[i]; });
      const P size = select(abs(f_.theta()[k]) > P(0.0), abs(f_.theta()[k]), P(1.0));
      hangs_on_balance_ = hangs_on_balance_ | (lasts & (abs(sum) * size > hanging * abs(fall)));
    }
  });
}

// By the midpoint rule, for a time so short that the error of a jump's place is all that is left of the trajectory.
template <class M, class P, class Method>
void Tangents<M, P, Method>::advance_briefly(const P& time, const Side& side) {
  see_slides(side);
  State rate, middle;
  fit_all_two(rate, middle);
  linearise_briefly(x, side, time, rate, 0);
  for_each_index(f_.states, [&](auto i) { middle[i] = x[i] + 0.5 * rate[i]; });
  linearise_briefly(middle, side, time, rate, 1);
  for_each_index(f_.states, [&](auto i) { x[i] += rate[i]; });
  for_each_index(f_.parameters, [&](auto j) {
    if (f_.dependence.leader(j) != j) return;
    for (int k = j; k < f_.parameters; k = f_.dependence.next_alike(k)) {
      const auto rows = f_.dependence.rows(j);
      P* const column = &s[f_.dependence.column_start[k]];
      for_each_variable(rows, [&](auto i) { middle[i] = column[detail::below(rows, i)]; });
      column_rate(j, k, 0, middle, rate);
      for_each_variable(rows, [&](auto i) { middle[i] += 0.5 * rate[i]; });
      column_rate(j, k, 1, middle, rate);
      for_each_variable(rows, [&](auto i) { column[detail::below(rows, i)] += rate[i]; });
    }
  });
}

template <class M, class P, class Method>
mask_of_lanes<P> Tangents<M, P, Method>::differs(Tangents& other, double share) const {
  auto found = lanes_of<P>::none();
  for (int j = 0; j < f_.parameters; ++j) {
    const int start = f_.dependence.column_start[j];
    P size(0.0);
    for_each_row(
        j, [&](int i, int at) { size = max(size, max(abs(s[start + at]), abs(other.s[start + at])) * f_.inverse_scale(i)); });
    for_each_row(j, [&](int i, int at) {
      const auto alike = abs(s[start + at] - other.s[start + at]) * f_.inverse_scale(i) <= share * size;
      other.s[start + at] = select(alike, s[start + at], other.s[start + at]);
      found = found | !alike;
    });
  }
  return found;
}

}  // namespace fisherpoint
