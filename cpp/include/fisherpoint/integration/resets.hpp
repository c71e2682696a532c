// How the stepping loop sets states anew: members of Integrator (integrator.hpp, which includes it at its end).
//
// A reset has a condition, made of the sides of jumps, and values for some states. When the condition becomes true, where a
// jump is met or at the start of a segment by a change of the input, these states get their values and the trajectory goes on
// from there, on the sides that it has then. A mass that hits a stop, and the memory of a relay, are resets. What changes
// nothing, as a relay that is switched on twice, is none.
#pragma once

#include "fisherpoint/integration/sliding.hpp"
#include "fisherpoint/integration/step_control.hpp"

namespace fisherpoint {

// The lanes in which the condition of a reset becomes true on these sides, and states change by that.
template <class Equation, class Method>
auto Integrator<Equation, Method>::anew_on_sides(const Mask& lanes, const State& y, const Side& side) const -> Mask {
  Mask found = Lanes::none();
  if constexpr (has_resets<Equation>) {
    if (f_.resets == 0 || !any(lanes)) return found;
    const State holds = f_.reset_conditions(y, side);
    P which(0.0);
    for (int k = 0; k < f_.resets; ++k) {
      const Mask becomes = lanes & (holds[k] > P(0.0)) & !(held_[k] > P(0.5));
      which += select(becomes, P(static_cast<double>(std::uint64_t{1} << k)), P(0.0));
    }
    if (!any(which > P(0.0))) return found;
    const State after = f_.reset(y, side, which);
    for_each_index(f_.states, [&](auto i) { found = found | (lanes & ((after[i] < y[i]) | (after[i] > y[i]))); });
  }
  return found;
}

// The same with side m turned, as they are about to cross it.
template <class Equation, class Method>
auto Integrator<Equation, Method>::sets_anew(auto m, const Mask& lanes, const State& y) const -> Mask {
  Side turned = side_;
  turned[m] = select(lanes, -side_[m], side_[m]);
  return anew_on_sides(lanes, y, turned);
}

// Of lanes on several jumps, of which they have met these: those in which a single one was met, while they slide on others, and
// sets states anew, so that the others follow from where that leads. Where several were met in one instant, of which any sets
// states anew, the order matters: such lanes end. `at_once`: lanes that have met several.
template <class Equation, class Method>
auto Integrator<Equation, Method>::one_sets_anew(const Mask& lanes, const Retyped<Side, Mask>& met, const State& y,
                                                 Mask& at_once) -> Mask {
  Mask once = Lanes::none(), anew = once;
  at_once = once;
  for_each_index(Count<0>{}, f_.jumps_end, [&](auto m) {
    const Mask here = lanes & met[m];
    at_once = at_once | (once & here);
    once = once | here;
    anew = anew | sets_anew(m, here & !slides(side_[m]), y);
  });
  stop(anew & at_once, Status::two_jumps);
  return anew;
}

// Sides of further jumps may have followed from those that were met, of slides that open or rests that end. Where that makes a
// condition true, states would be set anew at once; there is no one order for that.
template <class Equation, class Method>
void Integrator<Equation, Method>::end_turn(const Mask& lanes, const State& y) {
  if constexpr (has_resets<Equation>) {
    const Mask here = lanes & running_;
    stop(anew_on_sides(here, y, side_), Status::two_jumps);
    const State holds = f_.reset_conditions(y, side_);
    for (int k = 0; k < f_.resets; ++k) held_[k] = select(here, select(holds[k] > P(0.0), P(1.0), P(0.0)), held_[k]);
  }
}

// At the start: by a change of the input, or where it lies on a jump and leads into the condition. A first start knows no
// condition that held before, but those of states whose surface it does not lie on.
template <class Equation, class Method>
void Integrator<Equation, Method>::start_resets(State& y, const P& duration) {
  if constexpr (has_resets<Equation>) {
    Side came = side_;
    Mask several = Lanes::none(), slow = several;
    for_each_index(Count<0>{}, f_.jumps_end, [&](auto m) {
      const Mask on = running_ & !((value_[m] < P(0.0)) | (value_[m] > P(0.0)));
      came[m] = select(on, -side_[m], side_[m]);
      if (!any(on)) return;
      const Mask still = moves_none(m, rate_[m], y);
      slow = slow | (on & still);
      const Mask other = on & !still & !(abs(reset_on_ - P(double(m))) < P(0.5));
      several = several | (other & (reset_on_ >= P(0.0)));
      reset_on_ = select(other & (reset_on_ < P(0.0)), P(double(m)), reset_on_);
    });
    const State before = f_.reset_conditions(y, came);
    for (int k = 0; k < f_.resets; ++k) {
      const P level = f_.resets_by_level(k) ? P(0.0) : select(before[k] > P(0.0), P(1.0), P(0.0));
      held_[k] = select(held_[k] < P(0.0), level, held_[k]);
    }
    // What the jumps make true on which it lies; all else is true from the start on, or by the input, at a time that is known.
    const State now = f_.reset_conditions(y, side_);
    Mask by_jump = Lanes::none();
    for (int k = 0; k < f_.resets; ++k) by_jump = by_jump | ((now[k] > P(0.0)) & !(before[k] > P(0.0)) & !(held_[k] > P(0.5)));
    reset_on_ = select(by_jump, reset_on_, P(-1.0));
    const Mask at_once = anew_on_sides(running_ & by_jump, y, side_), falls = running_ & slow & by_jump & !at_once;
    stop(at_once & several, Status::two_jumps);
    if (any(falls)) {  // what is at rest on its stop changes only as it falls through, and would be set anew for ever
      State ahead = y;
      for_each_index(f_.states, [&](auto i) { ahead[i] += brief * duration * stage_[0][i]; });
      stop(anew_on_sides(falls, ahead, side_), Status::chatters);
    }
    const Mask changed = set_anew(running_, y, reset_on_, duration);
    if (!any(changed)) return;
    start_anew(changed, y, duration);
    take_places(changed, y);
  }
}

// Where conditions have become true, on the sides that the lanes have now: sets the states anew, as often as that makes further
// conditions true. `surface`: the jump that was met. Returns the lanes in which any state has changed.
template <class Equation, class Method>
auto Integrator<Equation, Method>::set_anew(const Mask& lanes, State& y, const P& surface, const P& duration) -> Mask {
  Mask changed = Lanes::none();
  if constexpr (has_resets<Equation>) {
    for (Mask& on : put_on_) on = Lanes::none();
    Mask some = lanes & running_;
    for (int round = 0; any(some); ++round) {
      const State holds = f_.reset_conditions(y, side_);
      P which(0.0);
      Mask becomes = Lanes::none();
      for (int k = 0; k < f_.resets; ++k) {
        const Mask now = holds[k] > P(0.0), here = some & now & !(held_[k] > P(0.5));
        held_[k] = select(some, select(now, P(1.0), P(0.0)), held_[k]);
        which += select(here, P(static_cast<double>(std::uint64_t{1} << k)), P(0.0));
        becomes = becomes | here;
      }
      if (!any(becomes)) break;
      const State after = f_.reset(y, side_, which);
      Mask moves = Lanes::none();
      for_each_index(f_.states, [&](auto i) { moves = moves | (becomes & ((after[i] < y[i]) | (after[i] > y[i]))); });
      // What leaves the states alone, and the sides too, is none; where it was met on its own jump it would be met for ever.
      some = moves;
      if (!any(some)) break;
      stop(some & !finite<P>(after), Status::not_finite);
      some = some & running_;
      if (round == most_resets) {
        stop(some, Status::chatters);
        break;
      }
      const Surfaces before = f_.surface_values(y, side_);
      for_each_index(f_.states, [&](auto i) { y[i] = select(some, after[i], y[i]); });
      if (steps_) resets_.push_back({steps_->size(), select(some, which, P(0.0)), surface});
      changed = changed | some;
      choose_sides(some, y, before, surface, duration);
      some = some & running_;
    }
    // One after the other in no time, as of a mass that comes to rest on its stop.
    const P since = time_ - last_reset_;
    shorter_ = select(changed, select(since < interval_, shorter_ + 1.0, P(0.0)), shorter_);
    interval_ = select(changed, since, interval_);
    quick_ = select(changed, select(since <= brief * duration, quick_ + 1.0, P(0.0)), quick_);
    last_reset_ = select(changed, time_, last_reset_);
    stop(changed & (quick_ > P(many_turns)), Status::chatters);
  }
  return changed;
}

// The sides of states that were set anew, of all surfaces whose values that has changed, and of the one that was met.
template <class Equation, class Method>
void Integrator<Equation, Method>::choose_sides(const Mask& lanes, const State& y, const Surfaces& before, const P& surface,
                                                const P& duration) {
  if constexpr (has_resets<Equation>) {
    const P zero(0.0);
    const Surfaces value = f_.surface_values(y, side_);
    Mask outside = Lanes::none();
    const auto moved = [&](int m) { return lanes & ((value[m] < before[m]) | (value[m] > before[m])); };
    for_each_index(f_.sides, [&](auto m) {
      resting_[m] = resting_[m] & !moved(m);
      const Mask sided = moved(m) & ((value[m] < zero) | (value[m] > zero));
      side_[m] = select(sided, select(value[m] < zero, P(-1.0), P(1.0)), side_[m]);
    });
    // Limits that stand in branches, and those at which f has a value, are looked at when the sides are known.
    if (!f_.sided_limits) {
      for_each_index(f_.kinks_end, f_.sides, [&](auto m) { outside = outside | !((value[m] < zero) | (value[m] > zero)); });
      for_each_index(f_.sides, f_.surfaces, [&](auto m) {
        Mask here = lanes & !(value[m] > zero);
        if (f_.dependence.closed(m) && any(here)) here = here & !(abs(value[m]) <= on_surface * natural_height(f_, m, y));
        outside = outside | here;
      });
      stop(lanes & outside, Status::left_domain);
    }

    State rates;
    fit(rates, f_.states);
    Mask on = Lanes::none();
    for_each_index(Count<0>{}, f_.jumps_end, [&](auto m) {
      const Mask met = lanes & (abs(surface - P(double(m))) < P(0.5)) & !moved(m);
      const Mask here = running_ & (met | (moved(m) & (abs(value[m]) <= on_surface * natural_height(f_, m, y))));
      if (!any(here)) return;
      stop(here & on, Status::two_jumps);
      on = on | here;
      put_on_[m] = put_on_[m] | here;
      P rate[2], next[2];  // of h on the sides 1 and -1, and a moment later
      for (const int which : {0, 1}) {
        Side tried = side_;
        tried[m] = select(here, P(1.0 - 2.0 * which), side_[m]);
        derivative(y, tried, rates);
        rate[which] = f_.surface_rates(y, rates)[m];
        State ahead = y;
        for_each_index(f_.states, [&](auto i) { ahead[i] += brief * duration * rates[i]; });
        derivative(ahead, tried, rates);
        next[which] = f_.surface_rates(ahead, rates)[m];
      }
      const Balance even = balance(m, here, rate[0], rate[1], y);
      const Mask up = (rate[0] > zero) & (rate[1] > zero) & !even.lanes,
                 down = (rate[0] < zero) & (rate[1] < zero) & !even.lanes,
                 held = ((rate[0] < zero) & (rate[1] > zero) & !even.lanes) | even.holds,
                 still = !(up | down | held | even.lanes);
      const Mask rests = still & !(abs(next[0]) > zero) & !(abs(next[1]) > zero);
      const Mask rises = still & (next[0] > zero) & (next[1] > zero);
      const P came = select(met, -side_[m], side_[m]);
      const P other = select(even.lanes, even.side, came);
      side_[m] = select(here, select(held, zero, select(up | rises, P(1.0), select(down, P(-1.0), other))), side_[m]);
      leaving_[m] = leaving_[m] | even.holds | even.lets_go;
      // A mass that has lost all its velocity would fall through the stop that it lies on, and be stopped again at once.
      const Mask open = here & still & !(rests | rises);
      stop(open & met, Status::chatters);
      stop(open & !met, Status::grazes_jump);
    });
    see_slides();
  }
}

// Of lanes that have just ended: where they were set anew ever sooner, until rounding hid what was in between.
template <class Equation, class Method>
void Integrator<Equation, Method>::name_pile_up(const Mask& lanes) {
  const Mask piled = lanes & (shorter_ >= P(few_resets)) & (interval_ <= soon * span_) & (time_ - last_reset_ <= soon * span_);
  for (int lane = 0; lane < Lanes::width; ++lane)
    if (Lanes::get(piled, lane)) outcome_.status[lane] = Status::chatters;
}

// Of the surfaces on which states were put, h is zero, whatever rounding makes of it.
template <class Equation, class Method>
void Integrator<Equation, Method>::take_places(const Mask& lanes, const State& y) {
  if constexpr (has_resets<Equation>) {
    const Surfaces value = f_.surface_values(y, side_);
    for_each_index(f_.surfaces, [&](auto m) { value_[m] = select(lanes, value[m], value_[m]); });
    for_each_index(Count<0>{}, f_.jumps_end,
                   [&](auto m) { value_[m] = select(lanes & put_on_[m] & !slides(side_[m]), P(0.0), value_[m]); });
  }
}

}  // namespace fisherpoint
