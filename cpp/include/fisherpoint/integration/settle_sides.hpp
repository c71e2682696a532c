// What the stepping loop does where a trajectory is on several jumps at once: members of Integrator (integrator.hpp, at whose
// end it is included). The order in which jumps are met that do not touch each other's rates does not matter; where joints or
// legs come to rest together, all sides follow from one small problem (box_sides.hpp).
#pragma once

#include "fisherpoint/integration/box_sides.hpp"
#include "fisherpoint/integration/sliding_several.hpp"
#include "fisherpoint/integration/step_control.hpp"

namespace fisherpoint {

// f beside several jumps, as far as each of them adds to it: on the sides 1 of all of them, what the sides add, and the rates
// of every h that these make.
template <class Equation>
class Additions {
  using P = typename Equation::Number;
  using State = typename Equation::State;
  using Side = typename Equation::Side;
  using Surfaces = typename Equation::Surfaces;
  using Mask = mask_of_lanes<P>;

 public:
  ShelfVector<int> jumps;
  Surfaces up;                   // rates on the sides 1
  ShelfVector<Surfaces> growth;  // of each jump
  ShelfVector<Mask> none;        // where it adds nothing to f
  // Where rates, or f itself, are other than the sum for two of the jumps.
  Mask rates_hang_together = lanes_of<P>::none(), f_hangs_together = lanes_of<P>::none();

  // `on`: the jumps that each lane is on.
  Additions(const Equation& f, const State& x, const Side& side, const Retyped<Side, Mask>& on, const Mask& lanes)
      : f_(f), off_(f, x, hold_height, [&](int m) { return on[m] & lanes; }), plus_(side) {
    for (int m = 0; m < f.holds_end; ++m)
      if (any(on[m] & lanes)) jumps.push_back(m);
    for (const int m : jumps) plus_[m] = select(on[m], P(1.0), plus_[m]);
    base_ = rates(plus_);
    up = f.surface_rates(x, base_);
    for (const int m : jumps) {
      State d = rates(with(plus_, m, on));
      Mask same = on[m];
      for_each_index(f.states, [&](auto i) {
        const P size = abs(base_[i]) + abs(d[i]);
        d[i] = base_[i] - d[i];
        same = same & (abs(d[i]) <= 1e-13 * size);
      });
      none.push_back(same);
      growth.push_back(f.surface_rates(x, d));
      d_.push_back(d);
    }
    for (int a = 0; a < count(); ++a)
      for (int b = 0; b < a; ++b) compare(a, b, on);
  }

  int count() const { return static_cast<int>(jumps.size()); }

  // Rates of every h on these sides of `jumps`, by the bits of `which`: 1 for the side -1.
  Surfaces rates_on(unsigned which, const Retyped<Side, Mask>& on) const {
    Side tried = plus_;
    for (int j = 0; j < count(); ++j)
      if (which >> j & 1) tried = with(tried, jumps[j], on);
    return f_.surface_rates(off_.at(tried), rates(tried));
  }

 private:
  // Beside a root's surface rates are known no better, as states are rounded by so much of the height there.
  static constexpr double alike = 1e-9, alike_beside_roots = 1e-3;

  State rates(const Side& side) const {
    State dx;
    fit(dx, f_.states);
    f_.derivative(off_.at(side), side, dx);
    return dx;
  }
  static Side with(Side side, int m, const Retyped<Side, Mask>& on) {
    side[m] = select(on[m], P(-1.0), side[m]);
    return side;
  }

  void compare(int a, int b, const Retyped<Side, Mask>& on) {
    State off = rates(with(with(plus_, jumps[a], on), jumps[b], on));
    const double share = f_.dependence.steep(jumps[a]) || f_.dependence.steep(jumps[b]) ? alike_beside_roots : alike;
    for_each_index(f_.states, [&](auto i) {
      const P sum = base_[i] - d_[a][i] - d_[b][i], size = abs(base_[i]) + abs(d_[a][i]) + abs(d_[b][i]) + abs(off[i]);
      off[i] -= sum;
      f_hangs_together = f_hangs_together | (on[jumps[a]] & on[jumps[b]] & !(abs(off[i]) <= share * size));
    });
    const Surfaces more = f_.surface_rates(off_.at(plus_), off);
    for (const int m : jumps) {
      P size = abs(up[m]);
      for (const Surfaces& of : growth) size += abs(of[m]);
      rates_hang_together = rates_hang_together | (on[jumps[a]] & on[jumps[b]] & on[m] & !(abs(more[m]) <= share * size));
    }
  }

