// The state equation (1a), x' = f(x, u, theta), as the integrator takes it, with the surfaces where f is not smooth, and the
// output equation (1b).
#pragma once

#include "fisherpoint/models/dependence.hpp"
#include "fisherpoint/models/shape.hpp"
#include "fisherpoint/numbers/implicit_orders.hpp"
#include "fisherpoint/numbers/parts.hpp"

namespace fisherpoint {

template <class M, class P>
class StateEquation : public Shape<M> {
  using Arrays = ArraysOf<M, P>;

 public:
  using Number = P;
  using State = typename Arrays::States;
  using Side = typename Arrays::Sides;
  using Surfaces = typename Arrays::Surfaces;
  using Theta = typename Arrays::Parameters;
  using Input = typename Arrays::Inputs;
  using Output = typename Arrays::Outputs;

  static constexpr Dependence<M> dependence{};

  StateEquation(const M& model, const Theta& theta, const Input& u, int = 0)
      : model_(model), theta_(theta), u_(u), dynamics_(model.dynamics(theta_)) {}

  // The first parts of packs that are computed, which have the lanes in use (parts.hpp).
  static constexpr int parts_in_use() { return PartsOf<P>::count; }

  void derivative(const State& x, const Side& side, State& dx) const { dx = to_array<P>(dynamics_(x, u_, side)); }
  // Entries of f_x that may differ from zero: all, row by row.
  static constexpr int slopes() { return sizes<M>::states * sizes<M>::states; }
  static constexpr std::pair<int, int> slope(int e) { return {e / sizes<M>::states, e % sizes<M>::states}; }
  // In which order unknowns of systems with f_x, and of the three stages of an implicit step, are eliminated, where it matters.
  static constexpr const EliminationOrder* order() { return nullptr; }
  static constexpr const EliminationOrder* stages_order() { return nullptr; }
  // These entries of f_x.
  void jacobian(const State& x, const Side& side, P* entries) const {
    constexpr int n = sizes<M>::states;
    const auto f = dynamics_(as_variables<0, n, P>(x), u_, side);
    for_each_index(Shape<M>::states,
                   [&](auto i) { for_each_index<n>([&](auto k) { *entries++ = slope_of<k, P>(std::get<i>(f)); }); });
  }
  Output output(const State& x) const { return to_array<P>(model_.output(x, u_, theta_)); }

  static constexpr double inverse_scale(int i) { return 1.0 / M::states[i].scale; }

  // Sum over the states of (x / scale)^2.
  P squared_size(const State& x) const {
    P sum(0.0);
    for_each_index(Shape<M>::states, [&](auto i) {
      const P relative = x[i] * (1.0 / M::states[i].scale);
      sum += relative * relative;
    });
    return sum;
  }

  // Of the surfaces, and of the limits; the ones that stand in branches are 1 where these are not taken (model.hpp).
  Surfaces surface_values(const State& x, const Side& side) const {
    return surfaces_of([&](auto i) { return x[i]; }, side, [](const auto& h) { return h; });
  }
  // Of the surfaces alone, whatever the sides are.
  Surfaces surface_values(const State& x) const { return surface_values(x, no_sides()); }

  // d/dt of them where the state moves at rate dx.
  Surfaces surface_rates(const State& x, const State& dx, const Side& side) const {
    return surfaces_of([&](auto i) { return Dual<P, 1>{x[i], {dx[i]}}; }, side,
                       [](const auto& h) { return slope_of<0, P>(h); });
  }
  Surfaces surface_rates(const State& x, const State& dx) const { return surface_rates(x, dx, no_sides()); }

 private:
  static Side no_sides() {
    Side side;
    side.fill(P(0.0));
    return side;
  }

  Surfaces surfaces_of(auto&& state, const Side& side, auto&& pick) const {
    const auto x = [&]<int... i>(std::integer_sequence<int, i...>) {
      if constexpr (sizeof...(i) == 0)
        return std::array<P, 0>{};  // of a static model
      else
        return std::array{state(std::integral_constant<int, i>{})...};
    }(std::make_integer_sequence<int, sizes<M>::states>{});
    return std::apply([&](const auto&... h) { return Surfaces{pick(h)...}; },
                      std::tuple_cat(model_.switching(x, u_, theta_), limits_of(model_, x, u_, theta_, side)));
  }

  M model_;
  Theta theta_;
  Input u_;
  decltype(std::declval<const M&>().dynamics(std::declval<const Theta&>())) dynamics_;
};

}  // namespace fisherpoint
