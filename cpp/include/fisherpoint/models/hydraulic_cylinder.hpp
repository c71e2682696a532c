// Servo-hydraulic cylinder, eq. (19) of F. Dietrich, A. Raatz, J. Hesselbach, "A-priori Fisher information of nonlinear
// state space models for experiment design".
//
// Readings of the print: the p_B row of (19a) takes Q_LB; x_v' = (k_u u - x_v)/T_1 with a known valve polarity k_u, of which
// -1 is the print; B_v = c_d sqrt(2/rho) serves both flows; sigma(v) in (19c) is sign(v), Coulomb friction.
#pragma once

#include "fisherpoint/models/model.hpp"
#include "fisherpoint/numbers/dual.hpp"
#include "fisherpoint/numbers/pack.hpp"

namespace fisherpoint {

struct HydraulicCylinder {
  double A_A = 1.9635e-3, A_B = 9.4562e-4;  // piston areas, m2
  double q_min = 0.0, q_max = 0.30;         // stroke, m
  double p_s = 21e6;                        // supply pressure, Pa
  double T_1 = 2.2e-3;                      // time constant of the valve, s
  double k_u = -1.0;                        // valve polarity

  static constexpr std::string_view name = "hydraulic_cylinder";
  static constexpr std::array states = {
      Quantity{"q", "m", "piston position", 0.5},          Quantity{"v", "m/s", "piston velocity", 1.0},
      Quantity{"p_A", "Pa", "pressure in chamber A", 1e7}, Quantity{"p_B", "Pa", "pressure in chamber B", 1e7},
      Quantity{"x_v", "1", "valve spool position", 1.0},
  };
  static constexpr std::array inputs = {Quantity{"u", "1", "valve control value", 1.0}};
  static constexpr std::array outputs = {states[0], states[2], states[3], states[4]};
  static constexpr std::array parameters = {
      // in (20)'s order
      Quantity{"a_tau", "N", "Coulomb friction"},
      Quantity{"b_tau", "N s/m", "viscous friction"},
      Quantity{"m_q", "kg", "moved mass"},
      Quantity{"E_oil", "Pa", "bulk modulus of the oil"},
      Quantity{"p_t", "Pa", "tank pressure"},
      Quantity{"B_v", "m3/(s sqrt(Pa))", "valve flow coefficient, c_d sqrt(2/rho)"},
      Quantity{"c_L", "m3/(s sqrt(Pa))", "leakage coefficient"},
      Quantity{"V_0A", "m3", "dead volume of chamber A"},
      Quantity{"V_0B", "m3", "dead volume of chamber B"},
  };
  static constexpr std::array jumps = {Surface{"v"}};
  static constexpr std::array kinks = {Surface{"x_v"}};
  static constexpr std::array domain = {Surface{"p_A - p_t"}, Surface{"p_s - p_A"}, Surface{"p_B - p_t"},
                                        Surface{"p_s - p_B"}, Surface{"V_A"},       Surface{"V_B"}};
  static constexpr std::array<Variables, 5> constant_slopes = {0b00'0010, 0b10'1110};  // q' by v, v' by v, p_A, p_B and a_tau

  auto dynamics(const auto& theta) const {
    const auto& [a_tau, b_tau, m_q, E_oil, p_t, B_v, c_L, V_0A, V_0B] = theta;
    const auto per_mass = 1.0 / m_q;
    const double spool_rate = 1.0 / T_1;
    return [=, *this](const auto& x, const auto& inputs, const auto& side) {
      const auto& [q, v, p_A, p_B, x_v] = x;
      const auto& [u] = inputs;
      const auto& [motion, spool] = side;

      const auto opening = x_v * heaviside(spool);      // x_v H(x_v)
      const auto closing = -(x_v * heaviside(-spool));  // -x_v H(-x_v)
      const auto s_A = sqrt(p_s - p_A);                 // supply to A
      const auto t_A = sqrt(p_A - p_t);                 // A to tank
      const auto s_B = sqrt(p_s - p_B);
      const auto t_B = sqrt(p_B - p_t);

      const auto tau_f = a_tau * motion + b_tau * v;           // (19c)
      const auto Q_A = B_v * (opening * s_A - closing * t_A);  // (19d)
      const auto Q_B = B_v * (closing * s_B - opening * t_B);  // (19e)
      const auto Q_LA = c_L * (s_A - t_A);                     // (19f)
      const auto Q_LB = c_L * (s_B - t_B);                     // (19g)
      const auto V_A = A_A * (q - q_min) + V_0A;               // (19h)
      const auto V_B = A_B * (q_max - q) + V_0B;               // (19i)
      const auto E_by_VV = E_oil / (V_A * V_B);                // one division, which is slow, for E_oil / V_A and E_oil / V_B

      return std::tuple{v,  // (19a)
                        per_mass * (A_A * p_A - A_B * p_B - tau_f), V_B * E_by_VV * (Q_A + Q_LA - v * A_A),
                        V_A * E_by_VV * (Q_B + Q_LB + v * A_B), (k_u * u - x_v) * spool_rate};
    };
  }

  auto output(const auto& x, const auto&, const auto&) const {  // (19b)
    const auto& [q, v, p_A, p_B, x_v] = x;
    return std::tuple{q, p_A, p_B, x_v};
  }

  auto switching(const auto& x, const auto&, const auto&) const {
    const auto& [q, v, p_A, p_B, x_v] = x;
    return std::tuple{v, x_v};
  }

  auto limits(const auto& x, const auto&, const auto& theta) const {
    const auto& [q, v, p_A, p_B, x_v] = x;
    const auto& [a_tau, b_tau, m_q, E_oil, p_t, B_v, c_L, V_0A, V_0B] = theta;
    return std::tuple{p_A - p_t, p_s - p_A, p_B - p_t, p_s - p_B, A_A * (q - q_min) + V_0A, A_B * (q_max - q) + V_0B};
  }
};

static_assert(Model<HydraulicCylinder>);

}  // namespace fisherpoint
