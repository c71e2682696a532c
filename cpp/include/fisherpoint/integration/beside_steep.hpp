// Places beside surfaces where f_x has no bounds, as f takes a root of what is zero there. A trajectory that f brings back from
// both sides stays on such a surface, as between two tanks at equal levels. With the root's factor k and what else moves h at
// the rate q, it lies where k sqrt(h) balances q, at h = (q / k)^2: nearer than a height that counts as rounding, it is held on
// the surface; from there on f_x is finite, and the trajectory goes on by implicit steps.
#pragma once

#include "fisherpoint/integration/step_control.hpp"
#include "fisherpoint/models/dependence.hpp"
#include "fisherpoint/numbers/elimination.hpp"
#include "fisherpoint/numbers/lanes.hpp"
#include "fisherpoint/numbers/pack.hpp"
#include "fisherpoint/numbers/shelves.hpp"
#include "fisherpoint/numbers/unroll.hpp"

namespace fisherpoint {

template <class P>
mask_of_lanes<P> slides(const P& side) {
  return abs(side) < P(0.5);
}

// The gradient of surface m by the states.
template <class Equation>
auto gradient_of(const Equation& f, int m, const typename Equation::State& x) {
  if constexpr (requires { f.jump(m, x); }) {
    return f.jump(m, x).by_state;
  } else {
    using P = typename Equation::Number;
    typename Equation::State one, gradient;
    fit(one, f.states);
    fit(gradient, f.states);
    one.fill(P(0.0));
    for_each_index(f.states, [&](auto i) {
      one[i] = P(1.0);
      gradient[i] = f.surface_rates(x, one)[m];
      one[i] = P(0.0);
    });
    return gradient;
  }
}

// Of the steep surfaces that lanes are on: moves of the states that change the value of each by `height`, and not that of the
// others.
template <class Equation>
class BesideSteep {
  using State = typename Equation::State;
  using Side = typename Equation::Side;
  using P = std::remove_cvref_t<decltype(std::declval<State>()[0])>;
  using Mask = mask_of_lanes<P>;

 public:
  // Of the lanes that slide on these sides.
  BesideSteep(const Equation& f, const State& x, const Side& side) : x_(x) {
    if (f.dependence.any_steep()) find(f, hold_height, [&](int m) { return slides<P>(side[m]); });
  }
  // Of the lanes where on(m), at this share of what states of their natural sizes make of h.
  BesideSteep(const Equation& f, const State& x, double height, auto&& on) : x_(x) { find(f, height, on); }

  // The states on these sides. Of surface `only`, where that is given.
  State at(const Side& side, int only = -1) const {
    State beside = x_;
    for (std::size_t j = 0; j < surfaces_.size(); ++j) {
      if (only >= 0 && surfaces_[j] != only) continue;
      for (std::size_t i = 0; i < beside.size(); ++i) beside[i] += side[surfaces_[j]] * moves_[j][i];
    }
    return beside;
  }

 private:
  [[gnu::noinline]] void find(const Equation& f, double height, auto&& on) {
    ShelfVector<State> normals;
    ShelfVector<P> heights;
    ShelfVector<Mask> lanes;
    for (int m = 0; m < f.holds_end; ++m) {
      const Mask here = on(m);
      if (!f.dependence.steep(m) || !any(here)) continue;
      surfaces_.push_back(m);
      normals.push_back(gradient_of(f, m, x_));
      lanes.push_back(here);
      P size(0.0);
      for_each_index(f.states, [&](auto i) { size += abs(normals.back()[i]) * (1.0 / f.inverse_scale(i)); });
      heights.push_back(height * size);
    }
    const int n = static_cast<int>(surfaces_.size());
    if (n == 0) return;
    const auto squared_scale = [&](auto i) { return 1.0 / (f.inverse_scale(i) * f.inverse_scale(i)); };
    Elimination<P> system(n);
    for (int a = 0; a < n; ++a)
      for (int b = 0; b < n; ++b) {
        P sum(0.0);
        for_each_index(f.states, [&](auto i) { sum += normals[a][i] * normals[b][i] * squared_scale(i); });
        system(a, b) = select(lanes[a] & lanes[b], sum, P(a == b ? 1.0 : 0.0));
      }
    system.factorise();
    for (int j = 0; j < n; ++j) {
      ShelfVector<P> share(n, P(0.0));
      share[j] = select(lanes[j], heights[j], P(0.0));
      system.solve(share.data());
      State move = x_;
      for_each_index(f.states, [&](auto i) {
        P sum(0.0);
        for (int a = 0; a < n; ++a) sum += select(lanes[a], normals[a][i], P(0.0)) * share[a];
        move[i] = squared_scale(i) * sum;
      });
      moves_.push_back(move);
    }
  }

  const State& x_;
  ShelfVector<int> surfaces_;
  ShelfVector<State> moves_;
};

}  // namespace fisherpoint
