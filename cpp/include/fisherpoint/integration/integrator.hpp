// The stepping loop: one for every number type and every equation.
//
// Each lane has its own time, step and status, so a trajectory's result does not depend on what shares its pack. A step is
// tried with the sides of all surfaces held (model.hpp). It is taken if its embedded error is within the tolerance and if
// every surface stays on its side all along the step's quartic interpolant (quartic.hpp). Otherwise
//   a kink whose sign changed    the step is tried again so as to end on the kink; there the side is turned;
//   a jump                       in the same way; behind it the trajectory goes on, or slides along it (sliding.hpp);
//   a domain limit               ends the trajectory with its status;
//   no change of sign, no proof  half the step is tried.
// Where stability alone limits the steps, a lane goes on by implicit ones (stiffness.hpp); all else is the same for them.
#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "fisherpoint/integration/implicit_step.hpp"
#include "fisherpoint/integration/outcome.hpp"
#include "fisherpoint/integration/runge_kutta.hpp"
#include "fisherpoint/integration/sliding.hpp"
#include "fisherpoint/integration/sliding_several.hpp"
#include "fisherpoint/integration/status.hpp"
#include "fisherpoint/integration/step_control.hpp"
#include "fisherpoint/integration/tolerance.hpp"
#include "fisherpoint/models/shape.hpp"
#include "fisherpoint/numbers/pack.hpp"
#include "fisherpoint/numbers/quartic.hpp"
#include "fisherpoint/numbers/shelves.hpp"
#include "fisherpoint/numbers/unroll.hpp"

namespace fisherpoint {

template <class Equation>
class Additions;

template <class Equation, class Method>
class Integrator {
  using P = typename Equation::Number;
  using Lanes = lanes_of<P>;
  using Mask = typename Lanes::mask;
  using State = typename Equation::State;
  using Side = typename Equation::Side;
  using Surfaces = typename Equation::Surfaces;
  static constexpr int last = Method::stages - 1;  // the stage at the step's end
  static constexpr double infinity = std::numeric_limits<double>::infinity();

  // That states were set anew before this step, by which resets, and on which jump (resets.hpp).
  struct SetAnew {
    std::size_t step;
    P which, surface;
  };
  // A steep surface holds lanes from this step on; `instant` is how long before that the tolerance does not see the distance.
  struct Held {
    std::size_t step;
    P instant;
  };

 public:
  Integrator(const Equation& equation, const Tolerance& tolerance)
      : f_(equation), tolerance_(tolerance), weight_(tolerance.step_weight()), landing_(0.1 * std::sqrt(tolerance.relative)) {
    for (State& rates : stage_) fit(rates, f_.states);
    fit(end_, f_.states);
    fit(side_, f_.sides);
    fit(landed_, f_.sides);
    fit(leaving_, f_.sides);
    fit(resting_, f_.sides);
    fit(along_, f_.surfaces);
    fit(beside_, f_.surfaces);
    if constexpr (has_resets<Equation>) {
      held_.assign(f_.resets, P(-1.0));
      put_on_.assign(f_.resets > 0 ? int{f_.jumps_end} : 0, Lanes::none());
    }
  }

  // Integrates y over `duration`, a lane of duration 0 rests; y becomes the last state that was reached. Where `first_step` is
  // 0 the integrator chooses it. The steps that are taken are added to `steps`; lanes of `stiff` begin with implicit ones.
  // `from`: the sides of jumps from which trajectories come, 0 of a slide; without it, and at `unknown_side`, the start tells.
  Outcome<P> run(State& y, const P& duration, const P& first_step, Steps<Equation>* steps = nullptr,
                 const Mask& stiff = Lanes::none(), const Side* from = nullptr);

  const Side& sides() const { return side_; }
  // Of every reset: whether its condition held before the start, -1 where that is not known, and now.
  ShelfVector<P>& held() { return held_; }
  const ShelfVector<SetAnew>& resets() const { return resets_; }
  const ShelfVector<Held>& holds() const { return holds_; }
  // The sides on which such a run begins if it is on every jump that is `met`, 1 there and 0 elsewhere.
  Side sides_from(const State& y, const P& duration, const Side& from, const Side& met, Mask& stopped);

