// Rest on a surface: members of Integrator (integrator.hpp, which includes it at its end). Behind a surface f may lead nowhere
// across it, as where an amount is used up, a flow has stopped or a state is saturated. The trajectory then lies on the
// surface, to rounding, and goes on by f of the side that it has entered, until something else moves it again.
#pragma once

#include "fisherpoint/integration/sliding.hpp"
#include "fisherpoint/integration/step_control.hpp"

namespace fisherpoint {

// Where such a rate of surface m would move a trajectory by no more than rounding, all the time.
template <class Equation, class Method>
auto Integrator<Equation, Method>::moves_none(auto m, const P& rate, const State& y) const -> Mask {
  const Mask slow = abs(rate) * span_ <= P(1e-6);  // what moves at all moves further than this
  if (!any(slow)) return slow;
  return slow & (abs(rate) * span_ <= on_surface * natural_height(f_, m, y));
}

// Where a trajectory starts at limit m, where f has a value, and goes inside or stays.
template <class Equation, class Method>
auto Integrator<Equation, Method>::starts_at(auto m, const State& y) const -> Mask {
  return (abs(value_[m]) <= on_surface * natural_height(f_, m, y)) & ((rate_[m] > P(0.0)) | moves_none(m, rate_[m], y));
}

// Where a step ends so near to surface m that it does not matter on which side, and would soon be there. A flow that stops
// slowly tends to it like a parabola, of which steps beyond find no zero.
template <class Equation, class Method>
auto Integrator<Equation, Method>::is_met(auto m) const -> Mask {
  return (abs(end_value_[m]) <= abs(end_rate_[m]) * (brink * span_)) &
         (abs(end_value_[m]) <= briefest * tolerance_.relative * natural_height(f_, m, end_));
}

// Where f leads back from surface m to the side from which these lanes have come: a flow was about to stop, and goes on.
template <class Equation, class Method>
auto Integrator<Equation, Method>::goes_back(auto m, const Mask& lanes, const State& y) const -> Mask {
  State rates;
  fit(rates, f_.states);
  derivative(y, rates);
  return lanes & (side_[m] * f_.surface_rates(y, rates)[m] > P(0.0));
}

// Which of these lanes, that have just started or turned, rest on surfaces: their height is rounding and counts as zero. Lanes
// that something moves off a jump from now on, back to where they came from, pass it.
template <class Equation, class Method>
void Integrator<Equation, Method>::note_rests(const Mask& lanes, const State& y) {
  any_rest_ = false;
  Mask moved = Lanes::none();
  for_each_index(Count<0>{}, f_.kinks_end, [&](auto m) {
    if (m >= f_.jumps_end ? !f_.dependence.steep(m) : !crosses(m)) return;
    Mask here = lanes & running_;
    if (m < f_.holds_end) here = here & !slides(side_[m]);
    const Mask was = resting_[m];
    here = here & (abs(rate_[m]) * span_ <= P(1e-6)) & (was | landed_[m] | (abs(value_[m]) <= P(1e-6)));
    if (any(here)) {
      const P height = on_surface * natural_height(f_, m, y);
      here = here & (abs(value_[m]) <= height) & (abs(rate_[m]) * span_ <= height);
    }
    resting_[m] = here | (was & !lanes);
    value_[m] = select(here | (lanes & was), P(0.0), value_[m]);
    rate_[m] = select(here, P(0.0), rate_[m]);
    any_rest_ = any_rest_ || any(resting_[m] & running_);
    if (m >= f_.jumps_end) return;
    const Mask back = lanes & running_ & was & !here & (side_[m] * rate_[m] < P(0.0));
    if (any(back)) pass_jump(m, back, y);
    moved = moved | back;
  });
  if (any(moved)) start_anew(moved & running_, y, span_);
}

// Of a step's middle and end: where it still rests, rounding counts as zero.
template <class Equation, class Method>
void Integrator<Equation, Method>::keep_resting(Surfaces& middle_value) {
  for_each_index(Count<0>{}, f_.kinks_end, [&](auto m) {
    if (!any(resting_[m] & running_)) return;
    const P height = on_surface * natural_height(f_, m, end_);
    const Mask still =
        resting_[m] & (abs(middle_value[m]) <= height) & (abs(end_value_[m]) <= height) & (abs(end_rate_[m]) * span_ <= height);
    middle_value[m] = select(still, P(0.0), middle_value[m]);
    end_value_[m] = select(still, P(0.0), end_value_[m]);
    end_rate_[m] = select(still, P(0.0), end_rate_[m]);
  });
}

template <class Equation, class Method>
auto Integrator<Equation, Method>::rests_along(auto m) const -> Mask {
  const Quartic<P>& h = along_[m];
  return !(max(max(abs(h.b1), abs(h.b2)), max(abs(h.b3), abs(h.b4))) > P(0.0));
}

// Lanes that something moves off their rest on jump m, back to where they came from: what f does on both sides a little later
// tells whether they go there, or slide.
template <class Equation, class Method>
void Integrator<Equation, Method>::depart(auto m, const Mask& lanes, const State& y) {
  if (!any(lanes)) return;
  if (f_.resets > 0) {  // a mass on its stop that is pushed into it is set anew for ever; else it has no time of its own
    const Mask anew = sets_anew(m, lanes, y);
    stop(sets_anew(m, lanes, end_) & !anew, Status::chatters);
    stop(anew, Status::grazes_jump);
  }
  const P side = side_[m];
  State rates;
  fit(rates, f_.states);
  Side tried = side_;
  tried[m] = select(lanes, P(0.0) - side, side);
  f_.derivative(end_, beside<P>(f_, tried, 1.0), rates);
  const P behind = side * f_.surface_rates(end_, rates)[m];
  side_[m] = select(lanes, select(behind > P(0.0), P(0.0), P(0.0) - side), side);
  resting_[m] = resting_[m] & !lanes;
  leaving_[m] = leaving_[m] | lanes;
  turns_ += select(lanes, P(1.0), P(0.0));
  start_anew(lanes, y, span_);
  if (f_.resets > 0) end_turn(lanes, y);
}

template <class Equation, class Method>
void Integrator<Equation, Method>::end_rests(const Mask& taken) {
  any_rest_ = false;
  for_each_index(Count<0>{}, f_.kinks_end, [&](auto m) {
    resting_[m] = resting_[m] & (!taken | rests_along(m));
    any_rest_ = any_rest_ || any(resting_[m] & running_);
  });
}

}  // namespace fisherpoint
