// What becomes of a step that was tried: a member of Integrator (integrator.hpp, which includes it at its end). Whether it is
// taken follows from its error and from every surface along it; so do the surface to end on, the status of what ends, and the
// next step.
#pragma once

#include "fisherpoint/integration/step_control.hpp"

namespace fisherpoint {

// Decides about the tried step, takes it where it is good, and chooses the next one.
template <class Equation, class Method>
void Integrator<Equation, Method>::control(State& y, const P& duration) {
  const P zero(0.0);
  const Mask good = running_ & (squared_error_ <= P(1.0));  // false where the error is NaN

  Mask to_surface = Lanes::none(), stopped = Lanes::none(), unsure = Lanes::none(), lands = Lanes::none();
  Mask at_kink = Lanes::none(), at_jump = Lanes::none(), over_jump = Lanes::none();
  P next_cap(infinity);
  const Mask short_step = brief_step(duration), tiny_step = this->tiny_step(duration);
  const bool brief_steps = any(short_step & good);
  for_each_index(f_.surfaces, [&](auto m) {
    if (!may_matter(m)) {
      if (m < f_.kinks_end) landed_[m] = Lanes::none();
      return;
    }
    const Quartic<P>& h = along_[m];
    const Mask clear = h.clear(beside_[m]);
    Mask crossed = good & !(h.b4 > zero), unclear = good & !crossed & !clear;
    if (m >= f_.jumps_end && m < f_.kinks_end) {
      const P slope = 4.0 * (h.b4 - h.b3);  // of the whole step
      Mask held = Lanes::none();
      if (m < f_.holds_end && slide_) held = good & slides(side_[m]);
      // A start along the kink, or at rest on it, belongs to the side where the step ends; f has no jump there.
      const Mask along = good & !held & !(abs(value_[m]) + abs(rate_[m]) > zero);
      // So does a start that rounding has put next to the kink, from where the kink cannot be landed on.
      Mask next_to = good & !held & (h.b0 <= -rounding * h.b4) & ((h.b1 < h.b0) | (h.b1 <= zero));
      if (f_.jumps_end > 0) next_to = next_to & !over_jump;  // with which the kink may be met
      // It may have been on the other side and be back on the kink at the step's end.
      const Mask wrong = (along | next_to) & ((h.b4 < zero) | (!(h.b4 > zero) & (h.least_inside() < zero)));
      side_[m] = select(wrong, -side_[m], side_[m]);
      landed_[m] =
          good & !along & !wrong & !(ends_ & (h.b4 > zero)) & ((abs(h.b4) <= -landing_ * slope) | (crossed & short_step));
      if (brief_steps) landed_[m] = landed_[m] | (good & !along & !wrong & !ends_ & short_step & ends_in_noise(m, y));
      if (f_.dependence.steep(m)) {
        const Mask tends = good & !held & !along & !wrong & !ends_ & (h.b4 < 0.5 * h.b0),
                   cut = good & !held & !along & !wrong & !ends_ & (step_ < step_size_) & (h.b4 < h.b0);
        if (any(cut)) landed_[m] = landed_[m] | (cut & is_met(m));
        if (any(tends)) landed_[m] = landed_[m] | comes_to_hold(m, tends);
      }
      crossed = crossed & !landed_[m] & !along & !wrong;
      unclear = unclear | (landed_[m] & !clear);  // it may have been there before
      // From rest it may go to the other side and end on the kink again, with no sign at either end.
      unclear = unclear & !(along & !(min(h.b2, h.b3) < -rounding * abs(h.b4))) & !short_step;
      if (any(crossed | unclear)) {
        const Mask heard = held | !drowned(m, y);
        crossed = crossed & heard;
        unclear = unclear & heard;
        next_cap = select(crossed, min(next_cap, h.zero() * step_), next_cap);
      }
      unclear = unclear | (wrong & !(ends_ & short_step));  // what is left of the duration is nothing
      lands = lands | landed_[m];
      to_surface = to_surface | crossed;
      at_kink = at_kink | landed_[m] | crossed;
    } else if (m < f_.jumps_end && crosses(m)) {
      const P slope = 4.0 * (h.b4 - h.b3);
      Mask rests = Lanes::none();
      if (any_rest()) {
        rests = resting_[m] & rests_along(m);
        const Mask departs = good & resting_[m] & crossed & !rests;
        if (any(departs)) {
          depart(m, departs & short_step, y);
          unsure = unsure | departs;
        }
        crossed = crossed & !resting_[m];
        unclear = unclear & !rests & !(resting_[m] & (min(h.b2, h.b3) > zero));
      }
      Mask there = crossed & tiny_step;
      const Mask nearly = good & tiny_step & (h.b1 < 0.875 * h.b0);
      if (any(nearly)) there = there | (nearly & drowned(m, y));  // no step is short enough to end on it
      // Behind a jump, what is left of the duration may be too short for h to show the side.
      const Mask remains = behind_kink_ & ends_ & short_step;
      landed_[m] = good & !remains & !resting_[m] & !(ends_ & (h.b4 > zero)) & ((abs(h.b4) <= -landing_ * slope) | there);
      if (brief_steps)
        landed_[m] =
            landed_[m] | (good & !(remains | resting_[m] | slides(side_[m]) | ends_) & short_step & ends_in_noise(m, y));
      crossed = crossed & !landed_[m] & !remains;
      unclear = (unclear | (landed_[m] & !clear)) & !(landed_[m] & tiny_step) & !remains;  // it may have been there before
      if (any(crossed | unclear)) {
        // Off a slide the trajectory rises like a parabola, from what rounding has left of zero.
        unclear = unclear & !(leaving_[m] & (min(h.b2, h.b3) > zero));
        stop((crossed | unclear) & !landed_[m] & !slides(side_[m]) & drowned(m, y), Status::grazes_jump);
        next_cap = select(crossed, min(next_cap, h.zero() * step_), next_cap);
      }
      const Mask turns = good & !(landed_[m] | crossed | unclear | leaving_[m] | remains | rests) & turns_towards(m);
      if (any(turns)) stop_grazing(m, turns, y);
      lands = lands | landed_[m];
      to_surface = to_surface | crossed;
      over_jump = over_jump | crossed;
      at_jump = at_jump | landed_[m];
    } else {
      if (m >= f_.sides && f_.dependence.closed(m)) {  // it may have started there, and rest, or rise from rest
        const Mask rests = !(abs(h.b0) > zero) & rests_along(m);
        const Mask rises = !(abs(h.b0) + abs(h.b1) > zero) & (min(h.b2, h.b3) > zero);
        crossed = crossed & !rests;
        unclear = unclear & !(rests | rises);
      }
      stopped = stopped | crossed;
    }
    unsure = unsure | unclear;
  });
  // Past a pole f has values again: where a step may have reached it, no stage may be past it. x' = 1 / (2 - x) reaches 2 in
  // half the time that the straight line takes. And x' = 1 / (2 - x)^2 goes on behind it, with the same sign of the divisor
  // that has turned in between: such a turn is looked at in shorter steps, of which none is short enough at a pole.
  Mask nearing = Lanes::none();
  for_each_index(f_.kinks_end, f_.sides, [&](auto m) {
    const Quartic<P>& h = along_[m];
    nearing = nearing | (good & (min(h.b1, h.b4) < 0.87 * h.b0));
    unsure = unsure | (good & (h.b1 < 0.87 * h.b0) & (h.b3 < h.b4));
  });
  if (any(nearing)) unsure = unsure | (nearing & past_pole(y));
  if (!tolerance_.cross_kinks && any(at_kink)) {
    past_ = select(at_kink & !stopped & running_, min(step_, next_cap), past_);
    stop(at_kink & !stopped, Status::met_kink);
    to_surface = to_surface & !at_kink;
    lands = lands & !at_kink;
  }
  stopped = stopped & !to_surface;  // what lies past a surface is seen from there
  if (any(stopped)) stop_crossed(stopped);
  unsure = unsure & !to_surface;
  next_cap = select(unsure, 0.5 * step_, next_cap);
  const Mask unseen = any(unsure) ? unsure & poorly_seen() : Lanes::none();

  several_landed_ = Lanes::none();
  if (any(at_jump & good & !to_surface & !unsure))
    to_surface = to_surface | land_on_first(good & running_ & !to_surface & !unsure, duration, next_cap);
  const Mask taken = good & running_ & !to_surface & !unsure;
  const P tried = step_;
  if (any(lands & taken)) settle(taken);
  const Mask bad = running_ & !good;
  const Mask stuck = running_ & !taken & (step_ <= 1e-13 * max(time_, first_try_));
  if (any(stuck)) stop_stuck(stuck, duration);

  // Step control: error per step, never twice up and down in a row. An estimate that vanishes by chance asks for a step that
  // the one before did not. What asks for more than may be given says nothing, nor does a step that was cut short.
  P wish = min(0.9 * method_.inverse_root(select(good, told_error_, squared_error_) + 1e-20), most_wished * wished_ / step_);
  if (any_stiff_) wish = select(implicit_, implicit_wish(), wish);
  const Mask told = running_ & (squared_error_ < P(infinity)), much = wish >= P(method_.most_growth), cut = step_ < step_size_;
  const P wished = select(cut, max(wished_, select(much, zero, wish * step_)), select(much, P(infinity), wish * step_));
  wished_ = select(told, wished, wished_);
  const P longest = select(rejected_, P(1.0), P(method_.most_growth));
  const P factor = min(max(select(squared_error_ < P(1e100), wish, zero), P(0.2)), longest);
  const P grown = factor * step_;
  step_size_ = select(bad, min(grown, 0.9 * step_),
                      select(taken, select(step_ < step_size_, max(grown, step_size_), grown), step_size_));
  if (any(unseen)) {  // a longer step may see as much of the surface by chance
    step_size_ = select(unseen, 0.5 * step_, step_size_);
    wished_ = select(unseen, 0.5 * step_, wished_);
  }
  rejected_ = (bad | (rejected_ & !taken)) & running_;
  broken_ = broken_ | (bad & !(squared_error_ < P(infinity)));
  cap_ = select(bad, cap_, next_cap);
  outcome_.first_step = select(taken & (time_ <= zero), step_, outcome_.first_step);

  if (unforeseen(samples_ != nullptr)) sample(taken, tried, y);
  if (any_stiff_) implicit_step_->keep(taken & implicit_);
  if ((f_.order() || outcome_.attempts > watched_from) && tolerance_.method == MethodName::fastest) watch_stiffness(taken);
  const P growth = steps_ ? growth_of_distance() : zero;
  behind_kink_ = behind_kink_ & !taken;
  time_ = select(taken, time_ + step_, time_);
  for_each_index(f_.states, [&](auto i) {
    y[i] = select(taken, end_[i], y[i]);
    stage_[0][i] = select(taken, stage_[last()][i], stage_[0][i]);
  });
  for_each_index(f_.surfaces, [&](auto m) {
    value_[m] = select(taken, end_value_[m], value_[m]);
    rate_[m] = select(taken, end_rate_[m], rate_[m]);
  });
  for_each_index(f_.measured, [&](auto n) {
    const int m = f_.surfaces + n;
    value_[m] = select(taken, end_value_[m], value_[m]);
  });
  for_each_index(Count<0>{}, f_.jumps_end, [&](auto m) { leaving_[m] = leaving_[m] & !taken; });
  if (any_rest()) end_rests(taken);
  if (steps_) steps_->push_back({select(taken, step_, zero), side_, implicit_, growth});
  running_ = running_ & !(taken & ends_);
  if (any(lands & taken & running_)) turn(y, taken, duration);
  if (any(broken_ & running_)) approach_limits(duration);
}

}  // namespace fisherpoint
