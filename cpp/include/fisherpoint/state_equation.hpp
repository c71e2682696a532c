// The state equation (1a), x' = f(x, u, theta), as the integrator takes it, with the surfaces where f is not smooth.
#pragma once

#include <array>

#include "dual.hpp"
#include "model.hpp"

namespace fisherpoint {

template <Model M, class P>
class StateEquation {
 public:
  using Number = P;
  using Side = std::array<P, sizes<M>::switching>;
  using Surfaces = std::array<P, sizes<M>::surfaces>;
  static constexpr int states = sizes<M>::states;
  static constexpr int jumps = sizes<M>::jumps, switching = sizes<M>::switching, surfaces = sizes<M>::surfaces;
  using Theta = std::array<P, sizes<M>::parameters>;
  using Input = std::array<P, sizes<M>::inputs>;
  using State = std::array<P, states>;

  StateEquation(const M& model, const Theta& theta, const Input& u)
      : model_(model), theta_(theta), u_(u), dynamics_(model.dynamics(theta_)) {}

  void derivative(const State& x, const Side& side, State& dx) const { dx = to_array<P>(dynamics_(x, u_, side)); }

  // Sum over the states of (x / scale)^2.
  static P squared_size(const auto& x) {
    P sum(0.0);
    for_each_index<states>([&](auto i) {
      const P relative = x[i] * (1.0 / M::states[i].scale);
      sum += relative * relative;
    });
    return sum;
  }

  Surfaces surface_values(const auto& x) const {
    return surfaces_of([&](auto i) { return x[i]; }, [](const auto& h) { return h; });
  }

  // d/dt of the surfaces where the state moves at rate dx.
  Surfaces surface_rates(const auto& x, const auto& dx) const {
    return surfaces_of([&](auto i) { return Dual<P, 1>{x[i], {dx[i]}}; }, [](const auto& h) { return slope_of<0, P>(h); });
  }

 private:
  Surfaces surfaces_of(auto&& state, auto&& pick) const {
    const auto x = [&]<int... i>(std::integer_sequence<int, i...>) {
      return std::array{state(std::integral_constant<int, i>{})...};
    }(std::make_integer_sequence<int, states>{});
    return std::apply([&](const auto&... h) { return Surfaces{pick(h)...}; },
                      std::tuple_cat(model_.switching(x, u_, theta_), model_.limits(x, u_, theta_)));
  }

  M model_;
  Theta theta_;
  Input u_;
  decltype(std::declval<const M&>().dynamics(std::declval<const Theta&>())) dynamics_;
};

}  // namespace fisherpoint
