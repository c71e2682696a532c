// Trajectories that are alike take the same steps: a plan, made once (plan.hpp), is replayed on every lane without a branch.
//
// A replayed trajectory is only believed where, over all steps, its embedded error stays below the plan's bound and every
// surface that the plan has not dealt with stays on its side: the cubic through a step's ends has positive Bernstein
// coefficients, with a margin for what the trajectory may do beside the cubic. Any other lane is for the adaptive loop
// (integrator.hpp) to redo.
#pragma once

#include <array>
#include <vector>

#include "fisherpoint/equations/state_equation.hpp"
#include "fisherpoint/integration/runge_kutta.hpp"
#include "fisherpoint/models/dependence.hpp"
#include "fisherpoint/numbers/pack.hpp"
#include "fisherpoint/numbers/unroll.hpp"

namespace fisherpoint {

// Equal steps between two kinks, with the sides of all surfaces held.
template <class M>
struct Stretch {
  double duration;
  int steps;
  typename ArraysOf<M, double>::Sides side;
};

template <class P>
struct Replayed {
  P clearance;      // positive where the trajectory stays clear of every surface; meaningless where squared_error is NaN
  P squared_error;  // embedded, summed over the steps, in units of the states' scales

  mask_of_lanes<P> clear() const { return (clearance > P(0.0)) & (squared_error < P(1e300)); }
};

// A surface whose crossings are the same for every theta; the plan ends a stretch there.
constexpr bool planned(const auto& shape, const auto& dependence, auto m) {
  return m < shape.kinks_end && (m >= shape.jumps_end || dependence.crossable(m)) && !dependence.switching_depends(m);
}

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

template <class M, class P, class Method>
class Replay {
  using Equation = StateEquation<M, P>;
  using State = typename Equation::State;
  using Surfaces = typename Equation::Surfaces;
  static constexpr int last = Method::stages - 1;
  // Bernstein coefficients inside a step must exceed this share of the surface's variation over it.
  static constexpr double margin = 0.03;

 public:
  explicit Replay(const Equation& equation) : f_(equation) {}

  template <class Source = Computed>
  FISHERPOINT_HOT Replayed<P> run(State& x, const std::vector<Stretch<M>>& stretches, Source shared = {}) {
    static_assert(Method::c[last - 1] == 1.0, "the slope at a step's end is that of the stage there");
    Replayed<P> outcome{P(1.0), P(0.0)};
    State stage[Method::stages], ahead, error;
    for (State& rates : stage) fit(rates, f_.states);
    fit(ahead, f_.states);
    fit(error, f_.states);
    typename Equation::Side side;
    fit(side, f_.sides);
    Surfaces value = f_.surface_values(x);
    for (const Stretch<M>& stretch : stretches) {
      for_each_index(f_.sides, [&](auto m) { side[m] = P(stretch.side[m]); });
      if (f_.sided_limits) value = f_.surface_values(x, side);
      const double step = stretch.duration / stretch.steps;
      for (int k = 0; k < stretch.steps; ++k) {
        f_.derivative(x, side, stage[0]);
        const Surfaces rate = f_.surface_rates(x, stage[0], side);
        for_each_index(counted<Equation, last - 1>(), [&](auto before) {
          const auto s = after(before);
          for_each_index(f_.states, [&](auto i) {
            ahead[i] = own_or(i, shared, [&] { return x[i] + step * weighted_sum(s, Method::a[s], stage, i); });
          });
          f_.derivative(ahead, side, stage[s]);
        });
        for_each_index(f_.states, [&](auto i) {
          x[i] = own_or(i, shared,
                        [&] { return x[i] + step * weighted_sum(counted<Equation, last>(), Method::a[last], stage, i); });
        });
        const Surfaces end = f_.surface_values(x, side);
        check(outcome.clearance, side, step, value, rate, end, f_.surface_rates(x, stage[last - 1], side));
        value = end;
        if constexpr (end_counts<Method>()) f_.derivative(x, side, stage[last]);
        for_each_index(f_.states, [&](auto i) {
          error[i] = P(0.0);
          if (f_.dependence.state_depends(i) || !std::is_same_v<Source, Remembered>)
            error[i] = step * weighted_sum(counted<Equation, last + end_counts<Method>()>(), Method::error, stage, i);
        });
        outcome.squared_error += f_.squared_size(error);
      }
    }
    return outcome;
  }

 private:
  P own_or(auto i, auto& shared, auto&& compute) {
    if (f_.dependence.state_depends(i)) return compute();
    return shared(compute);
  }

  void check(P& clearance, const auto& sides, double step, const Surfaces& value0, const Surfaces& rate0,
             const Surfaces& value1, const Surfaces& rate1) {
    const auto check_one = [&](P h0, P r0, P h1, P r1) {
      const P rise = (step / 3) * r0, fall = (step / 3) * r1, b1 = h0 + rise, b2 = h1 - fall;
      const P least = margin * (abs(rise) + abs(b2 - b1) + abs(fall));
      clearance = min(clearance, min(min(b1, b2) - least, min(h0, h1)));
    };
    for_each_index(f_.sides, [&](auto m) {
      if (!planned(f_, f_.dependence, m))
        check_one(sides[m] * value0[m], sides[m] * rate0[m], sides[m] * value1[m], sides[m] * rate1[m]);
    });
    for_each_index(f_.sides, f_.surfaces, [&](auto m) { check_one(value0[m], rate0[m], value1[m], rate1[m]); });
    // Past a pole f has values again, and a stage may have been there: a step must not go half of the way to it.
    for_each_index(f_.kinks_end, f_.sides, [&](auto m) {
      const P h0 = sides[m] * value0[m], h1 = sides[m] * value1[m], ahead = h0 + step * (sides[m] * rate0[m]);
      clearance = min(clearance, min(h1, ahead) - 0.5 * h0);
    });
  }

  const Equation& f_;
};

}  // namespace fisherpoint
