// How the stepping loop ends trajectories: members of Integrator (integrator.hpp), for limits of the domain, poles, jumps that
// are not crossed, and steps that get too small. integrator.hpp includes it, at its end.
#pragma once

#include "fisherpoint/integration/runge_kutta.hpp"
#include "fisherpoint/integration/step_control.hpp"

namespace fisherpoint {

// Where a stage of the step is past a pole.
template <class Equation, class Method>
auto Integrator<Equation, Method>::past_pole(const State& y) const -> Mask {
  Mask past = Lanes::none();
  State at;
  fit(at, f_.states);
  for_each_index(last(), [&](auto previous) {
    const auto s = after(previous);
    for_each_index(f_.states, [&](auto i) { at[i] = y[i] + step_ * weighted_sum(s, method_.a[s], stage_, i); });
    const Surfaces value = f_.surface_values(at, side_);
    for_each_index(f_.kinks_end, f_.sides, [&](auto m) { past = past | (!implicit_ & !(side_[m] * value[m] > P(0.0))); });
  });
  for (int r = 0; any(implicit_) && r + 1 < Radau::stages; ++r) {
    for_each_index(f_.states, [&](auto i) { at[i] = y[i] + implicit_step_->increment(r, i); });
    const Surfaces value = f_.surface_values(at, side_);
    for_each_index(f_.kinks_end, f_.sides, [&](auto m) { past = past | (implicit_ & !(side_[m] * value[m] > P(0.0))); });
  }
  return past;
}

// A jump or a limit was crossed; where both, the one whose secant falls through zero first.
template <class Equation, class Method>
void Integrator<Equation, Method>::stop_crossed(const Mask& lanes) {
  P first(infinity), met(infinity);
  Mask by_jump = Lanes::none();
  for_each_index(f_.surfaces, [&](auto m) {
    if (m < f_.kinks_end && (m >= f_.jumps_end || crosses(m))) return;
    const Mask here = lanes & !(along_[m].b4 > P(0.0));
    if (any(here)) met = select(here, min(met, along_[m].zero()), met);
    const P at = along_[m].b0 / (along_[m].b0 - along_[m].b4);
    const Mask earlier = !(along_[m].b4 > P(0.0)) & (at < first);
    first = select(earlier, at, first);
    by_jump = m < f_.jumps_end ? by_jump | earlier : by_jump & !earlier;
  });
  past_ = select(lanes & running_ & (met <= P(1.0)), met * step_, past_);  // which may be NaN
  stop(lanes & by_jump, Status::met_jump);
  stop(lanes & !by_jump, Status::left_domain);
}

// Past a limit the stages are NaN. Where that has happened, a step goes most of the way to where the straight line from here
// leaves the domain; what is next to it leaves.
template <class Equation, class Method>
void Integrator<Equation, Method>::approach_limits(const P& duration) {
  const P reach = to_limits();
  stop(broken_ & running_ & (reach <= brink * duration), Status::left_domain);
  step_size_ = select(broken_, min(step_size_, 0.9 * reach), step_size_);
}

// On other sides other branches are taken: their limits are to hold from here on, and their poles lie on the side where they
// are.
template <class Equation, class Method>
void Integrator<Equation, Method>::enter_branches(const Mask& lanes, const State& y) {
  const Surfaces value = f_.surface_values(y, side_), rate = f_.surface_rates(y, stage_[0], side_);
  for_each_index(f_.kinks_end, f_.surfaces, [&](auto m) {
    value_[m] = select(lanes, value[m], value_[m]);
    rate_[m] = select(lanes, rate[m], rate_[m]);
  });
  Mask outside = Lanes::none();
  for_each_index(f_.kinks_end, f_.sides, [&](auto m) {
    side_[m] = select(lanes, select(value_[m] < P(0.0), P(-1.0), P(1.0)), side_[m]);
    outside = outside | !((value_[m] < P(0.0)) | (value_[m] > P(0.0)));
  });
  for_each_index(f_.sides, f_.surfaces, [&](auto m) {
    Mask here = lanes & !(value_[m] > P(0.0));
    if (f_.dependence.closed(m) && any(here)) here = here & !starts_at(m, y);
    outside = outside | here;
  });
  stop(lanes & running_ & outside, Status::left_domain);
}

// What is measured as its logarithm must be known as a share of itself, however small it has become, and what only decays must
// not fall below zero by an error. So its error counts as such a share, unless it is rounding.
template <class Equation, class Method>
void Integrator<Equation, Method>::judge_measured(const State& y) {
  State error, coarse, size;
  fit(error, f_.states);
  fit(coarse, f_.states);
  fit(size, f_.states);
  for_each_index(f_.states, [&](auto i) {
    error[i] = step_ * method_.error_of(stage_, i);
    coarse[i] = end_[i] - y[i] - step_ * method_.coarse_of(stage_, i);
    size[i] = P(0.0);
  });
  const Surfaces of_error = f_.surface_rates(end_, error, side_), of_coarse = f_.surface_rates(end_, coarse, side_);
  Surfaces rounded = of_error;
  rounded.fill(P(0.0));
  for_each_index(f_.states, [&](auto i) {
    size[i] = end_[i];
    const Surfaces part = f_.surface_rates(end_, size, side_);
    for_each_index(f_.measured, [&](auto n) { rounded[f_.surfaces + n] += abs(part[f_.surfaces + n]); });
    size[i] = P(0.0);
  });
  const double part = measured_share * tolerance_.relative * local_share;
  const P share(1.0 / (part * part));
  for_each_index(f_.measured, [&](auto n) {
    const int m = f_.surfaces + n;
    const P least = (1e-15 / (measured_share * tolerance_.relative)) * rounded[m];
    const P value = max(max(abs(value_[m]), abs(end_value_[m])), max(least, P(1e-290)));
    const P weight = share / (value * value);
    const P judged = method_.squared_error(weight * of_error[m] * of_error[m], weight * of_coarse[m] * of_coarse[m]);
    const Mask counts = !implicit_ & (judged > squared_error_);
    squared_error_ = select(counts, judged, squared_error_);
    told_error_ = select(counts, judged, told_error_);
  });
}

// The time in which the straight line from here leaves the domain.
template <class Equation, class Method>
auto Integrator<Equation, Method>::to_limits() const -> P {
  P reach(infinity);
  const auto approach = [&](int m, const P& side) {
    reach = min(reach, select(side * rate_[m] < P(0.0), -value_[m] / rate_[m], P(infinity)));
  };
  for_each_index(f_.kinks_end, f_.sides, [&](auto m) { approach(m, side_[m]); });
  for_each_index(f_.sides, f_.surfaces, [&](auto m) { approach(m, P(1.0)); });
  return reach;
}

// No step is small enough: the trajectory touches a jump or a limit, or its error stays too large.
template <class Equation, class Method>
void Integrator<Equation, Method>::stop_stuck(const Mask& lanes, const P& duration) {
  const Mask good = squared_error_ <= P(1.0), finite = squared_error_ < P(infinity);
  for_each_index(f_.surfaces, [&](auto m) {
    if (m >= f_.jumps_end && m < f_.kinks_end) return;
    const Mask touches = lanes & good & running_ & !along_[m].clear(beside_[m]);
    if (m < f_.jumps_end && crosses(m)) stop(touches & (turns_ >= P(many_turns)), Status::chatters);
    stop(touches, m >= f_.jumps_end ? Status::left_domain : crosses(m) ? Status::grazes_jump : Status::met_jump);
  });
  stop(lanes & finite & running_ & (to_limits() <= brink * duration), Status::left_domain);  // as at a pole, which f rises to
  stop(lanes & finite & running_, Status::step_limit);
  stop(lanes & !finite & running_, Status::not_finite);
}

}  // namespace fisherpoint
