// Eq. (19) of the cylinder and its variational equation (9), written out by hand for a number type T that is double or a pack.
//
// What depends on theta alone is computed once per trajectory. Within a piece the spool stays on one side of its centre, so the
// side is a template argument and the flow through the valve is smooth. The spool does not depend on theta: it has no
// sensitivities.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

struct Constants {
  double A_A, A_B, q_min, q_max, p_s, T_1, k_u;
};

constexpr std::size_t states = 5, parameters = 9, sensitive_states = 4;

template <class T>
struct Cylinder {
  Constants c;
  T target;  // of the spool
  T per_mass, friction, viscous, E, p_t, B_v, c_L, A_0, B_0, motion;

  Cylinder(const Constants& constants, const T* theta, const T& u, const T& motion)
      : c(constants),
        target(c.k_u * u),
        per_mass(1.0 / theta[2]),
        friction(theta[0] * motion),
        viscous(theta[1]),
        E(theta[3]),
        p_t(theta[4]),
        B_v(theta[5]),
        c_L(theta[6]),
        A_0(theta[7] - c.A_A * c.q_min),
        B_0(theta[8] + c.A_B * c.q_max),
        motion(motion) {}
};

template <class T, bool opens_a>
struct StateEquation {
  static constexpr std::size_t size = states;
  const Cylinder<T>& m;

  void operator()(const std::array<T, size>& x, std::array<T, size>& rate, double) const {
    using std::sqrt;
    const auto& [q, v, p_A, p_B, x_v] = x;
    const T s_A = sqrt(m.c.p_s - p_A), t_A = sqrt(p_A - m.p_t), s_B = sqrt(m.c.p_s - p_B), t_B = sqrt(p_B - m.p_t);
    const T valve = m.B_v * x_v;
    const T Q_A = valve * (opens_a ? s_A : t_A) + m.c_L * (s_A - t_A);
    const T Q_B = m.c_L * (s_B - t_B) - valve * (opens_a ? t_B : s_B);
    rate[0] = v;
    rate[1] = m.per_mass * (m.c.A_A * p_A - m.c.A_B * p_B - m.friction - m.viscous * v);
    rate[2] = m.E / (m.c.A_A * q + m.A_0) * (Q_A - m.c.A_A * v);
    rate[3] = m.E / (m.B_0 - m.c.A_B * q) * (Q_B + m.c.A_B * v);
    rate[4] = (m.target - x_v) * (1.0 / m.c.T_1);
  }
};

// The states, then the sensitivities of q, v, p_A and p_B, nine in a row.
template <class T, bool opens_a>
struct VariationalEquation {
  static constexpr std::size_t size = states + sensitive_states * parameters;
  const Cylinder<T>& m;

  void operator()(const std::array<T, size>& x, std::array<T, size>& rate, double) const {
    using std::sqrt;
    const T q = x[0], v = x[1], p_A = x[2], p_B = x[3], x_v = x[4];
    const T s_A = sqrt(m.c.p_s - p_A), t_A = sqrt(p_A - m.p_t), s_B = sqrt(m.c.p_s - p_B), t_B = sqrt(p_B - m.p_t);
    const T per_V_A = 1.0 / (m.c.A_A * q + m.A_0), per_V_B = 1.0 / (m.B_0 - m.c.A_B * q);
    const T k_A = m.E * per_V_A, k_B = m.E * per_V_B;
    const T gate_A = opens_a ? s_A : t_A, gate_B = opens_a ? t_B : s_B;
    const T flow_A = m.B_v * x_v * gate_A + m.c_L * (s_A - t_A) - m.c.A_A * v;
    const T flow_B = m.c_L * (s_B - t_B) - m.B_v * x_v * gate_B + m.c.A_B * v;
    const T v_rate = m.per_mass * (m.c.A_A * p_A - m.c.A_B * p_B - m.friction - m.viscous * v);
    const T p_A_rate = k_A * flow_A, p_B_rate = k_B * flow_B;
    rate[0] = v;
    rate[1] = v_rate;
    rate[2] = p_A_rate;
    rate[3] = p_B_rate;
    rate[4] = (m.target - x_v) * (1.0 / m.c.T_1);

    // |x_v| opens one edge of each chamber beside the leakage; the slope of a flow is half its conductance by its root.
    const T edge = m.B_v * (opens_a ? x_v : -x_v) + m.c_L;
    const T slope_sA = 0.5 * (opens_a ? edge : m.c_L) / s_A, slope_tA = 0.5 * (opens_a ? m.c_L : edge) / t_A;
    const T slope_sB = 0.5 * (opens_a ? m.c_L : edge) / s_B, slope_tB = 0.5 * (opens_a ? edge : m.c_L) / t_B;
    const T A_q = -p_A_rate * per_V_A * m.c.A_A, A_v = -k_A * m.c.A_A, A_p = -k_A * (slope_sA + slope_tA);
    const T B_q = p_B_rate * per_V_B * m.c.A_B, B_v = k_B * m.c.A_B, B_p = -k_B * (slope_sB + slope_tB);
    const T v_v = -m.per_mass * m.viscous, v_A = m.per_mass * m.c.A_A, v_B = -m.per_mass * m.c.A_B;

    const T zero = 0.0, per_E = 1.0 / m.E;
    const std::array<T, parameters> of_v = {
        -m.per_mass * m.motion, -m.per_mass * v, -m.per_mass * v_rate, zero, zero, zero, zero, zero, zero};
    const std::array<T, parameters> of_A = {
        zero, zero, zero, p_A_rate * per_E, k_A * slope_tA, k_A * x_v * gate_A, k_A * (s_A - t_A), -p_A_rate * per_V_A, zero};
    const std::array<T, parameters> of_B = {
        zero, zero, zero, p_B_rate * per_E, k_B * slope_tB, -k_B * x_v * gate_B, k_B * (s_B - t_B), zero, -p_B_rate * per_V_B};
    const T *S_q = &x[states], *S_v = S_q + parameters, *S_A = S_v + parameters, *S_B = S_A + parameters;
    T* out = &rate[states];
    for (std::size_t j = 0; j < parameters; ++j) {
      out[j] = S_v[j];
      out[parameters + j] = v_v * S_v[j] + v_A * S_A[j] + v_B * S_B[j] + of_v[j];
      out[2 * parameters + j] = A_q * S_q[j] + A_v * S_v[j] + A_p * S_A[j] + of_A[j];
      out[3 * parameters + j] = B_q * S_q[j] + B_v * S_v[j] + B_p * S_B[j] + of_B[j];
    }
  }
};
