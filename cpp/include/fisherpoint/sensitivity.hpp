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

template <Model M, class P>
class VariationalEquation {
  using Plain = StateEquation<M, P>;
  static constexpr int states_ = sizes<M>::states, parameters_ = sizes<M>::parameters;
  static_assert(states_ + parameters_ <= 64, "a mask holds 64 variables");

 public:
  using Number = P;
  using Side = typename Plain::Side;
  using Surfaces = typename Plain::Surfaces;
  using Theta = typename Plain::Theta;
  using Input = typename Plain::Input;
  static constexpr int states = states_, parameters = parameters_;
  static constexpr int jumps = Plain::jumps, switching = Plain::switching, surfaces = Plain::surfaces;

 private:
  static auto dynamics_of(const M& model, const Theta& theta) {
    return model.dynamics(as_variables<states_, parameters_, P>(theta));
  }
  using DualState = decltype(as_variables<0, states_, P>(std::declval<std::array<P, states_>>()));
  using DualTheta = decltype(as_variables<states_, parameters_, P>(std::declval<Theta>()));
  using Dynamics = decltype(dynamics_of(std::declval<const M&>(), std::declval<const Theta&>()));
  using Rates =
      decltype(std::declval<const Dynamics&>()(std::declval<DualState>(), std::declval<Input>(), std::declval<Side>()));
  template <int i>
  static constexpr Variables reads = variables_of<std::tuple_element_t<i, Rates>>;

  // Which parameters state i depends on in the end: those that f_i reads and those of the states that it reads.
  static constexpr std::array<Variables, states_> row = [] {
    constexpr auto direct = []<int... i>(std::integer_sequence<int, i...>) {
      return std::array<Variables, states_>{reads<i>...};
    }(std::make_integer_sequence<int, states_>{});
    std::array<Variables, states_> reached{};
    for (int round = 0; round <= states_; ++round)
      for (int i = 0; i < states_; ++i) {
        reached[i] |= direct[i] >> states_;
        for (int k = 0; k < states_; ++k)
          if ((direct[i] >> k) & 1) reached[i] |= reached[k];
      }
    return reached;
  }();

  template <class Value>
  static constexpr bool varies() {
    constexpr Variables read = variables_of<Value>;
    if (read >> states_) return true;
    for (int k = 0; k < states_; ++k)
      if (((read >> k) & 1) && row[k]) return true;
    return false;
  }

  // Place of dx_i/dtheta_j in the integrated vector: behind the states, row by row, without the zeros.
  static constexpr int row_start(int i) {
    int at = states_;
    for (int s = 0; s < i; ++s) at += std::popcount(row[s]);
    return at;
  }
  static constexpr int place(int i, int j) { return row_start(i) + std::popcount(row[i] & ((Variables{1} << j) - 1)); }

 public:
  static constexpr bool depends(int i, int j) { return (row[i] >> j) & 1; }

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

  static constexpr int size = row_start(states_);
  using State = std::array<P, size>;

  VariationalEquation(const M& model, const Theta& theta, const Input& u)
      : plain_(model, theta, u), u_(u), dynamics_(dynamics_of(model, theta)) {}

  void derivative(const State& y, const Side& side, State& dy) const {
    const auto f = dynamics_(as_variables<0, states_, P>(y), u_, side);
    for_each_index<states_>([&](auto i) {
      const auto& f_i = std::get<i>(f);
      dy[i] = value_of(f_i);
      for_each_variable<row[i]>([&](auto j) {
        P sum = slope_of<states_ + j, P>(f_i);
        for_each_variable<(reads<i> & ((Variables{1} << states_) - 1))>([&](auto k) {
          if constexpr (depends(k, j)) sum += f_i.template slope<k>() * y[place(k, j)];
        });
        dy[place(i, j)] = sum;
      });
    });
  }

  // The states' squared error plus, for every column of S, its squared error relative to the column's own size: against the
  // size of the outputs, columns of weak parameters would be integrated without any control.
  P squared_error(const State& y, const State& error) const {
    P sum = Plain::squared_size(error);
    for_each_index<parameters_>([&](auto j) {
      P wrong(0.0), size(1e-200);
      for_each_index<states_>([&](auto i) {
        if constexpr (depends(i, j)) {
          const P e = error[place(i, j)] * (1.0 / M::states[i].scale), s = y[place(i, j)] * (1.0 / M::states[i].scale);
          wrong += e * e;
          size += s * s;
        }
      });
      sum += wrong / size;
    });
    return sum;
  }

  static P squared_size(const auto& x) { return Plain::squared_size(x); }
  Surfaces surface_values(const auto& y) const { return plain_.surface_values(y); }
  Surfaces surface_rates(const auto& y, const auto& dy) const { return plain_.surface_rates(y, dy); }

  template <int i, int j>
  static P entry(const State& y) {
    if constexpr (depends(i, j))
      return y[place(i, j)];
    else
      return P(0.0);
  }

 private:
  Plain plain_;
  Input u_;
  Dynamics dynamics_;
};

}  // namespace fisherpoint
