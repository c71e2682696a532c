// The variational equation (9): x' = f together with S' = f_x S + f_theta for S = dx/dtheta, S(0) = 0.
//
// One evaluation of f on duals gives f, f_x and f_theta without their zeros, so the product's pattern is known at compile
// time. Entries of S that stay zero for every trajectory (dx_v/dtheta of the cylinder) are found from the masks and not
// integrated.
#pragma once

#include <array>
#include <bit>

#include "dual.hpp"
#include "model.hpp"
#include "state_equation.hpp"

namespace fisherpoint {

template <int first, int n, class P>
auto as_variables(const auto& values) {
  return [&]<int... i>(std::integer_sequence<int, i...>) {
    return std::tuple{variable<first + i>(P(values[i]))...};
  }(std::make_integer_sequence<int, n>{});
}

namespace detail {

// The numbers below n for which belongs(i).
constexpr Variables which(int n, auto&& belongs) {
  Variables mask = 0;
  for (int i = 0; i < n; ++i)
    if (belongs(i)) mask |= Variables{1} << i;
  return mask;
}

// How many of them are below i.
constexpr int below(Variables mask, int i) { return std::popcount(mask & ((Variables{1} << i) - 1)); }

// How many there are in the masks of 0 to n - 1.
constexpr int before(int n, auto&& mask_of) {
  int sum = 0;
  for (int i = 0; i < n; ++i) sum += std::popcount(mask_of(i));
  return sum;
}

}  // namespace detail

template <Model M, class P>
class VariationalEquation {
 public:
  static constexpr int states = sizes<M>::states, parameters = sizes<M>::parameters;
  static_assert(states + parameters <= 64, "a mask holds 64 variables");
  using Plain = StateEquation<M, P>;
  using Side = typename Plain::Side;
  using Theta = typename Plain::Theta;
  using Input = typename Plain::Input;
  using State = typename Plain::State;

 private:
  static auto dynamics_of(const M& model, const Theta& theta) {
    return model.dynamics(as_variables<states, parameters, P>(theta));
  }
  using DualState = decltype(as_variables<0, states, P>(std::declval<State>()));
  using DualTheta = decltype(as_variables<states, parameters, P>(std::declval<Theta>()));
  using Dynamics = decltype(dynamics_of(std::declval<const M&>(), std::declval<const Theta&>()));
  using Rates =
      decltype(std::declval<const Dynamics&>()(std::declval<DualState>(), std::declval<Input>(), std::declval<Side>()));

  // What f_i reads: the states in the lower bits, the parameters above them.
  static constexpr std::array<Variables, states> reads = []<int... i>(std::integer_sequence<int, i...>) {
    return std::array<Variables, states>{variables_of<std::tuple_element_t<i, Rates>>...};
  }(std::make_integer_sequence<int, states>{});

  // Which parameters state i depends on in the end: those that f_i reads and those of the states that it reads.
  static constexpr std::array<Variables, states> row = [] {
    std::array<Variables, states> reached{};
    for (int round = 0; round <= states; ++round)
      for (int i = 0; i < states; ++i) {
        reached[i] |= reads[i] >> states;
        for (int k = 0; k < states; ++k)
          if ((reads[i] >> k) & 1) reached[i] |= reached[k];
      }
    return reached;
  }();

  template <class Value>
  static constexpr bool varies() {
    constexpr Variables read = variables_of<Value>;
    if (read >> states) return true;
    for (int k = 0; k < states; ++k)
      if (((read >> k) & 1) && row[k]) return true;
    return false;
  }

 public:
  // Of column j of S: the states that depend on parameter j, and those whose f reads it, each as a mask.
  static constexpr Variables rows(int j) {
    return detail::which(states, [j](int i) { return (row[i] >> j) & 1; });
  }
  static constexpr Variables driven(int j) {
    return detail::which(states, [j](int i) { return (reads[i] >> (states + j)) & 1; });
  }
  static constexpr bool depends(int i, int j) { return (row[i] >> j) & 1; }
  // Whether state i depends on any parameter; one that does not is the same for every theta.
  static constexpr bool state_depends(int i) { return row[i] != 0; }
  // The states that f_i reads and that depend on any parameter.
  static constexpr Variables coupled(int i) {
    return detail::which(states, [i](int k) { return ((reads[i] >> k) & 1) && row[k] != 0; });
  }

  // Whether output i or switching surface m depends on any parameter, by the types alone: such an output has exactly no
  // predictive variance, and such a surface is crossed at the same time for every theta.
  template <int i>
  static constexpr bool output_depends() {
    using Outputs =
        decltype(std::declval<const M&>().output(std::declval<DualState>(), std::declval<Input>(), std::declval<DualTheta>()));
    return varies<std::tuple_element_t<i, Outputs>>();
  }
  template <int m>
  static constexpr bool switching_depends() {
    using Values = decltype(std::declval<const M&>().switching(std::declval<DualState>(), std::declval<Input>(),
                                                               std::declval<DualTheta>()));
    return varies<std::tuple_element_t<m, Values>>();
  }

  // The entries of f_x and f_theta that S' needs: f_x row by row, f_theta column by column.
  static constexpr int state_place(int i, int k) { return detail::before(i, coupled) + detail::below(coupled(i), k); }
  static constexpr int theta_place(int j, int i) { return detail::before(j, driven) + detail::below(driven(j), i); }
  struct Jacobian {
    std::array<P, detail::before(states, coupled)> by_state;
    std::array<P, detail::before(parameters, driven)> by_theta;
  };

  // S itself, column by column.
  static constexpr int place(int i, int j) { return detail::before(j, rows) + detail::below(rows(j), i); }
  using Columns = std::array<P, detail::before(parameters, rows)>;

  template <int i, int j>
  static P entry(const Columns& s) {
    if constexpr (depends(i, j))
      return s[place(i, j)];
    else
      return P(0.0);
  }

  VariationalEquation(const M& model, const Theta& theta, const Input& u) : u_(u), dynamics_(dynamics_of(model, theta)) {}

  // f and its Jacobian in x.
  void linearise(const State& x, const Side& side, State& dx, Jacobian& jacobian) const {
    const auto f = dynamics_(as_variables<0, states, P>(x), u_, side);
    for_each_index<states>([&](auto i) {
      const auto& f_i = std::get<i>(f);
      dx[i] = value_of(f_i);
      for_each_variable<coupled(i)>([&](auto k) { jacobian.by_state[state_place(i, k)] = slope_of<k, P>(f_i); });
      for_each_variable<(reads[i] >> states)>(
          [&](auto j) { jacobian.by_theta[theta_place(j, i)] = slope_of<states + j, P>(f_i); });
    });
  }

 private:
  Input u_;
  Dynamics dynamics_;
};

}  // namespace fisherpoint
