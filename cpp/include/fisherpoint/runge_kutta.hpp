// What the integrator asks of an explicit Runge-Kutta method. A method is a struct of constants:
//
//     order, stages          the last stage is the derivative at the step's end, and the first one of the next step
//     a[stages]              weights of the stages before; the last row gives the solution
//     error                  weights of the embedded error
//     coarse                 where there is another embedded solution of a still lower order, the weights of that
//     squared_error(...)     what step control takes for the squared error, from the squares of the embedded ones; its root
//     falls
//                            at least as the step's power of `order`
//     bow                    x(t + step/2) less the middle of the cubic through both ends of the step
//     most_growth            of the step's size from one step to the next
//     allowed_estimate       of the error of sensitivities, in tolerances: it exceeds the error itself, with most points by far
#pragma once

#include <array>
#include <cstddef>

#include "unroll.hpp"

namespace fisherpoint {

namespace detail {

template <int n, int first, class T>
T weighted_sum(T start, const auto& weights, auto&& stage) {
#if defined(FISHERPOINT_SANITIZED)  // a loop: hundreds of unrolled sums take minutes to compile with their checks
  for (int r = first; r < n; ++r)
    if (weights[r] != 0) start += weights[r] * stage(r);
#else
  for_each_index<n - first>([&](auto r) {
    if (weights[r + first] != 0) start += weights[r + first] * stage(r + first);
  });
#endif
  return start;
}

}  // namespace detail

// start plus entry i of stages `first` to n - 1, each times its weight; what has no weight is not computed.
template <int n, int first = 0, std::size_t size, class State, class P>
P weighted_sum(P start, const std::array<double, size>& weights, const State* stage, int i) {
  if constexpr (requires { requires P::parts > 1; }) {  // vector by vector, so that every sum stays in its register
#pragma GCC unroll 1
    for (int k = 0; k < P::parts; ++k)
      start.part[k] = detail::weighted_sum<n, first>(start.part[k], weights, [&](int r) { return stage[r][i].part[k]; });
    return start;
  } else {
    return detail::weighted_sum<n, first>(start, weights, [&](int r) -> const P& { return stage[r][i]; });
  }
}
template <int n, std::size_t size, class State>
auto weighted_sum(const std::array<double, size>& weights, const State* stage, int i) {
  return weighted_sum<n, 1>(weights[0] * stage[0][i], weights, stage, i);
}

// Whether the derivative at the step's end takes part in an error.
template <class Method>
constexpr bool end_counts() {
  return Method::error[Method::stages - 1] != 0;
}

}  // namespace fisherpoint
