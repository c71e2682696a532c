// Sliding along several jumps at once: two joints that rest, six legs that stick. With f(+) on the sides 1 of all jumps that a
// lane slides on, and d_j what the side of jump j adds,
//
//     x' = f(+) - sum_j b_j d_j,    h_i,x x' = 0 for each of them,
//
// is linear in the shares b_j in [0, 1], as long as the jumps add to f one by one (settle_sides.hpp looks whether they do).
#pragma once

#include "fisherpoint/integration/sliding.hpp"
#include "fisherpoint/numbers/elimination.hpp"
#include "fisherpoint/numbers/shelves.hpp"

namespace fisherpoint {

// The lanes that slide on more than one jump.
template <class P>
[[gnu::noinline]] mask_of_lanes<P> several_slides(const auto& shape, const auto& side) {
  auto once = lanes_of<P>::none(), twice = once;
  for_each_index(Count<0>{}, shape.holds_end, [&](auto m) {
    const auto here = slides<P>(side[m]);
    twice = twice | (once & here);
    once = once | here;
  });
  return twice;
}

// The jumps that any of these lanes slides on.
template <class P>
ShelfVector<int> slid_jumps(const auto& shape, const auto& side, const mask_of_lanes<P>& lanes) {
  ShelfVector<int> found;
  for (int m = 0; m < shape.holds_end; ++m)
    if (any(slides<P>(side[m]) & lanes)) found.push_back(m);
  return found;
}

template <class Equation>
class SeveralSlides {
  using P = typename Equation::Number;
  using State = typename Equation::State;
  using Side = typename Equation::Side;
  using Surfaces = typename Equation::Surfaces;
  using Mask = mask_of_lanes<P>;

 public:
  ShelfVector<int> jumps;  // those that any of `lanes` slides on; what follows is of them
  State rate;              // x', of lanes that slide

  SeveralSlides(const Equation& f, const State& x, const Side& side, const Mask& lanes)
      : jumps(slid_jumps<P>(f, side, lanes)), f_(f), system_(count()) {
    fit(rate, f.states);
    const Side plus = beside<P>(f, side, 1.0);
    const BesideSteep<Equation> off(f, x, side);
    f.derivative(off.at(plus), plus, rate);
    const Surfaces up = f.surface_rates(x, rate);
    for (const int m : jumps) {
      Side tried = plus;
      tried[m] = select(slides<P>(side[m]), P(-1.0), tried[m]);
      State d = rate;
      f.derivative(off.at(tried), tried, d);
      for_each_index(f.states, [&](auto i) { d[i] = rate[i] - d[i]; });
      d_.push_back(d);
    }
    for (int j = 0; j < count(); ++j) {
      const Surfaces growth = f.surface_rates(x, d_[j]);
      for (int i = 0; i < count(); ++i) {
        const P unit(i == j ? 1.0 : 0.0);
        system_(i, j) = select(slides<P>(side[jumps[i]]), growth[jumps[i]], unit);
      }
      own_.push_back(select(slides<P>(side[jumps[j]]), growth[jumps[j]], P(0.0)));
    }
    system_.factorise();
    for (const int m : jumps) share_.push_back(select(slides<P>(side[m]), up[m], P(0.0)));
    system_.solve(share_.data());
    for (int j = 0; j < count(); ++j) for_each_index(f.states, [&](auto i) { rate[i] -= share_[j] * d_[j][i]; });
  }

  int count() const { return static_cast<int>(jumps.size()); }

  // Positive while jump jumps[j] holds, as of one alone (sliding.hpp).
  P hold(int j) const {
    const P part(f_.dependence.steep(jumps[j]) ? hold_margin : 0.0);
    const P product = (share_[j] + part) * (P(1.0) - share_[j] + part) * own_[j] * own_[j];
    return select(own_[j] < P(0.0), product, -abs(product));
  }

  // By how much the rate of its h differs between both sides.
  P across(int j) const { return own_[j]; }

  // The side that opens where it does not hold any more.
  P opens(int j) const { return select(share_[j] < P(0.5), P(1.0), P(-1.0)); }

  // Takes x back onto the surfaces, whose values these are, in these lanes.
  void take_back(const Surfaces& value, const Mask& lanes, const Side& side, State& x) const {
    ShelfVector<P> off;
    for (const int m : jumps) off.push_back(select(lanes & slides<P>(side[m]), value[m], P(0.0)));
    system_.solve(off.data());
    for (int j = 0; j < count(); ++j)
      for_each_index(f_.states, [&](auto i) { x[i] = select(lanes, x[i] - off[j] * d_[j][i], x[i]); });
  }

 private:
  const Equation& f_;
  ShelfVector<State> d_;
  Elimination<P> system_;  // h_i,x d_j
  ShelfVector<P> own_;     // h_j,x d_j
  ShelfVector<P> share_;   // b
};

// f on these sides, of lanes that slide along the slide.
template <class Equation>
[[gnu::noinline]] void rates_along(const Equation& f, const typename Equation::State& x, const typename Equation::Side& side,
                                   typename Equation::State& dx) {
  using P = typename Equation::Number;
  f.derivative(x, beside<P>(f, side, 1.0), dx);  // of lanes that slide on none
  const auto several = several_slides<P>(f, side), on = any_slides<P>(f, side) & !several;
  if (any(several)) {
    const SeveralSlides<Equation> at(f, x, side, several);
    for_each_index(f.states, [&](auto i) { dx[i] = select(several, at.rate[i], dx[i]); });
  }
  if (!any(on)) return;
  const BothSides<Equation> at(f, x, side);
  for_each_index(f.states, [&](auto i) { dx[i] = select(on, at.sliding(i), dx[i]); });
}

}  // namespace fisherpoint
