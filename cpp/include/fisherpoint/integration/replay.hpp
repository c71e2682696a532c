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
#include "fisherpoint/integration/tolerance.hpp"
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

// K packs side by side: while one waits for a root or a quotient, the others go on. They have one start and one input, and
// differ in theta.
template <class M, class P, class Method, int K = 1>
class Replay {
  using Equation = StateEquation<M, P>;
  using State = typename Equation::State;
  using Side = typename Equation::Side;
  using Surfaces = typename Equation::Surfaces;
  // Bernstein coefficients inside a step must exceed this share of the surface's variation over it.
  static constexpr double margin = 0.03;

 public:
  using Packs = std::array<State, K>;

  Replay(const std::array<const Equation*, K>& equations, const Tolerance& tolerance)
      : f_(equations), method_(method_of<Method>(tolerance)) {}

  template <class Source = Computed>
  FISHERPOINT_HOT std::array<Replayed<P>, K> run(Packs& x, const std::vector<Stretch<M>>& stretches, Source shared = {}) {
    const Equation& f = *f_[0];  // for what all have in common
    std::array<Replayed<P>, K> outcome;
    outcome.fill({P(1.0), P(0.0)});
    State stage[K][Method::most_stages], error;
    Packs ahead;
    std::array<Surfaces, K> value, rate;
    for (auto& of_pack : stage)
      for (int s = 0; s < method_.in_error; ++s) fit(of_pack[s], f.states);
    for (State& state : ahead) fit(state, f.states);
    fit(error, f.states);
    Side side;
    fit(side, f.sides);
    const auto last = before(method_.stages);
    const auto at_end = before(last);  // a stage there, whose slope is that of the step's end
    for_each_index<K>([&](auto q) { value[q] = f_[q]->surface_values(x[q]); });
    for (const Stretch<M>& stretch : stretches) {
      for_each_index(f.sides, [&](auto m) { side[m] = P(stretch.side[m]); });
      if (f.sided_limits) for_each_index<K>([&](auto q) { value[q] = f_[q]->surface_values(x[q], side); });
      const double step = stretch.duration / stretch.steps;
      std::array<std::array<double, Method::most_stages - 1>, Method::most_stages> weights{};  // times the step
      for (int s = 0; s <= last; ++s)
        for (int r = 0; r < s; ++r) weights[s][r] = step * method_.a[s][r];
      for (int k = 0; k < stretch.steps; ++k) {
        for_each_index<K>([&](auto q) {
          f_[q]->derivative(x[q], side, stage[q][0]);
          rate[q] = f_[q]->surface_rates(x[q], stage[q][0], side);
        });
        for_each_index(at_end, [&](auto previous) {
          const auto s = after(previous);
          move(s, weights[s], x, stage, ahead, shared);
          for_each_index<K>([&](auto q) { f_[q]->derivative(ahead[q], side, stage[q][s]); });
        });
        move(last, weights[last], x, stage, x, shared);
        for_each_index<K>([&](auto q) {
          const Surfaces end = f_[q]->surface_values(x[q], side);
          check(outcome[q].clearance, side, step, value[q], rate[q], end, f_[q]->surface_rates(x[q], stage[q][at_end], side));
          value[q] = end;
          if (method_.in_error > last) f_[q]->derivative(x[q], side, stage[q][last]);
          for_each_index(f.states, [&](auto i) {
            error[i] = P(0.0);
            if (f.dependence.state_depends(i) || !std::is_same_v<Source, Remembered>)
              error[i] = step * method_.error_of(stage[q], i);
          });
          outcome[q].squared_error += f_[q]->squared_size(error);
        });
      }
    }
    return outcome;
  }

 private:
  // The states at stage n, or at the step's end; what does not depend on theta once for all packs.
  void move(auto n, const auto& weights, const Packs& from, const auto& stage, Packs& to, auto& shared) {
    const Equation& f = *f_[0];
    for_each_index(f.states, [&](auto i) {
      const auto moved = [&](auto q) {
        P sum = from[q][i];
        for_each_index(n, [&](auto r) {
          if (method_.a[n][r] != 0) sum += weights[r] * stage[q][r][i];
        });
        return sum;
      };
      if (f.dependence.state_depends(i)) {
        for_each_index<K>([&](auto q) { to[q][i] = moved(q); });
      } else {
        const P common = shared([&] { return moved(Count<0>{}); });
        for_each_index<K>([&](auto q) { to[q][i] = common; });
      }
    });
  }

  // Almost every step keeps so far off all surfaces that a bound for the Bernstein coefficients shows it.
  void check(P& clearance, const Side& side, double step, const Surfaces& value0, const Surfaces& rate0, const Surfaces& value1,
             const Surfaces& rate1) const {
    P least(1.0);
    for_each_surface(side, [&](const auto& oriented) {
      const P h0 = oriented(value0), h1 = oriented(value1), low = min(h0, h1), high = max(h0, h1);
      const P swing = (step / 3) * max(abs(oriented(rate0)), abs(oriented(rate1)));
      least = min(least, (1 + margin) * low - margin * high - (1 + 4 * margin) * swing);
    });
    if (any(!(least > P(0.0)))) check_coefficients(clearance, side, step, value0, rate0, value1, rate1);
    // Past a pole f has values again, and a stage may have been there: a step must not go half of the way to it.
    for_each_index(f_[0]->kinks_end, f_[0]->sides, [&](auto m) {
      const P h0 = side[m] * value0[m], h1 = side[m] * value1[m], ahead = h0 + step * (side[m] * rate0[m]);
      clearance = min(clearance, min(h1, ahead) - 0.5 * h0);
    });
  }

  [[gnu::noinline]] void check_coefficients(P& clearance, const Side& side, double step, const Surfaces& value0,
                                            const Surfaces& rate0, const Surfaces& value1, const Surfaces& rate1) const {
    for_each_surface(side, [&](const auto& oriented) {
      const P h0 = oriented(value0), h1 = oriented(value1), rise = (step / 3) * oriented(rate0),
              fall = (step / 3) * oriented(rate1), b1 = h0 + rise, b2 = h1 - fall;
      const P least = margin * (abs(rise) + abs(b2 - b1) + abs(fall));
      clearance = min(clearance, min(min(b1, b2) - least, min(h0, h1)));
    });
  }

  // Of all that the plan has not dealt with; `use` is given what turns the surfaces' values so that the trajectory's side is
  // positive.
  void for_each_surface(const Side& side, auto&& use) const {
    const Equation& f = *f_[0];
    for_each_index(f.sides, [&](auto m) {
      if (!planned(f, f.dependence, m)) use([&](const Surfaces& of) { return side[m] * of[m]; });
    });
    for_each_index(f.sides, f.surfaces, [&](auto m) { use([&](const Surfaces& of) { return of[m]; }); });
  }

  std::array<const Equation*, K> f_;
  const Method& method_;
};

// One pack.
template <class Method, class M, class P, class Source = Computed>
Replayed<P> replay(const StateEquation<M, P>& equation, const Tolerance& tolerance, typename StateEquation<M, P>::State& x,
                   const std::vector<Stretch<M>>& stretches, Source shared = {}) {
  std::array<typename StateEquation<M, P>::State, 1> packs{x};
  const auto replayed = Replay<M, P, Method>({&equation}, tolerance).run(packs, stretches, shared);
  x = packs[0];
  return replayed[0];
}

}  // namespace fisherpoint
