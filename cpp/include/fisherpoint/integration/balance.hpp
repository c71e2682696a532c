// Jumps on which as much holds a trajectory as moves it away: members of Integrator (integrator.hpp, which includes it at its
// end). What S is there: derivatives_at_jumps.hpp at a start, passing.hpp on the way.
#pragma once

#include "fisherpoint/integration/sliding_several.hpp"
#include "fisherpoint/integration/step_control.hpp"

namespace fisherpoint {

// Of lanes that are on jump m: where f leads onto it from one side, and along it on the other, to rounding, as where a force is
// that at which friction breaks off. How that changes decides: the jump holds them, or lets them go to the other side. Where it
// does not change they rest on that side.
template <class Equation, class Method>
auto Integrator<Equation, Method>::balance(auto m, const Mask& lanes, const P& r_plus, const P& r_minus, const State& y)
    -> Balance {
  const P zero(0.0);
  const auto none = [&](const P& rate, const P& other) {
    return (abs(rate) <= alike_rates * abs(other)) | moves_none(m, rate, y);
  };
  const Mask up = lanes & (r_minus > zero) & none(r_plus, r_minus),
             down = lanes & !up & (r_plus < zero) & none(r_minus, r_plus);
  Balance found{Mask(up | down), Lanes::none(), Lanes::none(), select(up, P(1.0), P(-1.0))};
  if (!any(found.lanes)) return found;
  Side held = side_;
  held[m] = select(found.lanes, zero, side_[m]);
  const BothSides<Equation> at(f_, y, held);
  State rates;
  fit(rates, f_.states);
  for_each_index(f_.states, [&](auto i) { rates[i] = at.sliding(i); });
  const P step = min(span_, starting_step(y)), across = at.r_minus - at.r_plus;
  found.decide(hold_span * step * hold_rate(y, rates, step, held), across);
  return found;
}

// balance() of jump m where others are on these sides or slide.
template <class Equation, class Method>
auto Integrator<Equation, Method>::balance_of_several(int m, const Mask& lanes, const Side& settled, const State& y)
    -> Balance {
  Balance found{lanes, Lanes::none(), Lanes::none(), settled[m]};
  Side held = settled;
  held[m] = select(lanes, P(0.0), settled[m]);
  const SeveralSlides<Equation> at(f_, y, held, lanes);
  const P step = min(span_, starting_step(y));
  const ShelfVector<P> rate = hold_rates(lanes, y, at.rate, step, held);
  for (int j = 0; j < at.count(); ++j) {
    if (at.jumps[j] != m) continue;
    found.decide(hold_span * step * rate[j], at.across(j));
  }
  return found;
}

}  // namespace fisherpoint