 private:
  // Where it starts: start.hpp.
  FISHERPOINT_HOT void begin(State& y, const P& duration, const P& first_step);
  P starting_step(const State& y);
  void leave_roots(const State& y, const P& duration);

  P squared_weight() const { return P(weight_); }

  // Whether jump m may be crossed. Where its time does not depend on theta, sensitivities stay what they are.
  bool crosses(auto m) const {
    return f_.dependence.crossable(m) && (tolerance_.cross_jumps || !f_.dependence.switching_depends(m));
  }

  // f on the sides where the trajectories run. Of lanes that do not slide it is the same code, and so the same bits, whether a
  // neighbour does or not.
  void derivative(const State& x, State& dx) const { derivative(x, side_, dx); }
  void derivative(const State& x, const Side& side, State& dx) const {
    if (f_.holds_end == 0) return f_.derivative(x, side, dx);
    f_.derivative(x, slide_ ? beside<P>(f_, side, 1.0) : side, dx);
    if (unforeseen(slide_)) slide(x, side, dx);
  }
  [[gnu::noinline]] void slide(const State& x, const Side& side, State& dx) const;

  // Of a squared error, the factor by which a step may be longer: both methods' estimates fall faster than the step's
  // power of five and eight.
  static P inverse_root(const P& squared_error) {
    return rough_inverse_root(squared_error, std::integral_constant<int, 2 * Method::order>{});
  }

  // Tries one step of every running lane: the end, its error, and the surfaces at the middle and the end.
  FISHERPOINT_HOT void attempt(const State& y, const P& duration) {
    const P remaining = duration - time_, wanted = min(step_size_, cap_);
    ends_ = remaining <= wanted * (1.0 + 1e-9);
    step_ = select(running_, select(ends_, remaining, wanted), P(0.0));
    State middle;
    fit(middle, f_.states);
    if (!any_stiff_ || any(running_ & !choose_implicit())) attempt_explicit(y, middle);
    if (any_stiff_ && any(implicit_)) attempt_implicit(y, middle);
    Surfaces middle_value = f_.surface_values(middle, side_);
    end_value_ = f_.surface_values(end_, side_);
    end_rate_ = f_.surface_rates(end_, stage_[last], side_);
    if (f_.measured > 0) judge_measured(y);
    if ((f_.holds_end > 0 && slide_) || any_rest()) keep_on_surfaces(middle, middle_value);
    const auto along = [&](int m, const P& side) {
      along_[m] = Quartic<P>::through(side * value_[m], side * step_ * rate_[m], side * middle_value[m], side * end_value_[m],
                                      side * step_ * end_rate_[m]);
    };
    for_each_index(Count<0>{}, f_.holds_end,
                   [&](auto m) { along(m, slide_ ? select(slides(side_[m]), P(1.0), side_[m]) : side_[m]); });
    for_each_index(f_.holds_end, f_.sides, [&](auto m) { along(m, side_[m]); });
    for_each_index(f_.sides, f_.surfaces, [&](auto m) { along(m, P(1.0)); });
    Mask wavering = Lanes::none();
    for_each_index(f_.surfaces, [&](auto m) { wavering = wavering | along_[m].wavers(); });
    beside_.fill(P(0.0));
    if (any(wavering & running_)) look_beside(wavering, y, middle);
  }

  // Of what must be positive where g is measured: limits.hpp.
  [[gnu::noinline]] void judge_measured(const State& y);