  const Equation& f_;
  BesideSteep<Equation> off_;
  Side plus_;
  State base_;
  ShelfVector<State> d_;
};

// Lanes that are on several jumps, those that they have met, or have held them so far, and those that they slide on: all sides
// at once. Where there are none, or more than one set of them, they end.
template <class Equation, class Method>
void Integrator<Equation, Method>::settle_sides(const Mask& lanes, const Retyped<Side, Mask>& met, const State& y,
                                                const P& span, Status otherwise, bool at_start) {
  Retyped<Side, Mask> on = met, leaves = met;
  for_each_index(Count<0>{}, f_.holds_end, [&](auto m) {
    on[m] = lanes & (met[m] | slides(side_[m]));
    leaves[m] = lanes & met[m] & slides(side_[m]);
    turns_ += select(lanes & met[m], P(1.0), P(0.0));
  });
  const Additions<Equation> all(f_, y, side_, on, lanes);
  Side opens = side_;
  if (any(several_slides<P>(f_, side_) & lanes)) {
    const SeveralSlides<Equation> at(f_, y, side_, lanes);
    for (int j = 0; j < at.count(); ++j) opens[at.jumps[j]] = at.opens(j);
  } else {
    const BothSides<Equation> at(f_, y, side_);
    const P side = select(abs(at.r_plus) < abs(at.r_minus), P(1.0), P(-1.0));
    for (const int m : all.jumps) opens[m] = side;
  }
  // Jumps at which f does not jump now, and across which nothing moves: they stay on the side where they are about to go.
  Retyped<Side, Mask> stays = met;
  Side settled = side_;
  for (int j = 0; j < all.count(); ++j) {
    const int m = all.jumps[j];
    P moves = abs(all.up[m]);
    for (const Surfaces& of : all.growth) moves += abs(of[m]);
    stays[m] = on[m] & all.none[j] & (moves * span <= on_surface * natural_height(f_, m, y));
    if (any(stays[m])) settled[m] = select(stays[m], at_start ? side_past(m, y, span) : side_[m], side_[m]);
    leaving_[m] = leaving_[m] | stays[m];
  }
  Mask unsure = lanes & all.rates_hang_together, lost = Lanes::none();
  Retyped<Side, Mask> even = met;
  even.fill(Lanes::none());
  for (int lane = 0; lane < Lanes::width; ++lane) {
    if (!Lanes::get(lanes, lane) || Lanes::get(unsure, lane)) continue;
    ShelfVector<int> own;  // places in all.jumps
    for (int j = 0; j < all.count(); ++j)
      if (Lanes::get(on[all.jumps[j]], lane)) own.push_back(j);
    const int n = static_cast<int>(own.size());
    std::vector<double> r0(n), r(n * n);
    for (int i = 0; i < n; ++i) {
      r0[i] = Lanes::get(all.up[all.jumps[own[i]]], lane);
      for (int j = 0; j < n; ++j) {
        r[i * n + j] = 0.5 * Lanes::get(all.growth[own[j]][all.jumps[own[i]]], lane);
        r0[i] -= r[i * n + j];
      }
    }
    BoxSides as_they_leave(n, r0, r);
    std::vector<int> leaving;
    std::vector<bool> waits(n);
    for (int i = 0; i < n; ++i) {
      const int m = all.jumps[own[i]];
      waits[i] = Lanes::get(stays[m], lane);
      if (waits[i]) {
        as_they_leave.set(i, Lanes::get(settled[m], lane));
      } else if (Lanes::get(leaves[m], lane)) {
        as_they_leave.set(i, Lanes::get(opens[m], lane));
        leaving.push_back(i);
      }
    }
    bool solved = as_they_leave.solve();
    for (const int i : leaving) solved = solved && as_they_leave.stays(i, 1e-3);
    BoxSides sides = as_they_leave;
    if (!solved && !leaving.empty()) {
      sides = BoxSides(n, r0, r);
      for (int i = 0; i < n; ++i)
        if (waits[i]) sides.set(i, as_they_leave[i]);
      solved = sides.solve();
    }
    int held = 0;
    for (int i = 0; i < n && solved; ++i) {
      Lanes::set(settled[all.jumps[own[i]]], lane, sides[i]);
      Lanes::set(even[all.jumps[own[i]]], lane, sides.even(i));
      held += sides[i] == 0.0;
    }
    // A slide on several has one f alone where their sides add to it one by one.
    if (!solved || (held > 1 && Lanes::get(all.f_hangs_together, lane))) Lanes::set(lost, lane, true);
  }
  if (any(unsure)) cross_all(unsure, all, on, settled, lost);
  Retyped<Side, Mask> lets_go = even;
  for (const int m : all.jumps) {
    if (!any(even[m])) continue;
    const Balance found = balance_of_several(m, even[m], settled, y);
    settled[m] = select(found.holds, P(0.0), settled[m]);
    lost = lost | (found.holds & all.f_hangs_together);
    lets_go[m] = found.lets_go;
    leaving_[m] = leaving_[m] | found.holds | found.lets_go;
  }
  for (const int m : all.jumps) {
    if (at_start && m < f_.jumps_end)
      outcome_.starts_on_jump =
          outcome_.starts_on_jump | (lanes & met[m] & !stays[m] & !lets_go[m] & !lost & !slides(settled[m]));
    else if (m < f_.jumps_end)
      stop(on[m] & !lost & (settled[m] * side_[m] > P(0.5)), Status::grazes_jump);
    leaving_[m] = leaving_[m] | (leaves[m] & !slides(settled[m]));
    side_[m] = select(on[m] & !lost, settled[m], side_[m]);
  }
  stop(lost, otherwise);
  see_slides();
}

// The lanes that have met a jump while they are on another one, which they have met too or slide on.
template <class Equation, class Method>
auto Integrator<Equation, Method>::on_several(const Retyped<Side, Mask>& met) const -> Mask {
  Mask any_met = Lanes::none(), once = any_met, twice = any_met;
  for_each_index(Count<0>{}, f_.holds_end, [&](auto m) {
    const Mask on = met[m] | slides(side_[m]);
    any_met = any_met | met[m];
    twice = twice | (once & on);
    once = once | on;
  });
  return any_met & twice;
}

// What hold() and watch_hold() do of one slide.
template <class Equation, class Method>
void Integrator<Equation, Method>::hold_several(const Mask& lanes, const State& middle, Surfaces& middle_value) {
  const SeveralSlides<Equation> at(f_, end_, side_, lanes), half(f_, middle, side_, lanes);
  const ShelfVector<P> rate = hold_rates(lanes, end_, stage_[last()], step_, side_);
  at.take_back(end_value_, lanes, side_, end_);
  for (int j = 0; j < at.count(); ++j) {
    const int m = at.jumps[j];
    const Mask on = lanes & slides(side_[m]);
    middle_value[m] = select(on, half.hold(j), middle_value[m]);
    end_value_[m] = select(on, at.hold(j), end_value_[m]);
    end_rate_[m] = select(on, rate[j], end_rate_[m]);
  }
}

template <class Equation, class Method>
void Integrator<Equation, Method>::watch_several(const Mask& lanes, const State& y, const P& span) {
  const SeveralSlides<Equation> at(f_, y, side_, lanes);
  const ShelfVector<P> rate = hold_rates(lanes, y, stage_[0], span, side_);
  for (int j = 0; j < at.count(); ++j) {
    const int m = at.jumps[j];
    const Mask on = lanes & slides(side_[m]);
    value_[m] = select(on, select(leaving_[m], max(at.hold(j), P(0.0)), at.hold(j)), value_[m]);
    rate_[m] = select(on, rate[j], rate_[m]);
  }
}

template <class Equation, class Method>
auto Integrator<Equation, Method>::hold_rates(const Mask& lanes, const State& x, const State& rates, const P& span,
                                              const Side& side) const -> ShelfVector<P> {
  State before = x, after = x;
  const P by = hold_span * span;
  for_each_index(f_.states, [&](auto i) {
    before[i] -= by * rates[i];
    after[i] += by * rates[i];
  });
  const SeveralSlides<Equation> first(f_, before, side, lanes), second(f_, after, side, lanes);
  ShelfVector<P> rate;
  for (int j = 0; j < first.count(); ++j) rate.push_back((second.hold(j) - first.hold(j)) / (2.0 * by));
  return rate;
}

// Where rates hang on pairs of sides: a lane crosses all jumps of which h goes one way on every side of the others.
template <class Equation, class Method>
void Integrator<Equation, Method>::cross_all(const Mask& lanes, const Additions<Equation>& all, const Retyped<Side, Mask>& on,
                                             Side& settled, Mask& lost) const {
  constexpr int most = 5;
  if (all.count() > most) {
    lost = lost | lanes;
    return;
  }
  Surfaces least = all.up, largest = all.up;
  for (unsigned which = 1; which < 1u << all.count(); ++which) {
    const Surfaces rate = all.rates_on(which, on);
    for (const int m : all.jumps) {
      least[m] = min(least[m], rate[m]);
      largest[m] = max(largest[m], rate[m]);
    }
  }
  for (const int m : all.jumps) {
    const Mask up = least[m] > P(0.0), down = largest[m] < P(0.0);
    settled[m] = select(lanes & on[m], select(up, P(1.0), P(-1.0)), settled[m]);
    lost = lost | (lanes & on[m] & !(up | down));
  }
}

}  // namespace fisherpoint
