// The implicit method for stiff stretches: Radau IIA with three stages, of order 5, L-stable and stiffly accurate, with the
// embedded error of E. Hairer, G. Wanner, "Solving ordinary differential equations II", 2nd ed., section IV.8. Its stages are
// those of a cubic x(t) that solves x' = f at three times of the step, the last one of them its end.
//
// Of the methods that would do, this one has sensitivities that are exact derivatives of its stages (implicit_tangents.hpp),
// for which Rosenbrock methods would need f_xx, and stages of order three, which diagonally implicit ones do not have.
#pragma once

#include <array>

namespace fisherpoint {

struct Radau {
  static constexpr double root = 2.449489742783178098;  // of 6
  static constexpr int stages = 3;
  static constexpr int error_order = 4;       // the embedded error falls with this power of the step
  static constexpr double most_growth = 8.0;  // of a step's size
  static constexpr std::array<double, 3> c = {(4 - root) / 10, (4 + root) / 10, 1};
  // With Z_i = x(t + c_i h) - x(t): sum_j inverse_ij Z_j = h f at stage i.
  static constexpr std::array<std::array<double, 3>, 3> inverse = {{
      {2 + root / 2, -1.2 + 29 * root / 30, 0.4 - 4 * root / 15},
      {-1.2 - 29 * root / 30, 2 - root / 2, 0.4 + 4 * root / 15},
      {-1 + 8 * root / 3, -1 - 8 * root / 3, 5},
  }};
  // x(t + s h) = x(t) + s q_1 + s^2 q_2 + s^3 q_3 with q_j = sum_i cubic_ij Z_i.
  static constexpr std::array<std::array<double, 3>, 3> cubic = {{
      {13.0 / 3 + 7 * root / 3, -23.0 / 3 - 22 * root / 3, 10.0 / 3 + 5 * root},
      {13.0 / 3 - 7 * root / 3, -23.0 / 3 + 22 * root / 3, 10.0 / 3 - 5 * root},
      {1.0 / 3, -8.0 / 3, 10.0 / 3},
  }};
  // Of the Z_i in the embedded error.
  static constexpr std::array<double, 3> error = {(-13 - 7 * root) / 3, (-13 + 7 * root) / 3, -1.0 / 3};
  // Z = to_z W uncouples the stages into one real and one complex system: `inverse` has the eigenvalues `real` and
  // part_re +- i part_im.
  static constexpr double real = 3.637834252744495732, part_re = 2.681082873627752134, part_im = -3.050430199247410569;
  static constexpr std::array<std::array<double, 3>, 3> to_z = {{
      {0.09443876248897524, -0.14125529502095421, 0.03002919410514742},
      {0.25021312296533332, 0.20412935229379994, -0.38294211275726192},
      {1, 1, 0},
  }};
  static constexpr std::array<std::array<double, 3>, 3> to_w = {{
      {4.17871859155190428, 0.32768282076106237, 0.52337644549944951},
      {-4.17871859155190428, -0.32768282076106237, 0.47662355450055044},
      {0.50287263494578682, -2.57192694985560522, 0.59603920482822492},
  }};
};

namespace detail {

// Cubics are collocated by `inverse` and found by `cubic`; `to_z` and `to_w` are inverse to each other, and uncouple.
consteval bool consistent(const Radau& m) {
  const auto near = [](double x, double y) { return x - y < 1e-13 && y - x < 1e-13; };
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      double slope = 0, of_cubic = 0, identity = 0, uncoupled = 0;
      for (int k = 0; k < 3; ++k) {
        double power = m.c[k];
        for (int n = 0; n < j; ++n) power *= m.c[k];
        slope += m.inverse[i][k] * power;
        of_cubic += m.cubic[k][i] * power;
        identity += m.to_z[i][k] * m.to_w[k][j];
        uncoupled += m.inverse[i][k] * m.to_z[k][j];
      }
      double power = j + 1;
      for (int n = 0; n < j; ++n) power *= m.c[i];
      const double expected = j == 0   ? m.real * m.to_z[i][0]
                              : j == 1 ? m.part_re * m.to_z[i][1] + m.part_im * m.to_z[i][2]
                                       : -m.part_im * m.to_z[i][1] + m.part_re * m.to_z[i][2];
      if (!near(slope, power) || !near(of_cubic, i == j) || !near(identity, i == j) || !near(uncoupled, expected)) return false;
    }
  return true;
}

}  // namespace detail

static_assert(detail::consistent(Radau{}), "the tableau was mistyped");

}  // namespace fisherpoint
