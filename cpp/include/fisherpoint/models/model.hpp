// What a model is.
//
// A model of x' = f(x, u, theta), y = g(x, u, theta) is a struct that names its quantities and writes each function once,
// as a template over the number type. The smallest one, a cart that is pushed against Coulomb friction:
//
//     struct Cart {
//       double push = 2.0;                                                              // known constants are members
//       static constexpr std::string_view name = "cart";
//       static constexpr std::array states = {Quantity{"s", "m", "position", 1.0}, Quantity{"v", "m/s", "velocity", 1.0}};
//       static constexpr std::array inputs = {Quantity{"u", "1", "throttle", 1.0}};
//       static constexpr std::array outputs = {Quantity{"s", "m", "position", 1.0}};
//       static constexpr std::array parameters = {Quantity{"c", "m/s2", "friction", 1.0}};
//       static constexpr std::array jumps = {Surface{"v"}};                             // f itself jumps where v = 0
//       static constexpr std::array<Surface, 0> kinks = {};                             // f' jumps, f does not
//       static constexpr std::array<Surface, 0> domain = {};                            // f has a value where these are > 0
//
//       auto dynamics(const auto& theta) const {            // once per trajectory: what depends on theta alone
//         const auto& [c] = theta;
//         return [=, *this](const auto& x, const auto& u, const auto& side) {           // at every stage
//           const auto& [s, v] = x;
//           const auto& [throttle] = u;
//           const auto& [direction] = side;
//           return std::tuple{v, push * throttle - c * direction};
//         };
//       }
//       auto output(const auto& x, const auto& u, const auto& theta) const { return std::tuple{std::get<0>(x)}; }
//       auto switching(const auto& x, const auto& u, const auto& theta) const { return std::tuple{std::get<1>(x)}; }
//       auto limits(const auto& x, const auto& u, const auto& theta) const { return std::tuple{}; }
//     };
//
// Where f is not smooth. `switching` gives the values of the surfaces, jumps first, then kinks. f never looks at their signs:
// it is told by `side` (+1 or -1 for each) on which side of every surface the trajectory runs, and must be smooth for a
// fixed side. The integrator holds the sides fixed within a step, looks for the crossing on the step's interpolant and ends
// the step there; that is why neither the stages nor the derivatives ever mix two branches. sign(v) reads `side`, and x H(x)
// reads x * heaviside(side).
//
// Where f is a quotient whose divisor may have either sign, the divisor is a pole: a limit that the trajectory must not cross,
// from whichever side it comes. A model's `static constexpr int poles` says how many of its domain limits, the first ones, are.
//
// A limit that belongs to a branch, as that of a root there, holds only where the branch is taken, and is 1 elsewhere: `limits`
// of such a model is given `side` too, after theta, which is 0 where both branches are to be thought of.
//
// Where f has a value at a limit of the domain that is no pole, as a root has, `closed`, an array of bool for these limits,
// says so: trajectories may start there.
//
// A limit of the output alone is to hold where that is measured: `static constexpr int measured` says how many of the domain
// limits, the last ones, are such.
//
// A jump is crossed, or the trajectory slides on it (sliding.hpp). A model of which a surface's value jumps where another jump
// is crossed says in `crossable`, an array of bool, which jumps may be crossed; and one whose types do not show which sides f_i
// reads (it chooses by them) says in `read_through_jumps`, an array of Variables, what the jumps read whose sides f_i reads.
//
// A model that takes a root of what is zero on a kink says in `rough`, an array of bool, on which jumps and kinks it does so: S
// takes short steps beside them, as beside limits. One that has a root of what is zero there, so that f_x has no bounds, says
// so in `steep` too.
//
// A model that branches on values of parameters or of states, inside `dynamics` or `output`, says in `varying_states`,
// `varying_outputs` and `varying_surfaces`, arrays of bool, which of these depend on any parameter: derivatives do not show it.
//
// Derivatives of f_i that are the same all along a trajectory, as long as it stays on its sides of the jumps, are kept once for
// it if the model names them in `constant_slopes`, for every i a set of variables, the states first, then the parameters.
//
// Scales. A quantity's scale is the size against which its error is measured: rtol of a state is rtol * scale.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <string_view>
#include <tuple>
#include <utility>

namespace fisherpoint {

struct Quantity {
  std::string_view name, unit, description;
  double scale = 1.0;
};

struct Surface {
  std::string_view name;  // what is zero on it, as a user would write it
};

// H(h) on the side of h = 0 that `side` tells.
template <class T>
T heaviside(const T& side) {
  return 0.5 * (1.0 + side);
}

template <class Model>
struct sizes {
  static constexpr int states = static_cast<int>(Model::states.size());
  static constexpr int inputs = static_cast<int>(Model::inputs.size());
  static constexpr int outputs = static_cast<int>(Model::outputs.size());
  static constexpr int parameters = static_cast<int>(Model::parameters.size());
  static constexpr int jumps = static_cast<int>(Model::jumps.size());
  static constexpr int kinks = static_cast<int>(Model::kinks.size());
  static constexpr int limits = static_cast<int>(Model::domain.size());
  static constexpr int switching = jumps + kinks;
  // Kinks where f_x has no bounds, which come before the others.
  static constexpr int steep_kinks = [] {
    int count = 0;
    if constexpr (requires { Model::steep; })
      for (int m = jumps; m < switching; ++m) count += Model::steep[m];
    return count;
  }();
  static constexpr int poles = [] {
    if constexpr (requires { Model::poles; }) return Model::poles;
    return 0;
  }();
  static constexpr int measured = [] {
    if constexpr (requires { Model::measured; }) return Model::measured;
    return 0;
  }();
  static constexpr int sides = switching + poles;
  static constexpr int surfaces = switching + limits - measured;  // in this order: jumps, kinks, domain limits
};

// The limits of a model, which read sides where some stand in branches.
template <class M>
auto limits_of(const M& model, const auto& x, const auto& u, const auto& theta, const auto& side) {
  if constexpr (requires { model.limits(x, u, theta, side); })
    return model.limits(x, u, theta, side);
  else
    return model.limits(x, u, theta);
}

// A tuple or array as an array of numbers, whatever its entries' types were.
template <class T, class Tuple>
auto to_array(const Tuple& values) {
  return std::apply([](const auto&... value) { return std::array<T, sizeof...(value)>{T(value)...}; }, values);
}

// The functions that a model must have, tried on plain numbers.
template <class M>
concept Model =
    requires { M::states.size(), M::parameters.size(), M::jumps.size(); } &&
    requires(const M model, const std::array<double, sizes<M>::states> x, const std::array<double, sizes<M>::inputs> u,
             const std::array<double, sizes<M>::parameters> theta, const std::array<double, sizes<M>::sides> side) {
      requires std::tuple_size_v<decltype(model.dynamics(theta)(x, u, side))> == std::size_t{sizes<M>::states};
      requires std::tuple_size_v<decltype(model.output(x, u, theta))> == std::size_t{sizes<M>::outputs};
      requires std::tuple_size_v<decltype(model.switching(x, u, theta))> == std::size_t{sizes<M>::switching};
      requires std::tuple_size_v<decltype(limits_of(model, x, u, theta, side))> == std::size_t{sizes<M>::limits};
    };

}  // namespace fisherpoint
