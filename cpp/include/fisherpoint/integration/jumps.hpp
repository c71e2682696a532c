// What the stepping loop does at jumps: members of Integrator (integrator.hpp), which come here where a trajectory starts on a
// jump, ends a step on one, or slides along one. integrator.hpp includes it, at its end.
#pragma once

#include "fisherpoint/integration/sliding.hpp"
#include "fisherpoint/integration/step_control.hpp"

namespace fisherpoint {

template <class Equation, class Method>
void Integrator<Equation, Method>::slide(const State& x, const Side& side, State& dx) const {
  const auto several = several_ ? several_slides<P>(f_, side) : Lanes::none();
  const auto on = any_slides<P>(f_, side) & !several;
  const BothSides<Equation> at(f_, x, side);
  for_each_index(f_.states, [&](auto i) { dx[i] = select(on, at.sliding(i), dx[i]); });
  if (!any(several)) return;
  const SeveralSlides<Equation> on_all(f_, x, side, several);
  for_each_index(f_.states, [&](auto i) { dx[i] = select(several, on_all.rate[i], dx[i]); });
}

// Whether any lane slides, and any on several jumps.
template <class Equation, class Method>
void Integrator<Equation, Method>::see_slides() {
  slide_ = any(any_slides<P>(f_, side_) & running_);
  several_ = slide_ && f_.holds_end > 1 && any(several_slides<P>(f_, side_) & running_);
}

template <class Equation, class Method>
auto Integrator<Equation, Method>::sides_from(State y, const P& duration, const Side& from, const Side& met, Mask& stopped,
                                              State* start) -> Side {
  from_ = &from;
  met_ = &met;
  begin(y, duration, duration);
  if (start) *start = y;
  stopped = (duration > P(0.0)) & !running_;
  return side_;
}

template <class Equation, class Method>
bool Integrator<Equation, Method>::starts_next_to_jump(const P& duration) const {
  Mask next = Lanes::none();
  for_each_index(Count<0>{}, f_.jumps_end, [&](auto m) {
    if (crosses(m)) next = next | (abs(value_[m]) <= 1e-9 * duration * abs(rate_[m]));
  });
  return any(next & running_);
}

// A start on a jump belongs to the side that f leads to, or slides; where f leads away on both sides there are two
// trajectories.
template <class Equation, class Method>
void Integrator<Equation, Method>::start_on_jumps(const State& y, const P& duration) {
  Mask on = Lanes::none(), several = on;
  if (f_.jumps_end > 1) {
    auto met = landed_;
    for_each_index(Count<0>{}, f_.jumps_end, [&](auto m) {
      met[m] = Lanes::none();
      if (crosses(m)) met[m] = running_ & !landed_[m] & (abs(value_[m]) <= on_surface * natural_height(f_, m, y));
      value_[m] = select(met[m], P(0.0), value_[m]);
    });
    several = on_several(met) & running_;
    if (any(several)) settle_sides(several, met, y, duration, Status::on_jump, true);
    on = several;
  }
  for_each_index(Count<0>{}, f_.jumps_end, [&](auto m) {
    if (!crosses(m)) return;
    const Mask here = running_ & !several & !landed_[m] & (abs(value_[m]) <= on_surface * natural_height(f_, m, y));
    if (!any(here)) return;
    on = on | here;
    Side held = side_;
    held[m] = select(here, P(0.0), side_[m]);
    const BothSides<Equation> at(f_, y, held);
    const Balance even = balance(m, here, at.r_plus, at.r_minus, y);
    const Mask up = here & !even.lanes & (at.r_plus > P(0.0)) & (at.r_minus > P(0.0)),
               down = here & !even.lanes & (at.r_plus < P(0.0)) & (at.r_minus < P(0.0)),
               along = (here & !even.lanes & at.holds()) | even.holds;
    const Mask smooth = at.alike(f_) & here, stays = smooth & !(up | down | even.lanes | along);
    side_[m] = select(even.lanes & !even.holds, even.side, side_[m]);
    side_[m] = select(up, P(1.0), select(down, P(-1.0), select(along, P(0.0), side_[m])));
    if (any(stays)) side_[m] = select(stays, side_past(m, y, duration), side_[m]);
    leaving_[m] = leaving_[m] | stays | even.holds | even.lets_go;
    value_[m] = select(here, P(0.0), value_[m]);
    stop(here & !(up | down | even.lanes | along | stays), Status::on_jump);
    outcome_.starts_on_jump = outcome_.starts_on_jump | (here & !along & !even.lets_go & !smooth);
  });
  start_anew(on, y, duration);
}

// To which side of jump m, at which f does not jump now, a trajectory goes that lies on it and does not move across it at
// first.
template <class Equation, class Method>
auto Integrator<Equation, Method>::side_past(auto m, const State& y, const P& duration) -> P {
  State past = y, rates;
  fit(rates, f_.states);
  const P by = glance * duration;
  for_each_index(f_.states, [&](auto i) { past[i] += by * stage_[0][i]; });
  f_.derivative(past, beside<P>(f_, side_, 1.0), rates);
  return select(f_.surface_rates(past, rates)[m] < P(0.0), P(-1.0), P(1.0));
}

// What a step starts with, on the sides on which these lanes are now.
template <class Equation, class Method>
void Integrator<Equation, Method>::start_anew(const Mask& lanes, const State& y, const P& duration) {
  see_slides();
  State fresh;
  fit(fresh, f_.states);
  derivative(y, fresh);
  for_each_index(f_.states, [&](auto i) { stage_[0][i] = select(lanes, fresh[i], stage_[0][i]); });
  const Surfaces rate = f_.surface_rates(y, stage_[0], side_);
  for_each_index(f_.surfaces, [&](auto m) { rate_[m] = select(lanes, rate[m], rate_[m]); });
  if (slide_) watch_hold(lanes, y, 1e-5 * duration);
}

// A trajectory that goes on is on the side of each jump from which it comes. Where it is next to the jump, or rounding and the
// tolerance have put it on the other side, the sign of h does not tell: what has been met, and what is still to be met, does.
template <class Equation, class Method>
void Integrator<Equation, Method>::come_from(const State& y) {
  for_each_index(Count<0>{}, f_.jumps_end, [&](auto m) {
    const P& came = (*from_)[m];
    const Mask known = running_ & (abs(came) < P(0.5 * (1.0 + unknown_side)));
    if (!crosses(m)) return stop(known & !(came * value_[m] > P(0.0)), Status::met_jump);
    if (!any(known)) return;
    landed_[m] = known & ((abs(value_[m]) <= on_surface * natural_height(f_, m, y)) | !(came * value_[m] > P(0.0)));
    if (met_) landed_[m] = landed_[m] | (known & ((*met_)[m] > P(0.5)));
    side_[m] = select(landed_[m], came, side_[m]);
  });
  see_slides();
}

// Of those next to a jump: where f leads onto it, it is met now, as it would be behind a step that had ended there. A slide
// goes on as long as f holds it.
template <class Equation, class Method>
void Integrator<Equation, Method>::go_on(const State& y, const P& duration) {
  Mask next_to = Lanes::none();
  for_each_index(Count<0>{}, f_.jumps_end, [&](auto m) {
    Mask comes = landed_[m] & running_ & !slides(side_[m]) & (side_[m] * rate_[m] < P(0.0));
    if (any(comes)) comes = comes & !moves_none(m, rate_[m], y);
    next_to = next_to | landed_[m];
    value_[m] = select(landed_[m], P(0.0), value_[m]);
    landed_[m] = comes;
  });
  if (!any(next_to)) return;
  Mask several = f_.jumps_end > 1 ? on_several(landed_) & running_ : Lanes::none(), at_once = Lanes::none();
  if (f_.resets > 0 && any(several)) several = several & !one_sets_anew(several, landed_, y, at_once);
  if (any(several)) settle_sides(several, landed_, y, duration, Status::two_jumps);
  for_each_index(Count<0>{}, f_.jumps_end, [&](auto m) {
    const Mask comes = landed_[m] & running_ & !several;
    if (any(comes)) pass_jump(m, comes, y);
    if (f_.resets > 0) reset_on_ = select(landed_[m] & running_, P(double(m)), reset_on_);
    landed_[m] = Lanes::none();
  });
  if (f_.resets > 0) stop(anew_on_sides(at_once, y, side_), Status::two_jumps);
  see_slides();
  if (slide_) check_slides(next_to & running_, y, duration, Status::on_jump);
  start_anew(next_to, y, duration);
}

// How fast what holds a slide changes, by a central difference along the trajectory.
template <class Equation, class Method>
auto Integrator<Equation, Method>::hold_rate(const State& x, const State& rates, const P& span, const Side& side) const -> P {
  State before = x, after = x;
  const P by = hold_span * span;
  for_each_index(f_.states, [&](auto i) {
    before[i] -= by * rates[i];
    after[i] += by * rates[i];
  });
  return (BothSides<Equation>(f_, after, side).hold() - BothSides<Equation>(f_, before, side).hold()) / (2.0 * by);
}

// Of a step's end on a slide: back onto the surface, off which rounding and the step's error have brought it. What is watched
// is not h, which is zero, but what holds the trajectory there.
template <class Equation, class Method>
void Integrator<Equation, Method>::hold(const State& middle, Surfaces& middle_value) {
  const Mask several = several_ ? several_slides<P>(f_, side_) & running_ : Lanes::none();
  if (any(several)) hold_several(several, middle, middle_value);
  const BothSides<Equation> at(f_, end_, side_), half(f_, middle, side_);
  const P rate = hold_rate(end_, stage_[last()], step_, side_);
  for_each_index(Count<0>{}, f_.holds_end, [&](auto m) {
    const Mask on = slides(side_[m]) & !several;
    const P back = select(on & at.holds(), end_value_[m] / (at.r_plus - at.r_minus), P(0.0));
    for_each_index(f_.states, [&](auto i) { end_[i] -= back * (at.plus[i] - at.minus[i]); });
    middle_value[m] = select(on, half.hold(), middle_value[m]);
    end_value_[m] = select(on, at.hold(), end_value_[m]);
    end_rate_[m] = select(on, rate, end_rate_[m]);
  });
  const Mask slid = any_slides<P>(f_, side_) & !several;
  for_each_index(f_.jumps_end, f_.kinks_end, [&](auto m) {
    const Mask along =
        slid & !slides(side_[m]) & at.coincides(m, end_value_[m], end_rate_[m], step_, [&] { return noise_of(m, end_); });
    for (P* const number : {&value_[m], &rate_[m], &middle_value[m], &end_value_[m], &end_rate_[m]})
      *number = select(along, P(0.0), *number);
  });
}

// Lanes that have just left a slide on which a kink lies too: they belong to the side of the kink to which they go, whatever
// rounding makes of its value now.
template <class Equation, class Method>
void Integrator<Equation, Method>::leave_with_kinks(const Mask& lanes, const Side& held, const State& y) {
  const BothSides<Equation> at(f_, y, held);
  for_each_index(f_.jumps_end, f_.kinks_end, [&](auto m) {
    const P part = abs(at.up[m]) + abs(at.down[m]);
    const Mask along = lanes & (abs(rate_[m]) <= 1e-5 * part) & (abs(value_[m]) <= 1e-9 * part * step_ + noise_of(m, y));
    value_[m] = select(along, P(0.0), value_[m]);
    rate_[m] = select(along, P(0.0), rate_[m]);
  });
}

// Of the start of a step on a slide, in these lanes.
template <class Equation, class Method>
void Integrator<Equation, Method>::watch_hold(const Mask& lanes, const State& y, const P& span) {
  const Mask several = several_ ? several_slides<P>(f_, side_) & lanes : Lanes::none();
  if (any(several)) watch_several(several, y, span);
  const BothSides<Equation> at(f_, y, side_);
  const P rate = hold_rate(y, stage_[0], span, side_);
  for_each_index(Count<0>{}, f_.holds_end, [&](auto m) {
    const Mask on = lanes & slides(side_[m]) & !several;
    value_[m] = select(on, select(leaving_[m], max(at.hold(), P(0.0)), at.hold()), value_[m]);
    rate_[m] = select(on, rate, rate_[m]);
  });
}

// A step may end next to several surfaces, one of them a jump. The first is landed on with all that are met in the same
// instant, the others are met from there. Returns the lanes that are past the first one and have to try the step again: only an
// end that is on it shows what is met at once. What ends before it goes there by its next step.
template <class Equation, class Method>
auto Integrator<Equation, Method>::land_on_first(const Mask& lanes, const P& duration, P& next_cap) -> Mask {
  Mask by_jump = Lanes::none(), once = by_jump, twice = by_jump;
  P first(infinity);
  const auto when = [&](auto m) {
    const P newton = -end_value_[m] / end_rate_[m];
    return select(landed_[m] & lanes, select(abs(newton) < P(infinity), newton, P(0.0)), P(infinity));
  };
  for_each_index(Count<0>{}, f_.jumps_end, [&](auto m) { by_jump = by_jump | (landed_[m] & lanes); });
  for_each_index(Count<0>{}, f_.kinks_end, [&](auto m) {
    twice = twice | (once & landed_[m]);
    once = once | (landed_[m] & lanes);
    first = min(first, when(m));
  });
  several_landed_ = by_jump & twice;
  if (!any(several_landed_)) return Lanes::none();
  const P at_once = same_instant * step_ + 1e-12 * duration;
  const Mask before = several_landed_ & (first > at_once), past = several_landed_ & (first < -at_once) & (step_ > at_once);
  next_cap = select(past, min(next_cap, step_ + first), select(before, first, next_cap));
  for_each_index(Count<0>{}, f_.kinks_end, [&](auto m) {
    const P time = when(m);
    landed_[m] = landed_[m] & !before & !(several_landed_ & (time > first + at_once));
  });
  several_landed_ = several_landed_ & !before;
  return past;
}

// Lanes that have landed on jump m go through it, or slide along it; lanes that slid on it leave by the side that opens.
template <class Equation, class Method>
void Integrator<Equation, Method>::pass_jump(auto m, const Mask& lanes, const State& y) {
  const P zero(0.0), side = side_[m];
  const Mask leaves = lanes & slides(side), arrives = lanes & !slides(side);
  P rate[2];  // of h on the sides 1 and -1
  Side tried = side_;
  State rates;
  fit(rates, f_.states);
  for (const int which : {0, 1}) {
    tried[m] = select(lanes, P(1.0 - 2.0 * which), side);
    derivative(y, tried, rates);
    rate[which] = f_.surface_rates(y, rates)[m];
  }
  const P before = side * select(side > zero, rate[0], rate[1]), behind = side * select(side > zero, rate[1], rate[0]);
  const Mask comes = arrives & (before < zero);
  const Balance even = balance(m, comes, rate[0], rate[1], y);
  Mask held = (comes & (behind > zero) & !even.lanes) | even.holds, through = comes & !held & ((behind < zero) | even.lanes);
  if (f_.resets > 0) {  // which are at once, whatever f is behind
    const Mask anew = sets_anew(m, comes, y);
    through = through | anew;
    held = held & !anew;
  }
  stop(arrives & !(through | held), Status::grazes_jump);
  side_[m] = select(through, -side, select(held, zero, side));
  side_[m] = select(leaves, select(abs(rate[0]) < abs(rate[1]), P(1.0), P(-1.0)), side_[m]);
  leaving_[m] = leaving_[m] | leaves | (even.holds & held) | (even.lets_go & through);
  turns_ += select(lanes, P(1.0), zero);
  see_slides();
}

// Behind a jump, what another slide is held by may be gone.
template <class Equation, class Method>
void Integrator<Equation, Method>::check_slides(const Mask& lanes, const State& y, const P& span, Status otherwise) {
  const Mask several = several_ ? lanes & several_slides<P>(f_, side_) : Lanes::none(), one = lanes & !several;
  if (any(several)) {
    auto none = landed_;
    none.fill(Lanes::none());
    settle_sides(several, none, y, span, otherwise);
  }
  const BothSides<Equation> at(f_, y, side_);
  Mask lost = one & any_slides<P>(f_, side_) & !at.holds();
  for_each_index(Count<0>{}, f_.jumps_end, [&](auto m) {
    const Mask here = one & slides(side_[m]);
    if (!any(here)) return;
    const Balance even = balance(m, here, at.r_plus, at.r_minus, y);
    lost = lost & !even.lanes;
    side_[m] = select(even.lanes & !even.holds, even.side, side_[m]);
    leaving_[m] = leaving_[m] | even.holds | even.lets_go;
    if (otherwise == Status::on_jump)
      outcome_.starts_on_jump = outcome_.starts_on_jump | (even.lanes & !even.holds & !even.lets_go);
  });
  const Mask up = (at.r_plus > P(0.0)) & (at.r_minus > P(0.0)), down = (at.r_plus < P(0.0)) & (at.r_minus < P(0.0));
  for_each_index(Count<0>{}, f_.holds_end, [&](auto m) {
    const Mask here = lost & slides(side_[m]);
    side_[m] = select(here & up, P(1.0), select(here & down, P(-1.0), side_[m]));
  });
  stop(lost & !(up | down), otherwise);
  see_slides();
}

// Where a trajectory turns back so near to a jump that the tolerance cannot tell whether it has crossed it.
template <class Equation, class Method>
void Integrator<Equation, Method>::stop_grazing(auto m, const Mask& lanes, const State& y) {
  const Quartic<P>& h = along_[m];
  const P nearest = min(min(h.b0, h.b4), h.least_inside());
  Mask grazes = lanes & running_ & !slides(side_[m]) & (nearest <= tolerance_.relative * natural_height(f_, m, y));
  if (!any(grazes)) return;
  Side held = side_;
  held[m] = select(grazes, P(0.0), side_[m]);
  stop(grazes & !BothSides<Equation>(f_, end_, held).alike(f_), Status::grazes_jump);
}

// Next to a jump at its end a trajectory may have crossed it or not. A piece of a trajectory that was integrated before may
// have ended elsewhere, as far as the tolerance allows.
template <class Equation, class Method>
void Integrator<Equation, Method>::note_end(const P& duration, const State& y) {
  const P time = next_to_jump * tolerance_.relative * duration;
  for_each_index(Count<0>{}, f_.jumps_end, [&](auto m) {
    if (!f_.dependence.switching_depends(m)) return;
    P height = time * abs(rate_[m]);
    if (tolerance_.whole_first) height = max(height, 2.0 * tolerance_.relative * natural_height(f_, m, y));
    outcome_.ends_on_jump = outcome_.ends_on_jump | (!slides(side_[m]) & !resting_[m] & (abs(value_[m]) <= height));
  });
}

}  // namespace fisherpoint
