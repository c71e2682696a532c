// How the stepping loop begins: members of Integrator (integrator.hpp, which includes it at its end). On which sides a
// trajectory starts, and how long its first step is.
#pragma once

#include "fisherpoint/integration/status.hpp"
#include "fisherpoint/integration/step_control.hpp"

namespace fisherpoint {

template <class Equation, class Method>
void Integrator<Equation, Method>::begin(State& y, const P& duration, const P& first_step) {
  outcome_ = {};
  running_ = duration > P(0.0);
  time_ = P(0.0);
  cap_ = wished_ = P(infinity);
  rejected_ = broken_ = behind_kink_ = Lanes::none();
  landed_.fill(Lanes::none());
  leaving_.fill(Lanes::none());
  resting_.fill(Lanes::none());
  any_rest_ = false;
  span_ = duration;
  slide_ = several_ = false;
  several_landed_ = Lanes::none();
  turns_ = P(0.0);
  if (f_.resets > 0) {
    reset_on_ = P(-1.0);
    quick_ = shorter_ = P(0.0);
    last_reset_ = P(-infinity);
    interval_ = P(infinity);
  }
  implicit_ = Lanes::none();
  stiff_signs_ = others_ = P(0.0);
  if (implicit_step_) implicit_step_->forget(!Lanes::none());
  if (f_.dependence.any_closed()) take_onto_limits(f_, running_, y);
  value_ = f_.surface_values(y);
  // A start on a kink belongs to the side that it moves to; the sign of its rate needs some side first.
  for_each_index(f_.sides, [&](auto m) { side_[m] = select(value_[m] < P(0.0), P(-1.0), P(1.0)); });
  if (f_.jumps_end > 0 && from_) {
    come_from(y);
    derivative(y, stage_[0]);
  } else {
    f_.derivative(y, side_, stage_[0]);
  }
  rate_ = f_.surface_rates(y, stage_[0], side_);
  Mask outside = Lanes::none(), on_jump = Lanes::none();
  const auto on_it = [&](int m) { return !((value_[m] < P(0.0)) | (value_[m] > P(0.0))); };
  if (f_.jumps_end > 0 && starts_next_to_jump(duration)) start_on_jumps(y, duration);
  if (f_.jumps_end > 0 && from_) go_on(y, duration);
  if (f_.resets > 0) start_resets(y, duration);
  for_each_index(Count<0>{}, f_.jumps_end, [&](auto m) {
    if (!crosses(m)) on_jump = on_jump | on_it(m);
  });
  if (f_.dependence.any_steep())  // a root of rounding is none
    for_each_index(f_.jumps_end, f_.kinks_end, [&](auto m) {
      if (!f_.dependence.steep(m)) return;
      value_[m] = select(abs(value_[m]) <= on_surface * natural_height(f_, m, y), P(0.0), value_[m]);
    });
  Mask on_kink = Lanes::none();
  for_each_index(f_.jumps_end, f_.kinks_end, [&](auto m) { on_kink = on_kink | on_it(m); });
  if (any(on_kink)) {
    const Surfaces past = rates_past(y, min(starting_step(y), duration));
    for_each_index(f_.surfaces, [&](auto m) { rate_[m] = select(on_kink, past[m], rate_[m]); });
  }
  for_each_index(f_.jumps_end, f_.kinks_end,
                 [&](auto m) { side_[m] = select(on_it(m) & (rate_[m] < P(0.0)), P(-1.0), side_[m]); });
  leave_roots(y, duration);
  if (f_.jumps_end > 0 || f_.dependence.any_steep()) note_rests(running_, y);
  if (f_.sided_limits) enter_branches(running_, y);
  for_each_index(f_.kinks_end, f_.sides, [&](auto m) { outside = outside | on_it(m); });
  for_each_index(f_.sides, f_.surfaces, [&](auto m) {
    Mask here = !(value_[m] > P(0.0));
    if (f_.dependence.closed(m) && any(here)) {
      const Mask starts = here & starts_at(m, y);
      here = here & !starts;
      value_[m] = select(starts, P(0.0), value_[m]);
    }
    outside = outside | here;
  });
  stop(running_ & outside, Status::left_domain);
  stop(running_ & on_jump, Status::met_jump);
  if (f_.resets > 0) end_turn(running_, y);
  step_size_ = f_.states == 0 ? duration : min(select(first_step > P(0.0), first_step, starting_step(y)), duration);
  first_try_ = step_size_;
}

// Limits that rise like a root from where it starts, as k + x^0.6 at x = 0, have no rate there: they get that of a moment
// later.
template <class Equation, class Method>
void Integrator<Equation, Method>::leave_roots(const State& y, const P& duration) {
  Mask lost = Lanes::none();
  for_each_index(f_.kinks_end, f_.surfaces, [&](auto m) { lost = lost | !(abs(rate_[m]) < P(infinity)); });
  if (!any(lost & running_)) return;
  const Surfaces past = rates_past(y, min(starting_step(y), duration));
  for_each_index(f_.kinks_end, f_.surfaces, [&](auto m) {
    const Mask here = !(abs(rate_[m]) < P(infinity));
    rate_[m] = select(here, select(abs(past[m]) < P(infinity), past[m], P(0.0)), rate_[m]);
  });
}

// The starting step of Hairer, Norsett, Wanner, section II.4, from the states alone. States that start at zero, or next to
// it, are taken as a thousandth of their scales.
template <class Equation, class Method>
auto Integrator<Equation, Method>::starting_step(const State& y) -> P {
  const P size = squared_weight() * max(f_.squared_size(y), P(1e-6)), slope = squared_weight() * f_.squared_size(stage_[0]);
  const P probe = 0.01 * sqrt(size / (slope + 1e-300));
  State ahead = y, change;
  fit(change, f_.states);
  for_each_index(f_.states, [&](auto i) { ahead[i] += probe * stage_[0][i]; });
  derivative(ahead, change);
  for_each_index(f_.states, [&](auto i) { change[i] -= stage_[0][i]; });
  const P bend = squared_weight() * f_.squared_size(change) / (probe * probe + 1e-300);
  // The formula does not know the unit of time: in fast models it is many time constants, at one of which the error's
  // estimate vanishes.
  const P constant = most_constants * sqrt(slope / (bend + 1e-300));
  // These are squares. Small models square them once more, for a first step that is shorter than the book's.
  const P fastest = max(slope, bend);
  const P step = min(constant, method_.inverse_root(1e4 * fastest * (f_.order() ? P(1.0) : fastest) + 1e-300));
  return select(step > P(0.0), min((f_.order() ? most_probes_with_order : most_probes) * probe, step), probe);
}

}  // namespace fisherpoint
