// The embedded Runge-Kutta pair 5(4) of J. R. Dormand and P. J. Prince, "A family of embedded Runge-Kutta formulae",
// J. Comput. Appl. Math. 6 (1980) 19-26, with the fourth-order continuous extension of E. Hairer, S. P. Norsett, G. Wanner,
// "Solving ordinary differential equations I", 2nd ed., section II.6. First same as last: stage 7 is stage 1 of the next step.
#pragma once

#include <array>

#include "fisherpoint/integration/runge_kutta.hpp"
#include "fisherpoint/numbers/pack.hpp"
#include "fisherpoint/numbers/unroll.hpp"

namespace fisherpoint {

struct DormandPrince : StageSums<DormandPrince> {
  static constexpr int order = 5;
  static constexpr Count<7> stages{}, in_error{};
  static constexpr int most_stages = stages, most_in_error = in_error;
  static constexpr double most_growth = 5.0;       // of a step's size
  static constexpr double allowed_estimate = 1.0;  // of columns of sensitivities, in tolerances
  static constexpr double allowed_of_rows = 1.0;
  static constexpr double stability = 3.25;
  static constexpr double beside_kink = 10.0;

  static constexpr std::array<double, 7> c = {0, 1.0 / 5, 3.0 / 10, 4.0 / 5, 8.0 / 9, 1, 1};
  static constexpr std::array<std::array<double, 6>, 7> a = {{
      {},
      {1.0 / 5},
      {3.0 / 40, 9.0 / 40},
      {44.0 / 45, -56.0 / 15, 32.0 / 9},
      {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
      {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656},
      {35.0 / 384, 0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84},  // b of the fifth-order solution
  }};
  // Fifth-order minus fourth-order weights.
  static constexpr std::array<double, 7> error = {71.0 / 57600,      0,          -71.0 / 16695, 71.0 / 1920,
                                                  -17253.0 / 339200, 22.0 / 525, -1.0 / 40};
  static constexpr std::array<double, 6> coarse = {0.5, 0, 0, 0, 0, 0.5};  // the trapezoidal rule
  static constexpr auto behind = weights_behind(a, error, in_error);
  // What step control takes for the squared error: it falls with the tenth power of the step.
  template <class P>
  static P squared_error(const P& embedded, const P&) {
    return embedded;
  }
  template <class P>
  static P inverse_root(const P& squared_error) {
    return rough_inverse_root(squared_error, Count<2 * order>{});
  }
  // x(t + step/2) = (x0 + x1)/2 + step (k1 - k7)/8 + step sum(bow k): the cubic through both ends, and what a quartic adds.
  static constexpr std::array<double, 7> bow = {-12715105075.0 / 11282082432 / 16,  0,
                                                87487479700.0 / 32700410799 / 16,   -10690763975.0 / 1880347072 / 16,
                                                701980252875.0 / 199316789632 / 16, -1453857185.0 / 822651844 / 16,
                                                69997945.0 / 29380423 / 16};
};

namespace detail {

consteval bool near(double x, double y) { return x - y < 1e-14 && y - x < 1e-14; }

// Row sums, and the quadrature conditions sum b c^(q-1) = 1/q up to the order.
consteval bool consistent(const DormandPrince& m) {
  for (int i = 0; i < m.stages; ++i) {
    double row = 0;
    for (double a : m.a[i]) row += a;
    if (!near(row, m.c[i])) return false;
  }
  const auto moment = [&](int q) {
    double sum = 0;
    for (int i = 0; i < 6; ++i) {
      double power = m.a[6][i];
      for (int n = 1; n < q; ++n) power *= m.c[i];
      sum += power;
    }
    return sum;
  };
  for (int q = 1; q <= m.order; ++q)
    if (!near(moment(q), 1.0 / q)) return false;
  double difference = 0, bow = 0;
  for (int i = 0; i < m.stages; ++i) difference += m.error[i], bow += m.bow[i];
  return near(difference, 0) && near(bow, 0) && m.c[5] == 1.0;
}

}  // namespace detail

static_assert(detail::consistent(DormandPrince{}), "the tableau was mistyped");

}  // namespace fisherpoint
