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
#include "fisherpoint/numbers/unroll.hpp"

namespace fisherpoint {

// n as a Count or as an int, as the equation has its loops over stages.
template <class Equation, int n>
constexpr typename Equation::template Stages<n> counted() {
  return typename Equation::template Stages<n>(Count<n>{});
}

// start plus entry i of stages `first` to n - 1, each times its weight; what has no weight is not computed. Where n is no Count
// the sum is a loop, over one vector of a pack at a time, so that it stays in its register.
template <class N, class First, std::size_t size, class State, class P>
P weighted_sum(First first, N n, P start, const std::array<double, size>& weights, const State* stage, int i) {
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
template <class N, std::size_t size, class State, class P>
P weighted_sum(N n, const P& start, const std::array<double, size>& weights, const State* stage, int i) {
  return weighted_sum(Count<0>{}, n, start, weights, stage, i);
}
template <class N, std::size_t size, class State>
auto weighted_sum(N n, const std::array<double, size>& weights, const State* stage, int i) {
  return weighted_sum(Count<1>{}, n, weights[0] * stage[0][i], weights, stage, i);
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

// Whether the derivative at the step's end takes part in an error.
template <class Method>
constexpr bool end_counts() {
  return Method::error[Method::stages - 1] != 0;
}

}  // namespace fisherpoint
