// The eighth-order method of E. Hairer, S. P. Norsett, G. Wanner, "Solving ordinary differential equations I", 2nd ed., section
// II.10 (the authors' code DOP853), with its embedded errors of orders five and three. First same as last: stage 13 is stage 1
// of the next step.
#pragma once

#include <array>

#include "fisherpoint/integration/runge_kutta.hpp"
#include "fisherpoint/numbers/pack.hpp"
#include "fisherpoint/numbers/unroll.hpp"

namespace fisherpoint {

struct DormandPrince853 : StageSums<DormandPrince853> {
  static constexpr int order = 8;
  static constexpr Count<13> stages{};
  static constexpr Count<12> in_error{};
  static constexpr int most_stages = stages, most_in_error = in_error;
  static constexpr double most_growth = 6.0;       // of a step's size
  static constexpr double allowed_estimate = 5.0;  // of columns of sensitivities, in tolerances
  static constexpr double allowed_of_rows = 2.0;
  static constexpr double stability = 6.1;
  static constexpr double beside_kink = 2.0;

  static constexpr std::array<double, 13> c = {0,
                                               0.05260015195876773,
                                               0.0789002279381516,
                                               0.1183503419072274,
                                               0.2816496580927726,
                                               0.3333333333333333,
                                               0.25,
                                               0.3076923076923077,
                                               0.6512820512820513,
                                               0.6,
                                               0.8571428571428571,
                                               1.0,
                                               1.0};
  static constexpr std::array<std::array<double, 12>, 13> a = {{
      {},
      {0.05260015195876773},
      {0.0197250569845379, 0.0591751709536137},
      {0.02958758547680685, 0, 0.08876275643042054},
      {0.2413651341592667, 0, -0.8845494793282861, 0.924834003261792},
      {0.037037037037037035, 0, 0, 0.17082860872947386, 0.12546768756682242},
      {0.037109375, 0, 0, 0.17025221101954405, 0.06021653898045596, -0.017578125},
      {0.03709200011850479, 0, 0, 0.17038392571223998, 0.10726203044637328, -0.015319437748624402, 0.008273789163814023},
      {0.6241109587160757, 0, 0, -3.3608926294469414, -0.868219346841726, 27.59209969944671, 20.154067550477894,
       -43.48988418106996},
      {0.47766253643826434, 0, 0, -2.4881146199716677, -0.590290826836843, 21.230051448181193, 15.279233632882423,
       -33.28821096898486, -0.020331201708508627},
      {-0.9371424300859873, 0, 0, 5.186372428844064, 1.0914373489967295, -8.149787010746927, -18.52006565999696,
       22.739487099350505, 2.4936055526796523, -3.0467644718982196},
      {2.273310147516538, 0, 0, -10.53449546673725, -2.0008720582248625, -17.9589318631188, 27.94888452941996,
       -2.8589982771350235, -8.87285693353063, 12.360567175794303, 0.6433927460157636},
      {0.054293734116568765, 0, 0, 0, 0, 4.450312892752409, 1.8915178993145003, -5.801203960010585, 0.3111643669578199,
       -0.1521609496625161, 0.20136540080403034, 0.04471061572777259},  // b of the eighth-order solution
  }};
  // Eighth-order minus fifth-order weights, and third-order ones.
  static constexpr std::array<double, 13> error = {0.01312004499419488,
                                                   0,
                                                   0,
                                                   0,
                                                   0,
                                                   -1.2251564463762044,
                                                   -0.4957589496572502,
                                                   1.6643771824549864,
                                                   -0.35032884874997366,
                                                   0.3341791187130175,
                                                   0.08192320648511571,
                                                   -0.022355307863886294,
                                                   0};
  static constexpr std::array<double, 12> coarse = {0.2440944881889764,  0, 0, 0, 0, 0, 0, 0, 0.7338466882816118, 0, 0,
                                                    0.022058823529411766};
  static constexpr auto behind = weights_behind(a, error, in_error);
  // What step control takes for the squared error: it falls with the eighth power of the step.
  template <class P>
  static P squared_error(const P& embedded, const P& by_coarse) {
    return embedded * embedded / (embedded + 0.01 * by_coarse + 1e-300);
  }
  template <class P>
  static P inverse_root(const P& squared_error) {
    return rough_inverse_root(squared_error, Count<2 * order>{});
  }
  // x(t + step/2) = (x0 + x1)/2 + step (k1 - k13)/8 + step sum(bow k), of order six: the solution of the order conditions at
  // the middle of the step with the smallest weights.
  static constexpr std::array<double, 13> bow = {-0.07960653701500475,
                                                 0,
                                                 0,
                                                 0,
                                                 0,
                                                 -2.3339463541169643,
                                                 -0.49795732955108474,
                                                 2.8869926387820315,
                                                 -0.2749199612003889,
                                                 0.30690603746274814,
                                                 -0.11578931883309801,
                                                 -0.04098473108375933,
                                                 0.14930555555551994};
};

namespace detail {

// Row sums, the quadrature conditions sum b c^(q-1) = 1/q up to the order, and those of order 5 for the embedded weights.
consteval bool consistent(const DormandPrince853& m) {
  const auto near = [](double x, double y) { return x - y < 1e-13 && y - x < 1e-13; };
  for (int i = 0; i < m.stages; ++i) {
    double row = 0;
    for (double a : m.a[i]) row += a;
    if (!near(row, m.c[i])) return false;
  }
  const auto moment = [&](const auto& weights, int q) {
    double sum = 0;
    for (std::size_t i = 0; i < weights.size(); ++i) {
      double power = weights[i];
      for (int n = 1; n < q; ++n) power *= m.c[i];
      sum += power;
    }
    return sum;
  };
  for (int q = 1; q <= m.order; ++q)
    if (!near(moment(m.a[12], q), 1.0 / q)) return false;
  for (int q = 1; q <= 5; ++q)
    if (!near(moment(m.error, q), 0)) return false;
  for (int q = 1; q <= 3; ++q)
    if (!near(moment(m.coarse, q), 1.0 / q)) return false;
  // The cubic through both ends has its middle at (x0 + x1)/2 + step (k1 - k13)/8.
  double half = 0.5;
  for (int q = 1; q <= 6; ++q, half *= 0.5)
    if (!near(moment(m.bow, q) + 0.5 / q + (q == 1 ? 0.125 : 0.0) - 0.125, half / q)) return false;
  return m.c[11] == 1.0;
}

}  // namespace detail

static_assert(detail::consistent(DormandPrince853{}), "the tableau was mistyped");

}  // namespace fisherpoint
