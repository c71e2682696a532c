// Held on surfaces where f takes a root of what is zero there, and beside them: members of Integrator (integrator.hpp, which
// includes it at its end). Where f brings a trajectory back from both sides it stays on the surface, as one that slides along a
// jump (beside_steep.hpp): two tanks at equal levels, a tank that is empty. Where it comes to lie so near to it that steps of
// the tolerance do not see it, it goes on by implicit steps from where the root balances what drives it.
#pragma once

#include "fisherpoint/integration/beside_steep.hpp"
#include "fisherpoint/integration/step_control.hpp"

namespace fisherpoint {

// Of these lanes those that f brings back to surface m from both sides, at this share of its natural height.
template <class Equation, class Method>
auto Integrator<Equation, Method>::brought_back(auto m, const Mask& lanes, const State& y, double share) const -> BroughtBack {
  const int here = m;
  const BesideSteep<Equation> off(f_, y, 1.0, [&](int n) { return n == here ? lanes : lanes & slides(side_[n]); });
  const P size = natural_height(f_, m, y), own = f_.surface_values(y)[m] / size;
  State rates;
  fit(rates, f_.states);
  BroughtBack found{Lanes::none(), {P(0.0), P(0.0)}};
  for (const int which : {0, 1}) {
    Side tried = side_;
    tried[m] = select(lanes, P(1.0 - 2.0 * which), side_[m]);
    Side at = tried;
    at[m] = share * tried[m] - own;
    derivative(off.at(at, here), tried, rates);
    found.rate[which] = f_.surface_rates(y, rates)[m];
  }
  const P apart = found.rate[1] - found.rate[0], margin = hold_margin * apart;
  const Mask soon = apart * (hold_haste * span_) > share * size;
  found.lanes = lanes & soon & (found.rate[0] < margin) & (found.rate[1] > P(0.0) - margin);
  return found;
}

// Where a step ends so near to steep surface m that it is held there.
template <class Equation, class Method>
auto Integrator<Equation, Method>::comes_to_hold(auto m, const Mask& lanes) const -> Mask {
  const Mask near = lanes & (abs(end_value_[m]) <= hold_height * natural_height(f_, m, end_));
  return any(near) ? brought_back(m, near, end_, hold_height).lanes : near;
}

// Lanes that have landed on steep kink m. Returns those that are to be held there; the others go to the side to which f leads.
template <class Equation, class Method>
auto Integrator<Equation, Method>::meet_steep(auto m, const Mask& lanes, const State& y) -> Mask {
  const Mask leaves = lanes & slides(side_[m]), arrives = lanes & !leaves;
  const auto near = brought_back(m, lanes, y, hold_height);
  const Mask held = near.lanes & !leaves, open = arrives & !held;
  const P towards = select(abs(near.rate[0]) < abs(near.rate[1]), P(1.0), P(-1.0));
  Mask stays = Lanes::none();
  if (any(open)) {
    stays = goes_back(m, open, y);
    // Where both sides lead to one, it is that, whatever the steps of the tolerance have seen.
    const Mask up = open & (near.rate[0] > P(0.0)) & (near.rate[1] > P(0.0)),
               down = open & (near.rate[0] < P(0.0)) & (near.rate[1] < P(0.0));
    side_[m] = select(up, P(1.0), select(down, P(-1.0), select(open & !stays, -side_[m], side_[m])));
  }
  side_[m] = select(leaves, towards, side_[m]);
  turns_ += select(held | leaves, P(1.0), P(0.0));
  if (steps_ && any(held)) {  // a distance that falls like the square of the time that is left
    const double height = std::sqrt(hold_height * std::max(0.1 * tolerance_.relative, least_distinct_height));
    const P instant = (2.0 * height) * natural_height(f_, m, y) / max(abs(near.rate[0]), abs(near.rate[1]));
    holds_.push_back({steps_->size(), select(held, instant, P(0.0))});
  }
  return held;
}

// Of lanes that lie on steep kink m without being held: those that stay nearer to it than the tolerance go on by implicit steps
// from where the root balances what drives them, and so do others that are stiff, from beside it, where f_x is finite.
template <class Equation, class Method>
void Integrator<Equation, Method>::place_beside(auto m, const Mask& lanes, State& y) {
  const double most = 0.1 * tolerance_.relative;
  Mask near = Lanes::none();
  if (most > hold_height) near = brought_back(m, lanes, y, most).lanes;
  if (any(near)) set_stiff(stiff_ | near);
  const Mask beside = lanes & stiff_;
  if (!any(beside)) return;
  const int here = m;
  const BesideSteep<Equation> off(f_, y, 1.0, [&](int n) { return n == here ? beside : beside & slides(side_[n]); });
  State rates;
  fit(rates, f_.states);
  Side at = side_;
  const P own = f_.surface_values(y)[m] / natural_height(f_, m, y);
  P low(hold_height), high = select(near, P(most), P(hold_height));
  for (int k = 0; k < 10 && any(near); ++k) {
    const P middle = sqrt(low * high);
    at[m] = side_[m] * middle - own;
    derivative(off.at(at, here), rates);
    const Mask further = side_[m] * f_.surface_rates(y, rates)[m] > P(0.0);
    low = select(further, middle, low);
    high = select(further, high, middle);
  }
  at[m] = side_[m] * sqrt(low * high) - own;
  y = off.at(at, here);
}

// Of trajectories that start on such kinks.
template <class Equation, class Method>
void Integrator<Equation, Method>::start_on_steep(State& y, const P& duration) {
  auto met = landed_;
  Mask on = Lanes::none();
  for_each_index(f_.jumps_end, f_.holds_end, [&](auto m) {
    const Mask here = running_ & !(abs(value_[m]) > P(0.0));
    met[m] = any(here) ? brought_back(m, here, y, hold_height).lanes : here;
    on = on | here;
    resting_[m] = resting_[m] & !met[m];
  });
  if (!any(on)) return;
  hold_on(met, y, duration);
  for_each_index(f_.jumps_end, f_.holds_end, [&](auto m) {
    const Mask beside = running_ & !(abs(value_[m]) > P(0.0)) & !met[m] & !resting_[m];
    if (any(beside)) place_beside(m, beside, y);
  });
  const Surfaces value = f_.surface_values(y, side_);
  for_each_index(f_.jumps_end, f_.holds_end,
                 [&](auto m) { value_[m] = select(on & !slides(side_[m]) & !resting_[m], value[m], value_[m]); });
  start_anew(on & running_, y, duration);
}

// Holds lanes on the surfaces that they have met, beside others on which they slide or are held.
template <class Equation, class Method>
void Integrator<Equation, Method>::hold_on(const Retyped<Side, Mask>& met, const State& y, const P& span) {
  const Mask several = on_several(met) & running_;
  if (any(several)) settle_sides(several, met, y, span, Status::two_jumps);
  for_each_index(f_.jumps_end, f_.holds_end,
                 [&](auto m) { side_[m] = select(met[m] & running_ & !several, P(0.0), side_[m]); });
  see_slides();
}

}  // namespace fisherpoint
