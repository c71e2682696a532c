// The solution within a step of DOP853: the continuous extension of order seven of E. Hairer, S. P. Norsett, G. Wanner,
// "Solving ordinary differential equations I", 2nd ed., section II.6 (the authors' code DOP853), which takes the rate at the
// step's end and three more stages. With s = t/step
//
//     x(t) = x0 + s (c0 + (1-s) (c1 + s (c2 + (1-s) (c3 + s (c4 + (1-s) (c5 + s c6))))))
#pragma once

#include <array>

#include "fisherpoint/integration/dormand_prince_853.hpp"

namespace fisherpoint {

struct DenseOutput {
  static constexpr int first = DormandPrince853::in_error;  // stages that there are
  static constexpr int more = 4, stages = first + more;
  static constexpr int coefficients = 7;
  // Of squared errors of steps that are sampled: in such steps, three quarters as long, the polynomial is as good as the end is
  // in others.
  static constexpr double weight = 400.0;

  // Of stages first + 1 to stages - 1; that at the step's end has the weights of the solution.
  static constexpr std::array<std::array<double, stages - 1>, more - 1> weights = {{
      {0.056167502283047954, 0, 0, 0, 0, 0, 0.25350021021662483, -0.2462390374708025, -0.12419142326381637, 0.15329179827876568,
       0.00820105229563469, 0.007567897660545699, -0.008298},
      {0.03183464816350214, 0, 0, 0, 0, 0.028300909672366776, 0.053541988307438566, -0.05492374857139099, 0, 0,
       -0.00010834732869724932, 0.0003825710908356584, -0.00034046500868740456, 0.1413124436746325},
      {-0.42889630158379194, 0, 0, 0, 0, -4.697621415361164, 7.683421196062599, 4.06898981839711, 0.3567271874552811, 0, 0, 0,
       -0.0013990241651590145, 2.9475147891527724, -9.15095847217987},
  }};
  static constexpr std::array<double, more - 1> c = {0.1, 0.2, 7.0 / 9};
  // Of c3 to c6.
  static constexpr std::array<std::array<double, stages>, 4> tail = {{
      {-8.428938276109013, 0, 0, 0, 0, 0.5667149535193777, -3.0689499459498917, 2.38466765651207, 2.117034582445028,
       -0.871391583777973, 2.2404374302607883, 0.6315787787694688, -0.08899033645133331, 18.148505520854727, -9.194632392478356,
       -4.436036387594894},
      {10.427508642579134, 0, 0, 0, 0, 242.28349177525817, 165.20045171727028, -374.5467547226902, -22.113666853125306,
       7.733432668472264, -30.674084731089398, -9.332130526430229, 15.697238121770845, -31.139403219565178, -9.35292435884448,
       35.81684148639408},
      {19.985053242002433, 0, 0, 0, 0, -387.0373087493518, -189.17813819516758, 527.8081592054236, -11.57390253995963,
       6.8812326946963, -1.0006050966910838, 0.7777137798053443, -2.778205752353508, -60.19669523126412, 84.32040550667716,
       11.99229113618279},
      {-25.69393346270375, 0, 0, 0, 0, -154.18974869023643, -231.5293791760455, 357.6391179106141, 93.40532418362432,
       -37.45832313645163, 104.0996495089623, 29.8402934266605, -43.53345659001114, 96.32455395918828, -39.17726167561544,
       -149.72683625798564},
  }};

  // Whether a method has it.
  static constexpr bool exists(const auto& method) { return method.order == DormandPrince853::order; }

  // What stage first + e, e from 0 on, starts from: x and the sum of stages, each times the step; stage(s) has them.
  template <class P>
  static constexpr P ahead(int e, P x, auto&& stage) {
    if (e == 0) {
      for (int s = 0; s < first; ++s)
        if (DormandPrince853::a[first][s] != 0) x += DormandPrince853::a[first][s] * stage(s);
      return x;
    }
    for (int s = 0; s < first + e; ++s)
      if (weights[e - 1][s] != 0) x += weights[e - 1][s] * stage(s);
    return x;
  }
  // put(n, c_n) of a number that moves by `change` in the step; stage(s) has all stages, each times the step.
  template <class P>
  static constexpr void fit_polynomial(const P& change, auto&& stage, auto&& put) {
    const P slope = stage(0) - change;
    put(0, change);
    put(1, slope);
    put(2, change - stage(first) - slope);
    for (int n = 0; n < 4; ++n) {
      P sum(0.0);
      for (int s = 0; s < stages; ++s)
        if (tail[n][s] != 0) sum += tail[n][s] * stage(s);
      put(3 + n, sum);
    }
  }
  // The change from the start until a share of the step.
  template <class P>
  static constexpr P change_until(const P& share, auto&& coefficient) {
    const P left = 1.0 - share;
    P value = coefficient(coefficients - 1);
    for (int n = coefficients - 1; n-- > 0;) value = coefficient(n) + (n % 2 ? share : left) * value;
    return share * value;
  }
};

namespace detail {

// Row sums and, of the polynomial, that it gives t^q where the rates are q t^(q-1), up to order seven.
consteval bool consistent(const DenseOutput& dense) {
  const auto near = [](double x, double y) { return x - y < 1e-12 && y - x < 1e-12; };
  std::array<double, DenseOutput::stages> c{};
  for (int s = 0; s <= dense.first; ++s) c[s] = DormandPrince853::c[s];
  for (int e = 1; e < dense.more; ++e) {
    double row = 0;
    for (double weight : dense.weights[e - 1]) row += weight;
    c[dense.first + e] = dense.c[e - 1];
    if (!near(row, dense.c[e - 1])) return false;
  }
  for (int q = 1; q <= 7; ++q) {
    const auto rate = [&](int s) {
      double power = q;
      for (int n = 1; n < q; ++n) power *= c[s];
      return power;
    };
    std::array<double, DenseOutput::coefficients> of{};
    dense.fit_polynomial(1.0, rate, [&](int n, double value) { of[n] = value; });
    for (const double share : {0.15, 0.5, 0.85}) {
      double power = 1;
      for (int n = 0; n < q; ++n) power *= share;
      if (!near(dense.change_until(share, [&](int n) { return of[n]; }), power)) return false;
    }
  }
  return true;
}

}  // namespace detail

static_assert(detail::consistent(DenseOutput{}), "the numbers were mistyped");

}  // namespace fisherpoint
