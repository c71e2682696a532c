// Sliding along a jump, where f points at it from both sides (Filippov): with f+ and f- on the sides of h = 0 and r = h_x f,
//
//     x' = f- + a (f+ - f-),    a = r- / (r- - r+),
//
// keeps h' = 0, as long as r+ < 0 < r-. A trajectory's side is 0 on the jump that it slides on. Of
// several at once: sliding_several.hpp.
//
// Where f takes a root of what is zero on a surface, as sign(h) sqrt(|h|), it has no jump there, but one between both sides at
// any distance, however small: f+ and f- are those at a height that is rounding (beside_steep.hpp).
#pragma once

#include "fisherpoint/integration/beside_steep.hpp"
#include "fisherpoint/models/dependence.hpp"
#include "fisherpoint/numbers/lanes.hpp"
#include "fisherpoint/numbers/pack.hpp"
#include "fisherpoint/numbers/unroll.hpp"

namespace fisherpoint {

// The lanes that slide on any surface.
template <class P>
mask_of_lanes<P> any_slides(const auto& shape, const auto& side) {
  auto found = lanes_of<P>::none();
  for_each_index(Count<0>{}, shape.holds_end, [&](auto m) { found = found | slides<P>(side[m]); });
  return found;
}

// The sides with `side` in the place of 0.
template <class P, class Sides>
Sides beside(const auto& shape, Sides sides, double side) {
  for_each_index(Count<0>{}, shape.holds_end, [&](auto m) { sides[m] = select(slides<P>(sides[m]), P(side), sides[m]); });
  return sides;
}

// f on both sides of the surface that each lane slides on, and how fast h changes there. Lanes that slide on none have the same
// f twice, and rates of 0.
template <class Equation>
class BothSides {
  using P = typename Equation::Number;
  using State = typename Equation::State;
  using Side = typename Equation::Side;
  using Surfaces = typename Equation::Surfaces;

 public:
  State plus, minus;
  Surfaces up, down;  // rates of all surfaces there
  P r_plus{0.0}, r_minus{0.0};
  P margin{0.0};  // by how far a rate may point away: nothing flows out of an empty tank, to rounding

  BothSides(const Equation& f, const State& x, const Side& side) {
    fit(plus, f.states);
    fit(minus, f.states);
    const BesideSteep<Equation> off(f, x, side);
    const Side ahead = beside<P>(f, side, 1.0), behind = beside<P>(f, side, -1.0);
    f.derivative(off.at(ahead), ahead, plus);
    f.derivative(off.at(behind), behind, minus);
    up = f.surface_rates(x, plus);
    down = f.surface_rates(x, minus);
    for_each_index(Count<0>{}, f.holds_end, [&](auto m) {
      const auto here = slides<P>(side[m]);
      r_plus = select(here, up[m], r_plus);
      r_minus = select(here, down[m], r_minus);
      if (f.dependence.steep(m)) margin = select(here, max(hold_margin * (r_minus - r_plus), P(0.0)), margin);
    });
  }

  // Where surface m, which has this value and rate on the slide, is zero with the one that is slid on: a saturation beside its
  // clamp. Also where the slide has ended, and both of its rates have one sign. `noise()` is the rounding of its value.
  auto coincides(auto m, const P& value, const P& rate, const P& step, auto&& noise) const {
    const P part = 1e-9 * (abs(up[m]) + abs(down[m]));
    const auto moves_along = (abs(up[m] - down[m]) > part) & (abs(rate) <= part), on = abs(value) <= step * part;
    return any(moves_along & !on) ? moves_along & (on | (abs(value) <= noise())) : moves_along & on;
  }

  // Where f is the same on both, to rounding.
  auto alike(const Equation& f) const {
    auto same = !lanes_of<P>::none();
    for_each_index(f.states,
                   [&](auto i) { same = same & (abs(plus[i] - minus[i]) <= 1e-13 * (abs(plus[i]) + abs(minus[i]))); });
    return same;
  }

  auto holds() const { return (r_plus < margin) & (r_minus > P(0.0) - margin); }

  // Positive while it slides: -r+ r-, and negative where f points away on both sides too.
  P hold() const {
    const P product = -((r_plus - margin) * (r_minus + margin));
    return select(r_plus < r_minus, product, -abs(product));
  }

  // The rate of state i on the slide.
  P sliding(auto i) const { return minus[i] + r_minus / (r_minus - r_plus) * (plus[i] - minus[i]); }
};

// What changes of the states by their natural sizes make of h.
template <class Equation>
[[gnu::noinline]] auto natural_height(const Equation& f, auto m, const typename Equation::State& x) {
  using P = typename Equation::Number;
  typename Equation::State one;
  fit(one, f.states);
  one.fill(P(0.0));
  P size(0.0);
  for_each_index(f.states, [&](auto i) {
    one[i] = P(1.0 / f.inverse_scale(i));
    size += abs(f.surface_rates(x, one)[m]);
    one[i] = P(0.0);
  });
  return size;
}

// Starts that rounding has put below a limit at which f has a value: onto it, or as far inside.
template <class Equation>
[[gnu::noinline]] void take_onto_limits(const Equation& f, const mask_of_lanes<typename Equation::Number>& lanes,
                                        typename Equation::State& x) {
  using P = typename Equation::Number;
  for_each_index(f.sides, f.surfaces, [&](auto m) {
    if (!f.dependence.closed(m)) return;
    for (const double inside : {0.0, 1.0}) {  // of a difference, rounding may leave a little of it
      const P value = f.surface_values(x)[m];
      auto below = lanes & (value < P(0.0));
      if (!any(below)) return;
      const P height = on_surface * natural_height(f, m, x);
      below = below & (value >= P(0.0) - height);
      const auto normal = gradient_of(f, m, x);
      P sum(0.0);
      const auto move = [&](auto i) { return normal[i] * (1.0 / (f.inverse_scale(i) * f.inverse_scale(i))); };
      for_each_index(f.states, [&](auto i) { sum += normal[i] * move(i); });
      const P share = select(below & (sum > P(0.0)), (inside * height - value) / sum, P(0.0));
      for_each_index(f.states, [&](auto i) { x[i] += share * move(i); });
    }
  });
}

}  // namespace fisherpoint
