// What the integrator asks of an explicit Runge-Kutta method. A method is a struct of constants:
//
//     order, stages          the last stage is the derivative at the step's end, and the first one of the next step
//     a[stages]              weights of the stages before; the last row gives the solution
//     error                  weights of the embedded error
//     coarse                 weights of another embedded solution, of a still lower order
//     squared_error(...)     what step control takes for the squared error, from the squares of the embedded ones; its root
//     falls
//                            at least as the step's power of `order`
//     bow                    x(t + step/2) less the middle of the cubic through both ends of the step
//     most_growth            of the step's size from one step to the next
//     stability              the largest step along a fast decay, in units of its time constant
//     beside_kink            the error of sensitivities over the embedded one, where f_x rises like a root
//     allowed_estimate       of the error of sensitivities, in tolerances: it exceeds the error itself, with most points by far
//     allowed_of_rows        the same where they are made row by row (adjoints.hpp)
#pragma once

#include <array>
#include <cstddef>
#include <type_traits>

#include "fisherpoint/models/dependence.hpp"
#include "fisherpoint/numbers/pack.hpp"
#include "fisherpoint/numbers/parts.hpp"
#include "fisherpoint/numbers/unroll.hpp"

namespace fisherpoint {

// The states of a stage, and the stages, read by a function: as Q, or one part after the other (parts.hpp).
template <class Read, class State>
struct StatesBy {
  Read read;
  const State& states;
  decltype(auto) operator[](int i) const { return read(states[i]); }
};
template <class Read, class State>
struct StagesBy {
  Read read;
  const State* stages;
  StatesBy<Read, State> operator[](int s) const { return {read, stages[s]}; }
};
template <class Q, class State>
using StagesAs = StagesBy<ReadAs<Q>, State>;

// start plus entry i of stages `first` to n - 1, each times its weight; what has no weight is not computed. Where n is no Count
// the sum is a loop, over one vector of a pack at a time, so that it stays in its register.
template <class N, class First, std::size_t size, class P>
P weighted_sum(First first, N n, P start, const std::array<double, size>& weights, const auto& stage, int i) {
#if !defined(FISHERPOINT_SANITIZED)  // hundreds of unrolled sums take minutes to compile with their checks
  if constexpr (!std::is_same_v<N, int>) {
    for_each_index(first, n, [&](auto r) {
      if (weights[r] != 0) start += weights[r] * stage[r][i];
    });
    return start;
  }
#endif
  for (int r = first; r < n; ++r)
    if (weights[r] != 0) start += weights[r] * stage[r][i];
  return start;
}
template <class N, std::size_t size, class P>
P weighted_sum(N n, const P& start, const std::array<double, size>& weights, const auto& stage, int i) {
  return weighted_sum(Count<0>{}, n, start, weights, stage, i);
}
template <class N, std::size_t size>
auto weighted_sum(N n, const std::array<double, size>& weights, const auto& stage, int i) {
  return weighted_sum(Count<1>{}, n, weights[0] * stage[0][i], weights, stage, i);
}

// work(with_sums), where with_sums(i, take) calls take(sum, ...) with the weighted sums of entry i of the first n stages, one
// for each row of weights. All rows have weights for the same stages, and each of these is read once for all rows. They are
// found once for all i, and their number decides once between loops that are unrolled.
template <std::size_t rows, std::size_t size, class Q, class State>
void with_weighted_sums(int n, const std::array<double, size>* const (&weights)[rows], const StagesAs<Q, State>& stage,
                        auto&& work) {
  std::array<std::array<double, rows>, size> weight;
  std::array<decltype(stage.stages->data()), size> states;
  int count = 0;
  for (int r = 0; r < n; ++r) {
    if ((*weights[0])[r] == 0) continue;
    for (std::size_t row = 0; row < rows; ++row) weight[count][row] = (*weights[row])[r];
    states[count++] = stage.stages[r].data();
  }
  const auto sums_of = [&](int i, auto terms, auto&& take) {
    const auto add_up = [&]<std::size_t... row>(std::index_sequence<row...>) {
      std::array<Q, rows> sums{(weight[0][row] * read_as<Q>(states[0][i]))...};
      for_each_index(Count<1>{}, terms, [&](auto t) {
        const Q& value = read_as<Q>(states[t][i]);
        ((sums[row] = fused(Q(weight[t][row]), value, sums[row])), ...);
      });
      take(sums[row]...);
    };
    add_up(std::make_index_sequence<rows>{});
  };
#if !defined(FISHERPOINT_SANITIZED)  // hundreds of unrolled sums take minutes to compile with their checks
  for_each_index<static_cast<int>(size)>([&](auto before) {
    if (count == before + 1) work([&](int i, auto&& take) { sums_of(i, after(before), take); });
  });
#else
  work([&](int i, auto&& take) { sums_of(i, count, take); });
#endif
}

// sums[i] += the weighted sum of the first n stages, for all variables i of a set. The bits are those of `weighted_sum`, but a
// weight is loaded once for all variables, and not once for each.
template <class N, std::size_t size, class State>
void add_weighted(N n, const std::array<double, size>& weights, const State* stage, auto variables, State& sums) {
#if !defined(FISHERPOINT_SANITIZED)
  if constexpr (!std::is_same_v<N, int>) {
    using P = std::remove_cvref_t<decltype(sums[0])>;
    for_each_index(n, [&](auto r) {
      if (weights[r] == 0) return;
      const P weight = in_register(P(weights[r]));
      for_each_variable(variables, [&](auto i) { sums[i] += weight * stage[r][i]; });
    });
    return;
  }
#endif
  for_each_variable(variables, [&](auto i) { sums[i] = weighted_sum(n, sums[i], weights, stage, i); });
}

// What the constants of method M make of entry i of a step's stages: sums whose terms the compiler knows, unrolled or not.
template <class M, bool unrolled = true>
struct StageSums {
  template <int n>
  using N = std::conditional_t<unrolled, Count<n>, int>;
  template <int n>
  static constexpr N<n> counted = Count<n>{};

  static auto end_of(const auto& stage, int i) { return weighted_sum(counted<M::stages - 1>, M::a[M::stages - 1], stage, i); }
  static auto error_of(const auto& stage, int i) { return weighted_sum(counted<M::in_error>, M::error, stage, i); }
  static auto coarse_of(const auto& stage, int i) { return weighted_sum(counted<M::stages - 1>, M::coarse, stage, i); }
  static auto bow_of(const auto& stage, int i) { return weighted_sum(counted<M::stages>, M::bow, stage, i); }
};

// Weights of what comes behind stage s of a step: of the stages after it, of the row at the step's end, and of the embedded
// error.
template <std::size_t most, std::size_t stages, int in_error>
constexpr auto weights_behind(const std::array<std::array<double, most>, stages>& a, const std::array<double, stages>& error,
                              Count<in_error>) {
  std::array<std::array<double, in_error + 2>, in_error> weights{};
  for (std::size_t s = 0; s < in_error; ++s) {
    for (std::size_t j = s + 1; j < in_error; ++j) weights[s][j] = a[j][s];
    if (s < stages - 1) weights[s][in_error] = a[stages - 1][s];
    weights[s][in_error + 1] = error[s];
  }
  return weights;
}

}  // namespace fisherpoint
