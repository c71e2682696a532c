// Trajectories that are alike take the same steps: a plan, made once (plan.hpp), is replayed on every lane without a branch.
//
// A replayed trajectory is only believed where, over all steps, its embedded error stays below the plan's bound and every
// surface that the plan has not dealt with stays on its side: the cubic through a step's ends has positive Bernstein
// coefficients, with a margin for what the trajectory may do beside the cubic. Any other lane is for the adaptive loop
// (integrate.hpp) to redo.
#pragma once

#include <array>
#include <vector>

#include "model.hpp"
#include "pack.hpp"
#include "runge_kutta.hpp"
#include "sensitivity.hpp"
#include "state_equation.hpp"
#include "unroll.hpp"

namespace fisherpoint {

// Equal steps between two kinks, with the sides of all surfaces held.
template <Model M>
struct Stretch {
  double duration;
  int steps;
  std::array<double, sizes<M>::switching> side;
};

template <class P>
struct Replayed {
  P clearance;      // positive where the trajectory stays clear of every surface; meaningless where squared_error is NaN
  P squared_error;  // embedded, summed over the steps, in units of the states' scales

  mask_of_lanes<P> clear() const { return (clearance > P(0.0)) & (squared_error < P(1e300)); }
};

// Where the values come from that a state takes at the stages if it does not depend on theta, and so is the same in every lane.
struct Computed {
  auto operator()(auto&& compute) const { return compute(); }
};
struct Recorded {
  std::vector<double>& values;
  double operator()(auto&& compute) const { return values.emplace_back(compute()); }
};
struct Remembered {
  const double* next;
  auto operator()(auto&& compute) { return decltype(compute())(*next++); }
};

template <Model M, class P, class Method>
class Replay {
  using Equation = StateEquation<M, P>;
  using State = typename Equation::State;
  using Surfaces = typename Equation::Surfaces;
  static constexpr int last = Method::stages - 1;
  static constexpr int states = Equation::states, switching = Equation::switching, surfaces = Equation::surfaces;
  // Bernstein coefficients inside a step must exceed this share of the surface's variation over it.
  static constexpr double margin = 0.03;

 public:
  explicit Replay(const Equation& equation) : f_(equation) {}

  template <class Source = Computed>
  FISHERPOINT_HOT Replayed<P> run(State& x, const std::vector<Stretch<M>>& stretches, Source shared = {}) {
    static_assert(Method::c[last - 1] == 1.0, "the slope at a step's end is that of the stage there");
    Replayed<P> outcome{P(1.0), P(0.0)};
    State stage[Method::stages], ahead;
    Surfaces value = f_.surface_values(x);
    for (const Stretch<M>& stretch : stretches) {
      typename Equation::Side side;
      for_each_index<switching>([&](auto m) { side[m] = P(stretch.side[m]); });
      const double step = stretch.duration / stretch.steps;
      for (int n = 0; n < stretch.steps; ++n) {
        f_.derivative(x, side, stage[0]);
        const Surfaces rate = f_.surface_rates(x, stage[0]);
        for_each_index<last - 1>([&](auto before) {
          constexpr int s = before + 1;
          for_each_index<states>([&](auto i) {
            ahead[i] = own_or<i>(shared, [&] { return x[i] + step * weighted_sum<s>(Method::a[s], stage, i); });
          });
          f_.derivative(ahead, side, stage[s]);
        });
        for_each_index<states>([&](auto i) {
          x[i] = own_or<i>(shared, [&] { return x[i] + step * weighted_sum<last>(Method::a[last], stage, i); });
        });
        const Surfaces end = f_.surface_values(x);
        check(outcome.clearance, side, step, value, rate, end, f_.surface_rates(x, stage[last - 1]));
        value = end;
        if constexpr (end_counts<Method>()) f_.derivative(x, side, stage[last]);
        State error;
        for_each_index<states>([&](auto i) {
          error[i] = P(0.0);
          if constexpr (VariationalEquation<M, P>::state_depends(i) || !std::is_same_v<Source, Remembered>)
            error[i] = step * weighted_sum<last + end_counts<Method>()>(Method::error, stage, i);
        });
        outcome.squared_error += Equation::squared_size(error);
      }
    }
    return outcome;
  }

  // A surface whose crossings are the same for every theta; the plan ends a stretch there.
  template <int m>
  static constexpr bool planned() {
    if constexpr (m >= M::jumps.size() && m < switching)
      return !VariationalEquation<M, P>::template switching_depends<m>();
    else
      return false;
  }

 private:
  template <int i>
  static P own_or(auto& shared, auto&& compute) {
    if constexpr (VariationalEquation<M, P>::state_depends(i))
      return compute();
    else
      return shared(compute);
  }

  static void check(P& clearance, const auto& sides, double step, const Surfaces& value0, const Surfaces& rate0,
                    const Surfaces& value1, const Surfaces& rate1) {
    for_each_index<surfaces>([&](auto m) {
      if constexpr (!planned<m>()) {
        P h0 = value0[m], h1 = value1[m], r0 = rate0[m], r1 = rate1[m];
        if constexpr (m < switching) h0 *= sides[m], h1 *= sides[m], r0 *= sides[m], r1 *= sides[m];
        const P rise = (step / 3) * r0, fall = (step / 3) * r1, b1 = h0 + rise, b2 = h1 - fall;
        const P least = margin * (abs(rise) + abs(b2 - b1) + abs(fall));
        clearance = min(clearance, min(min(b1, b2) - least, min(h0, h1)));
      }
    });
  }

  const Equation& f_;
};

}  // namespace fisherpoint
