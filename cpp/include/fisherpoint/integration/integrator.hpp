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

#include "fisherpoint/integration/dense_output.hpp"
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
#include "fisherpoint/numbers/parts.hpp"
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
      : f_(equation),
        method_(method_of<Method>(tolerance)),
        tolerance_(tolerance),
        weight_(tolerance.step_weight()),
        weight_of_lanes_(weight_),
        landing_(0.1 * std::sqrt(tolerance.relative)) {
    for (int s = 0; s < method_.stages; ++s) fit(stage_[s], f_.states);
    fit(end_, f_.states);
    fit(nearest_, f_.states);
    fit(side_, f_.sides);
    fit(landed_, f_.sides);
    fit(leaving_, f_.sides);
    fit(resting_, f_.sides);
    fit(along_, f_.surfaces);
    fit(beside_, f_.surfaces);
    fit(near_, f_.sides);
    if constexpr (has_resets<Equation>) {
      held_.assign(f_.resets, P(-1.0));
      put_on_.assign(f_.resets > 0 ? int{f_.jumps_end} : 0, Lanes::none());
    }
  }

  // Integrates y over `duration`, a lane of duration 0 rests; y becomes the last state that was reached. Where `first_step` is
  // 0 the integrator chooses it. The steps that are taken are added to `steps`; lanes of `stiff` begin with implicit ones.
  // `from`: the sides of jumps from which trajectories come, 0 of a slide; without it, and at `unknown_side`, the start tells.
  // `samples`: where the states on the way are noted, by a method that has dense output.
  Outcome<P> run(State& y, const P& duration, const P& first_step, Steps<Equation>* steps = nullptr,
                 const Mask& stiff = Lanes::none(), const Side* from = nullptr, Samples<P>* samples = nullptr);

  const Side& sides() const { return side_; }
  // Of every reset: whether its condition held before the start, -1 where that is not known, and now.
  ShelfVector<P>& held() { return held_; }
  const ShelfVector<SetAnew>& resets() const { return resets_; }
  const ShelfVector<Held>& holds() const { return holds_; }
  // The sides on which such a run begins if it is on every jump that is `met`, 1 there and 0 elsewhere; y as what is set anew
  // at once leaves it.
  Side sides_from(State y, const P& duration, const Side& from, const Side& met, Mask& stopped, State* start = nullptr);

 private:
  // Where it starts: start.hpp.
  FISHERPOINT_HOT void begin(State& y, const P& duration, const P& first_step);
  P starting_step(const State& y);
  void leave_roots(const State& y, const P& duration);

  const P& squared_weight() const { return weight_of_lanes_; }
  auto last() const { return before(method_.stages); }  // the stage at the step's end

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

  // Tries one step of every running lane: the end, its error, and the surfaces at the middle and the end.
  FISHERPOINT_HOT void attempt(const State& y, const P& duration) {
    const P remaining = duration - time_, wanted = min(step_size_, cap_);
    const P longest = f_.order() ? min(last_stretch_with_order * step_size_, cap_) : wanted;
    ends_ = remaining <= longest * (1.0 + 1e-9);
    step_ = select(running_, select(ends_, remaining, wanted), P(0.0));
    State middle;
    fit(middle, f_.states);
    if (!any_stiff_ || any(running_ & !choose_implicit())) attempt_explicit(y, middle);
    if (any_stiff_ && any(implicit_)) attempt_implicit(y, middle);
    Surfaces middle_value;
    if (f_.surfaces > 0) middle_value = f_.surface_values(middle, side_);
    end_value_ = f_.surface_values(end_, side_);
    end_rate_ = f_.surface_rates(end_, stage_[last()], side_);
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
    const Mask good = running_ & (squared_error_ <= P(1.0));
    const bool watched = (f_.holds_end > 0 && slide_) || any_rest() || any(good & (brief_step(duration) | tiny_step(duration)));
    Mask wavering = Lanes::none(), nears_limit = Lanes::none();
    for_each_index(Count<0>{}, f_.kinks_end, [&](auto m) {
      wavering = wavering | along_[m].wavers();
      Mask off = along_[m].keeps_off();
      if (m < f_.jumps_end) off = off & !turns_towards(m);
      near_[m] = watched || f_.dependence.steep(m) || any(good & !off);
    });
    for_each_index(f_.kinks_end, f_.surfaces, [&](auto m) {
      wavering = wavering | along_[m].wavers();
      nears_limit = nears_limit | !along_[m].keeps_off();
    });
    near_limit_ = watched || any(good & nears_limit);
    beside_.fill(P(0.0));
    if (any(wavering & good)) look_beside(wavering & good, y, middle);
  }

  // Whether surface m is near a lane whose error is small enough; one that is near none has no part in the step's decision.
  bool may_matter(auto m) const { return m < f_.kinks_end ? near_[m] : near_limit_; }

  // Steps in which the side of a kink does not matter, and in which a jump is met.
  Mask brief_step(const P& duration) const { return step_ <= brief * duration; }
  Mask tiny_step(const P& duration) const { return step_ <= briefest * tolerance_.relative * duration; }
  // Where surface m is nearer somewhere on the way than at both ends.
  Mask turns_towards(auto m) const { return (along_[m].b1 <= along_[m].b0) & (along_[m].b3 <= along_[m].b4); }

  // Of what must be positive where g is measured: limits.hpp.
  [[gnu::noinline]] void judge_measured(const State& y);

  // An explicit step: explicit_step.hpp.
  template <class Q>
  struct Squares {  // of its errors and the states at its ends, in scales
    Q error{0.0}, coarse{0.0}, start{0.0}, end{0.0};
  };
  void attempt_explicit(const State& y, State& middle);
  template <class Q>
  void find_stages(const State& y);
  template <class Q>
  void sum_stages(int s, auto&& put);
  void judge_stages(const State& y, Squares<P>& squares) const;
  template <class Q>
  void find_middle(const State& y, State& middle) const;

  // Decides about the tried step, takes it where it is good, and chooses the next one: step_decision.hpp.
  FISHERPOINT_HOT void control(State& y, const P& duration);
  // States within a step that is taken: samples.hpp.
  [[gnu::noinline]] void sample(const Mask& taken, const P& tried, const State& y);

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
  [[gnu::noinline]] void watch_stiffness(const Mask& taken);
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

  // On jumps where as much holds as moves: balance.hpp.
  struct Balance {
    Mask lanes, holds, lets_go;
    P side;  // to which f leads along the jump

    // By how much what holds the slide changes, where rates of h on both sides differ by `across`.
    void decide(const P& change, const P& across) {
      const P seen = alike_rates * across * across;
      holds = lanes & (change > seen);
      lets_go = lanes & (change < -seen);
    }
  };
  [[gnu::noinline]] Balance balance(auto m, const Mask& lanes, const P& r_plus, const P& r_minus, const State& y);
  [[gnu::noinline]] Balance balance_of_several(int m, const Mask& lanes, const Side& settled, const State& y);

  // On several jumps at once: settle_sides.hpp.
  [[gnu::noinline]] Mask on_several(const Retyped<Side, Mask>& met) const;
  [[gnu::noinline]] void settle_sides(const Mask& lanes, const Retyped<Side, Mask>& met, const State& y, const P& span,
                                      Status otherwise, bool at_start = false);
  [[gnu::noinline]] void cross_all(const Mask& lanes, const Additions<Equation>& all, const Retyped<Side, Mask>& on,
                                   Side& settled, Mask& lost) const;
  [[gnu::noinline]] void hold_several(const Mask& lanes, const State& middle, Surfaces& middle_value);
  [[gnu::noinline]] void watch_several(const Mask& lanes, const State& y, const P& span);
  ShelfVector<P> hold_rates(const Mask& lanes, const State& x, const State& rates, const P& span, const Side& side) const;

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
  const Method& method_;
  Tolerance tolerance_;
  double weight_;
  P weight_of_lanes_;  // larger where steps are sampled
  double landing_;     // how near to a kink a step must end to be moved onto it, as a share of the step
  Outcome<P> outcome_;
  Steps<Equation>* steps_ = nullptr;
  Samples<P>* samples_ = nullptr;
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
  State stage_[Method::most_stages], end_;
  State nearest_;  // where the stage before the last one was, in time at the end too
  Surfaces end_value_, end_rate_;
  // Of every surface along the step, positive on its own side; and where the step ends next to a kink.
  Retyped<Surfaces, Quartic<P>> along_;
  Surfaces beside_;           // how far the surfaces' values were seen off that, where they were
  Retyped<Side, bool> near_;  // of jumps and kinks: may_matter
  bool near_limit_;           // of any limit or pole
  Retyped<Side, Mask> landed_;
  Mask several_landed_;  // next to several surfaces at once, one of them a jump
};

