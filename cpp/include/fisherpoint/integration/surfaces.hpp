// How the stepping loop looks along surfaces, lands on them and turns their sides: members of Integrator (integrator.hpp, at
// whose end it is included), for kinks and jumps alike; jumps.hpp has what jumps need besides.
#pragma once

#include "fisherpoint/integration/step_control.hpp"

namespace fisherpoint {

// Moves the ends of steps that landed next to a kink onto it, along the slope there: an error of the second order.
template <class Equation, class Method>
void Integrator<Equation, Method>::settle(const Mask& taken) {
  for_each_index(Count<0>{}, f_.kinks_end, [&](auto m) {
    const P slope = -end_value_[m] / end_rate_[m];
    // Where another surface takes hold, the rate at the end is not that of the step: there it is the chord's zero.
    const P chord = step_ * min(along_[m].b4, P(0.0)) / max(along_[m].b0 - along_[m].b4, P(1e-300));
    const P newton = select(slope < P(0.0) - step_, chord, slope);
    Mask known = abs(newton) <= 0.5 * step_;  // none at a rate next to zero
    if (f_.dependence.steep(m)) {
      known = known | (abs(newton) <= brink * span_);
      // What balances a root there gets nearer ever more slowly.
      if (any(landed_[m] & taken)) known = known & !(abs(end_value_[m]) <= hold_height * natural_height(f_, m, end_));
    }
    const P rest = select(landed_[m] & taken & known, newton, P(0.0));
    for_each_index(f_.states, [&](auto i) { end_[i] += rest * stage_[last()][i]; });
    step_ += rest;
    if (any(several_landed_)) {  // which has brought it nearer to the others too
      for_each_index(Count<0>{}, f_.kinks_end, [&](auto other) {
        const Mask here = several_landed_ & landed_[other] & taken;
        end_value_[other] = select(here, end_value_[other] + rest * end_rate_[other], end_value_[other]);
      });
    }
    ends_ = ends_ & !(rest < P(0.0));  // the trajectory goes on behind the kink
  });
}

// How far the surfaces' values on the way are off the quartics along the step: one that oscillates may be zero twice between
// the places that the quartic has seen.
template <class Equation, class Method>
void Integrator<Equation, Method>::look_beside(const Mask& lanes, const State& y, const State& middle) {
  static constexpr std::array places = {0.29, 0.74};
  State at;
  fit(at, f_.states);
  for (const double t : places) {
    const double r = 1.0 - t, bow = 16.0 * r * r * t * t;
    const double of_start = (1.0 + 2.0 * t) * r * r - 0.5 * bow, of_end = (3.0 - 2.0 * t) * t * t - 0.5 * bow;
    const double of_first = t * r * r - 0.125 * bow, of_last = 0.125 * bow - t * t * r;
    for_each_index(f_.states, [&](auto i) {
      at[i] = of_start * y[i] + of_end * end_[i] + step_ * (of_first * stage_[0][i] + of_last * stage_[last()][i]) +
              bow * middle[i];
    });
    const Surfaces value = f_.surface_values(at, side_);
    const auto see = [&](int m, const P& side) { beside_[m] = max(beside_[m], abs(side * value[m] - along_[m].at(t))); };
    for_each_index(f_.sides, [&](auto m) { see(m, side_[m]); });
    for_each_index(f_.sides, f_.surfaces, [&](auto m) { see(m, P(1.0)); });
  }
  for_each_index(f_.surfaces, [&](auto m) { beside_[m] = select(lanes, beside_[m], P(0.0)); });
  if (f_.holds_end > 0 && slide_)
    for_each_index(Count<0>{}, f_.holds_end, [&](auto m) { beside_[m] = select(slides(side_[m]), P(0.0), beside_[m]); });
  for_each_index(f_.surfaces, [&](auto m) {
    const bool unclear = any(lanes & !along_[m].clear(beside_[m]));
    (m < f_.kinks_end ? near_[m] : near_limit_) |= unclear;
  });
}

// Where a surface may lie, or was seen, far beside its quartic.
template <class Equation, class Method>
auto Integrator<Equation, Method>::poorly_seen() const -> Mask {
  Mask seen = Lanes::none();
  for_each_index(f_.surfaces, [&](auto m) { seen = seen | (max(beside_[m], along_[m].margin()) > 0.1 * along_[m].change()); });
  return seen;
}

// By which factor the distance to a surface grows over the step, or minus that by which it falls; 0 where it is none to speak
// of.
template <class Equation, class Method>
auto Integrator<Equation, Method>::growth_of_distance() const -> P {
  P growth(0.0);
  for_each_index(f_.jumps_end, f_.surfaces, [&](auto m) {
    if (!f_.dependence.rough(m) || !may_matter(m)) return;
    const Quartic<P>& h = along_[m];
    if (m < f_.holds_end && slide_ && any(slides(side_[m]))) return;  // of which it is what holds them
    const Mask away = (h.b0 > P(0.0)) & (h.b4 > smooth_growth * h.b0) & !behind_kink_;
    Mask towards = (h.b4 > P(0.0)) & (h.b0 > smooth_growth * h.b4);
    if (m < f_.kinks_end) towards = towards & !landed_[m];
    if (!any(away | towards)) return;
    const P grown = h.b4 / h.b0, fallen = h.b0 / h.b4;
    growth = select(away & (grown > abs(growth)), grown, growth);
    growth = select(towards & (fallen > abs(growth)), -fallen, growth);
  });
  return growth;
}

// Turns the sides of the surfaces that were landed on, and takes stage 1 anew; the other lanes keep theirs to the last bit.
template <class Equation, class Method>
void Integrator<Equation, Method>::turn(State& y, const Mask& taken, const P& duration) {
  Mask turned = Lanes::none();
  const Side came = side_;
  auto met = landed_;
  for_each_index(f_.jumps_end, f_.kinks_end, [&](auto m) {
    const Mask here = landed_[m] & taken & running_;
    turned = turned | here;
    if (m < f_.holds_end) {
      met[m] = any(here) ? meet_steep(m, here, y) : here;
    } else {
      side_[m] = select(here, -side_[m], side_[m]);
    }
  });
  const Side held = side_;
  Mask several = Lanes::none(), at_once = several;
  if (f_.holds_end > 1) {
    for_each_index(Count<0>{}, f_.jumps_end, [&](auto m) { met[m] = landed_[m] & taken & running_; });
    several = on_several(met);
    if (f_.resets > 0 && any(several)) several = several & !one_sets_anew(several, met, y, at_once);
    if (any(several)) settle_sides(several, met, y, step_, Status::two_jumps);
    turned = turned | several;
  }
  for_each_index(Count<0>{}, f_.jumps_end, [&](auto m) {
    const Mask here = landed_[m] & taken & running_ & !several;
    if (any(here)) pass_jump(m, here, y);
    turned = turned | here;
  });
  if (f_.holds_end > f_.jumps_end) {
    for_each_index(f_.jumps_end, f_.holds_end,
                   [&](auto m) { side_[m] = select(met[m] & running_ & !several, P(0.0), side_[m]); });
    see_slides();
  }
  Mask changed = Lanes::none();
  if (f_.resets > 0) {
    P surface(-1.0);
    for_each_index(Count<0>{}, f_.jumps_end, [&](auto m) { surface = select(landed_[m] & taken, P(double(m)), surface); });
    stop(anew_on_sides(at_once, y, side_), Status::two_jumps);
    changed = set_anew(turned, y, surface, duration);
  }
  if (f_.holds_end > 0 && slide_) check_slides(turned & running_, y, step_);
  for_each_index(f_.jumps_end, f_.holds_end, [&](auto m) {
    const Mask beside = turned & running_ & !changed & !slides(side_[m]) & (landed_[m] | slides(came[m]));
    if (any(beside)) place_beside(m, beside, y);
  });
  behind_kink_ = behind_kink_ | turned;
  if (implicit_step_) implicit_step_->forget(turned);
  State fresh;
  fit(fresh, f_.states);
  derivative(y, fresh);
  for_each_index(f_.states, [&](auto i) { stage_[0][i] = select(turned, fresh[i], stage_[0][i]); });
  const Surfaces value = f_.surface_values(y, side_), rate = rates_past(y, step_size_);
  for_each_index(f_.surfaces, [&](auto m) {
    value_[m] = select(turned, value[m], value_[m]);
    rate_[m] = select(turned, rate[m], rate_[m]);
  });
  if (f_.resets > 0) take_places(changed, y);
  if (f_.jumps_end > 0 && f_.kinks_end > f_.jumps_end) {
    Mask left = Lanes::none();
    for_each_index(Count<0>{}, f_.jumps_end,
                   [&](auto m) { left = left | (turned & !changed & slides(held[m]) & !slides(side_[m])); });
    if (any(left)) leave_with_kinks(left, held, y);
  }
  if (f_.jumps_end > 0 || f_.dependence.any_steep()) note_rests(turned, y);
  if (f_.sided_limits || any(changed)) enter_branches(f_.sided_limits ? turned : changed, y);
  if (f_.resets > 0) end_turn(turned, y);
  if (f_.holds_end > 0 && slide_) watch_hold(turned, y, step_);
}

// The rates of the surfaces just past a kink on which y lies, at the start of a step of about this size. On the kink itself one
// that reads what has the kink, as c max(s - a, 0) > 0 does, may have its rate from the side that is left.
template <class Equation, class Method>
auto Integrator<Equation, Method>::rates_past(const State& y, const P& step) const -> Surfaces {
  State past = y;
  for_each_index(f_.states, [&](auto i) { past[i] += glance * step * stage_[0][i]; });
  return f_.surface_rates(past, stage_[0], side_);
}

// Of a surface's value, the rounding of the states that it reads.
template <class Equation, class Method>
auto Integrator<Equation, Method>::noise_of(auto m, const State& y) const -> P {
  State one;
  fit(one, f_.states);
  one.fill(P(0.0));
  P size(0.0);
  for_each_index(f_.states, [&](auto i) {
    one[i] = y[i];
    size += abs(f_.surface_rates(y, one)[m]);
    one[i] = P(0.0);
  });
  return noise * size;
}

// Where a surface's value all along the step is nothing but rounding.
template <class Equation, class Method>
auto Integrator<Equation, Method>::drowned(auto m, const State& y) const -> Mask {
  const Quartic<P>& h = along_[m];
  return max(max(abs(h.b0), abs(h.b2)), abs(h.b4)) <= noise_of(m, y);
}

// Where a step that was to end on a surface ends as near to it as rounding lets it: no other step will end nearer.
template <class Equation, class Method>
auto Integrator<Equation, Method>::ends_in_noise(auto m, const State& y) const -> Mask {
  const Quartic<P>& h = along_[m];
  const Mask near = (abs(h.b4) <= 1e-2 * h.b0) & (h.b1 < h.b0);
  return any(near) ? near & (abs(h.b4) <= noise_of(m, y)) : near;
}

}  // namespace fisherpoint