  // The stages, the end and the middle of a step, and its error.
  void attempt_explicit(const State& y, State& middle) {
    const bool slide = f_.holds_end > 0 && slide_;
    const Side at = slide ? beside<P>(f_, side_, 1.0) : side_;
    for_each_index(counted<Equation, last>(), [&](auto previous) {
      const auto s = after(previous);
      for_each_index(f_.states, [&](auto i) { end_[i] = y[i] + step_ * weighted_sum(s, Method::a[s], stage_, i); });
      f_.derivative(end_, at, stage_[s]);
      if (f_.holds_end > 0 && unforeseen(slide)) this->slide(end_, side_, stage_[s]);
    });
    State error;
    fit(error, f_.states);
    for_each_index(f_.states,
                   [&](auto i) { error[i] = step_ * weighted_sum(counted<Equation, last + 1>(), Method::error, stage_, i); });
    const P embedded = squared_weight() * f_.squared_size(error);
    for_each_index(f_.states, [&](auto i) {
      error[i] = end_[i] - y[i] - step_ * weighted_sum(counted<Equation, last>(), Method::coarse, stage_, i);
    });
    const P coarse = f_.squared_size(error);
    squared_error_ = Method::squared_error(embedded, squared_weight() * coarse);
    const P size = f_.squared_size(y) + f_.squared_size(end_) + 1e-300;
    const P least = (least_error * least_error) * squared_weight() * coarse * coarse / size;
    squared_error_ = select(least > squared_error_, least, squared_error_);  // which stays NaN where it is
    told_error_ = squared_error_;
    // Behind a kink f may rise like t^1.5, where the embedded error is that of the step itself, however large the coarse one.
    if (f_.kinks_end > 0) squared_error_ = select(behind_kink_ & (embedded > squared_error_), embedded, squared_error_);
    for_each_index(f_.states, [&](auto i) {
      middle[i] = 0.5 * (y[i] + end_[i]) + step_ * (0.125 * (stage_[0][i] - stage_[last][i]) +
                                                    weighted_sum(counted<Equation, last + 1>(), Method::bow, stage_, i));
    });
  }