// Not inline: where an explicit instantiation is declared, nothing of the integrator is compiled.
template <class Equation, class Method>
auto Integrator<Equation, Method>::run(State& y, const P& duration, const P& first_step, Steps<Equation>* steps,
                                       const Mask& stiff, const Side* from, Samples<P>* samples) -> Outcome<P> {
  steps_ = steps;
  samples_ = samples;
  for (int lane = 0; samples && lane < Lanes::width; ++lane)
    if (!samples->lanes[lane].at.empty()) Lanes::set(weight_of_lanes_, lane, DenseOutput::weight * weight_);
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

#include "fisherpoint/integration/balance.hpp"
#include "fisherpoint/integration/explicit_step.hpp"
#include "fisherpoint/integration/holds.hpp"
#include "fisherpoint/integration/jumps.hpp"
#include "fisherpoint/integration/limits.hpp"
#include "fisherpoint/integration/resets.hpp"
#include "fisherpoint/integration/rests.hpp"
#include "fisherpoint/integration/samples.hpp"
#include "fisherpoint/integration/settle_sides.hpp"
#include "fisherpoint/integration/start.hpp"
#include "fisherpoint/integration/step_decision.hpp"
#include "fisherpoint/integration/stiffness.hpp"
#include "fisherpoint/integration/surfaces.hpp"