  // Decides about the tried step, takes it where it is good, and chooses the next one.
  FISHERPOINT_HOT void control(State& y, const P& duration) {
    const P zero(0.0);
    const Mask good = running_ & (squared_error_ <= P(1.0));  // false where the error is NaN

    Mask to_surface = Lanes::none(), stopped = Lanes::none(), unsure = Lanes::none(), lands = Lanes::none();
    Mask at_kink = Lanes::none(), at_jump = Lanes::none(), over_jump = Lanes::none();
    P next_cap(infinity);
    const Mask short_step = step_ <= brief * duration, tiny_step = step_ <= briefest * tolerance_.relative * duration;
    const bool brief_steps = any(short_step & good);
    for_each_index(f_.surfaces, [&](auto m) {
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
        const Mask turns =
            good & !(landed_[m] | crossed | unclear | leaving_[m] | remains | rests) & (h.b1 <= h.b0) & (h.b3 <= h.b4);
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
    if (any(lands & taken)) settle(taken);
    const Mask bad = running_ & !good;
    if (any(running_ & !taken)) stop_stuck(running_ & !taken & (step_ <= 1e-13 * max(time_, first_try_)), duration);

    // Step control: error per step, never twice up and down in a row. An estimate that vanishes by chance asks for a step that
    // the one before did not. What asks for more than may be given says nothing, nor does a step that was cut short.
    P wish = min(0.9 * inverse_root(select(good, told_error_, squared_error_) + 1e-20), most_wished * wished_ / step_);
    if (any_stiff_) wish = select(implicit_, implicit_wish(), wish);
    const Mask told = running_ & (squared_error_ < P(infinity)), much = wish >= P(Method::most_growth),
               cut = step_ < step_size_;
    const P wished = select(cut, max(wished_, select(much, zero, wish * step_)), select(much, P(infinity), wish * step_));
    wished_ = select(told, wished, wished_);
    const P longest = select(rejected_, P(1.0), P(Method::most_growth));
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

    if (any_stiff_) implicit_step_->keep(taken & implicit_);
    if (outcome_.attempts > watched_from && tolerance_.method == MethodName::fastest) watch_stiffness(taken, y);
    const P growth = steps_ ? growth_of_distance() : zero;
    behind_kink_ = behind_kink_ & !taken;
    time_ = select(taken, time_ + step_, time_);
    for_each_index(f_.states, [&](auto i) {
      y[i] = select(taken, end_[i], y[i]);
      stage_[0][i] = select(taken, stage_[last][i], stage_[0][i]);
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

  // Along surfaces, away from them, onto them, and over them: surfaces.hpp.
  [[gnu::noinline]] void look_beside(const Mask& lanes, const State& y, const State& middle);
  [[gnu::noinline]] Mask poorly_seen() const;
  [[gnu::noinline]] P growth_of_distance() const;
  [[gnu::noinline]] void settle(const Mask& taken);
  [[gnu::noinline]] void turn(State& y, const Mask& taken, const P& duration);
  [[gnu::noinline]] void enter_branches(const Mask& lanes, const State& y);
  [[gnu::noinline]] Surfaces rates_past(const State& y, const P& step) const;
  [[gnu::noinline]] Mask drowned(auto m, const State& y) const;
  [[gnu::noinline]] Mask ends_in_noise(auto m, const State& y) const;
  P noise_of(auto m, const State& y) const;

  // Stiff stretches: stiffness.hpp.
  [[gnu::noinline]] Mask choose_implicit();
  [[gnu::noinline]] void attempt_implicit(const State& y, State& middle);
  P implicit_wish() const;
  [[gnu::noinline]] void watch_stiffness(const Mask& taken, const State& y);
  [[gnu::noinline]] void set_stiff(const Mask& lanes);

  // How it ends: limits.hpp.
  [[gnu::noinline]] Mask past_pole(const State& y) const;
  [[gnu::noinline]] void stop_crossed(const Mask& lanes);
  [[gnu::noinline]] void approach_limits(const P& duration);
  P to_limits() const;
  [[gnu::noinline]] void stop_stuck(const Mask& lanes, const P& duration);

  // At jumps: jumps.hpp.
  bool starts_next_to_jump(const P& duration) const;
  [[gnu::noinline]] void start_on_jumps(const State& y, const P& duration);
  [[gnu::noinline]] void come_from(const State& y);
  [[gnu::noinline]] void go_on(const State& y, const P& duration);
  struct Balance {
    Mask lanes, holds, lets_go;
    P side;  // to which f leads along the jump
  };
  [[gnu::noinline]] Balance balance(auto m, const Mask& lanes, const P& r_plus, const P& r_minus, const State& y);
  [[gnu::noinline]] P side_past(auto m, const State& y, const P& duration);
  void start_anew(const Mask& lanes, const State& y, const P& duration);
  [[gnu::noinline]] void keep_on_surfaces(const State& middle, Surfaces& middle_value) {
    if (f_.holds_end > 0 && slide_) hold(middle, middle_value);
    if (any_rest()) keep_resting(middle_value);
  }
  void hold(const State& middle, Surfaces& middle_value);
  P hold_rate(const State& x, const State& rates, const P& span, const Side& side) const;
  [[gnu::noinline]] void watch_hold(const Mask& lanes, const State& y, const P& span);
  [[gnu::noinline]] Mask land_on_first(const Mask& lanes, const P& duration, P& next_cap);
  [[gnu::noinline]] void pass_jump(auto m, const Mask& lanes, const State& y);
  [[gnu::noinline]] void check_slides(const Mask& lanes, const State& y, const P& span, Status otherwise = Status::two_jumps);
  [[gnu::noinline]] void stop_grazing(auto m, const Mask& lanes, const State& y);
  [[gnu::noinline]] void note_end(const P& duration, const State& y);
  void see_slides();
  [[gnu::noinline]] void leave_with_kinks(const Mask& lanes, const Side& held, const State& y);

  // On several jumps at once: settle_sides.hpp.
  [[gnu::noinline]] Mask on_several(const Retyped<Side, Mask>& met) const;
  [[gnu::noinline]] void settle_sides(const Mask& lanes, const Retyped<Side, Mask>& met, const State& y, const P& span,
                                      Status otherwise, bool at_start = false);
  [[gnu::noinline]] void cross_all(const Mask& lanes, const Additions<Equation>& all, const Retyped<Side, Mask>& on,
                                   Side& settled, Mask& lost) const;
  [[gnu::noinline]] void hold_several(const Mask& lanes, const State& middle, Surfaces& middle_value);
  [[gnu::noinline]] void watch_several(const Mask& lanes, const State& y, const P& span);
  ShelfVector<P> hold_rates(const Mask& lanes, const State& x, const State& rates, const P& span, const Side& side) const;
  [[gnu::noinline]] Balance balance_of_several(int m, const Mask& lanes, const Side& settled, const State& y);

  // At rest on surfaces: rests.hpp.
  [[gnu::noinline]] void note_rests(const Mask& lanes, const State& y);
  [[gnu::noinline]] Mask moves_none(auto m, const P& rate, const State& y) const;
  [[gnu::noinline]] Mask starts_at(auto m, const State& y) const;
  [[gnu::noinline]] Mask goes_back(auto m, const Mask& lanes, const State& y) const;
  [[gnu::noinline]] Mask is_met(auto m) const;
  bool any_rest() const { return (f_.jumps_end > 0 || f_.dependence.any_steep()) && any_rest_; }
  void keep_resting(Surfaces& middle_value);
  Mask rests_along(auto m) const;
  [[gnu::noinline]] void depart(auto m, const Mask& lanes, const State& y);
  [[gnu::noinline]] void end_rests(const Mask& taken);

  // Held on steep surfaces, and beside them: holds.hpp.
  struct BroughtBack {
    Mask lanes;
    P rate[2];  // of h on the sides 1 and -1
  };
  [[gnu::noinline]] BroughtBack brought_back(auto m, const Mask& lanes, const State& y, double share) const;
  [[gnu::noinline]] Mask comes_to_hold(auto m, const Mask& lanes) const;
  [[gnu::noinline]] Mask meet_steep(auto m, const Mask& lanes, const State& y);
  [[gnu::noinline]] void place_beside(auto m, const Mask& lanes, State& y);
  [[gnu::noinline]] void start_on_steep(State& y, const P& duration);
  [[gnu::noinline]] void hold_on(const Retyped<Side, Mask>& met, const State& y, const P& span);

  // States that are set anew: resets.hpp.
  [[gnu::noinline]] Mask anew_on_sides(const Mask& lanes, const State& y, const Side& side) const;
  Mask sets_anew(auto m, const Mask& lanes, const State& y) const;
  [[gnu::noinline]] Mask one_sets_anew(const Mask& lanes, const Retyped<Side, Mask>& met, const State& y, Mask& at_once);
  [[gnu::noinline]] void end_turn(const Mask& lanes, const State& y);
  [[gnu::noinline]] void start_resets(State& y, const P& duration);
  [[gnu::noinline]] Mask set_anew(const Mask& lanes, State& y, const P& surface, const P& duration);
  [[gnu::noinline]] void choose_sides(const Mask& lanes, const State& y, const Surfaces& before, const P& surface,
                                      const P& duration);
  [[gnu::noinline]] void take_places(const Mask& lanes, const State& y);
  [[gnu::noinline]] void name_pile_up(const Mask& lanes);

  void stop(const Mask& lanes, Status status) {
    if (!any(lanes)) return;
    for (int lane = 0; lane < Lanes::width; ++lane)
      if (Lanes::get(lanes, lane)) outcome_.status[lane] = status;
    if (f_.resets > 0 && (status == Status::grazes_jump || status == Status::step_limit)) name_pile_up(lanes);
    running_ = running_ & !lanes;
  }

  const Equation& f_;
  Tolerance tolerance_;
  double weight_;
  double landing_;  // how near to a kink a step must end to be moved onto it, as a share of the step
  Outcome<P> outcome_;
  Steps<Equation>* steps_ = nullptr;
  const Side *from_ = nullptr, *met_ = nullptr;

  // Where the lanes are.
  Mask running_, rejected_;   // rejected: the last try failed its error test
  Mask broken_;               // a try was not finite
  P time_, step_size_, cap_;  // cap: a limit for the next try alone
  P wished_;                  // the size that the error of the last try asked for
  P past_{0.0};               // how long after that time what ends the trajectory is met
  Side side_;
  Surfaces value_,
      rate_;              // of the surfaces at the start of the step, rates per second; of a slide, what holds it (sliding.hpp)
  bool slide_ = false;    // any lane slides on a jump
  bool several_ = false;  // any lane slides on several
  P turns_;               // how many jumps were met
  Retyped<Side, Mask> leaving_;  // a slide on this jump has just ended, or begins with no more than what holds it
  Retyped<Side, Mask> resting_;  // the trajectory lies on this surface, which does not move on the side where it is
  bool any_rest_ = false;
  P span_, first_try_;  // the duration, and the size of the first step that is tried

  ShelfVector<Held> holds_;

  // Of models that set states anew (resets.hpp).
  ShelfVector<P> held_;
  ShelfVector<SetAnew> resets_;
  ShelfVector<Mask> put_on_;  // the state lies on this jump since
  P reset_on_;                // the jump that is met at the start
  P last_reset_, interval_;   // when it was last, and how long after the one before
  P quick_, shorter_;         // how often in a row at once, and ever sooner

  // Of stiff lanes.
  bool any_stiff_ = false;
  Mask stiff_, implicit_;  // implicit: the step that is tried
  P stiff_signs_, others_;
  std::optional<ImplicitStep<Equation>> implicit_step_;

  // The step that is tried.
  Mask ends_;               // it reaches the end of the trajectory
  P step_, squared_error_;  // by which it is judged
  P told_error_;            // what it tells about the next one
  Mask behind_kink_;        // it begins where f is not smooth
  State stage_[Method::stages], end_;
  Surfaces end_value_, end_rate_;
  // Of every surface along the step, positive on its own side; and where the step ends next to a kink.
  Retyped<Surfaces, Quartic<P>> along_;
  Surfaces beside_;  // how far the surfaces' values were seen off that, where they were
  Retyped<Side, Mask> landed_;
  Mask several_landed_;  // next to several surfaces at once, one of them a jump
};

// Not inline: where an explicit instantiation is declared, nothing of the integrator is compiled.
template <class Equation, class Method>
auto Integrator<Equation, Method>::run(State& y, const P& duration, const P& first_step, Steps<Equation>* steps,
                                       const Mask& stiff, const Side* from) -> Outcome<P> {
  steps_ = steps;
  from_ = from;
  begin(y, duration, first_step);
  set_stiff(tolerance_.method == MethodName::Radau ? !Lanes::none() : stiff);
  if (f_.holds_end > f_.jumps_end) start_on_steep(y, duration);
  while (any(running_)) {
    if (++outcome_.attempts > tolerance_.max_attempts) {
      stop(running_ & (turns_ > P(0.05 * tolerance_.max_attempts)), Status::chatters);
      stop(running_, Status::step_limit);
      break;
    }
    attempt(y, duration);
    control(y, duration);
  }
  outcome_.next_step = step_size_;
  outcome_.lasted = time_ + past_;
  outcome_.stiff = stiff_;
  if (f_.jumps_end > 0) note_end(duration, y);
  return outcome_;
}

}  // namespace fisherpoint

#include "fisherpoint/integration/holds.hpp"
#include "fisherpoint/integration/jumps.hpp"
#include "fisherpoint/integration/limits.hpp"
#include "fisherpoint/integration/resets.hpp"
#include "fisherpoint/integration/rests.hpp"
#include "fisherpoint/integration/settle_sides.hpp"
#include "fisherpoint/integration/start.hpp"
#include "fisherpoint/integration/stiffness.hpp"
#include "fisherpoint/integration/surfaces.hpp"
