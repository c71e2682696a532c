"""numbalsoda: DOP853 in compiled code, with right-hand sides and the loop over trajectories by Numba.

The tolerance of the library is one number for all components, so states and sensitivities are divided by their scales. Each
trajectory restarts at x_v = 0.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import carray, cfunc, njit
from numbalsoda import dop853, lsoda_sig

from ..scipy_peer import A_A, A_B, P_S, Q_MAX, Q_MIN, T_1
from ..workload import STATE_SCALES, Array, Pairs
from .peer import Peer, Solution, blocks, sensitivity_scales

Q_SCALE, P_SCALE = 0.5, 1e7
P, SIDE, MOTION, TARGET, SCALES = 9, 9, 10, 11, 12
"""Places in the data of an equation: theta, the side that the valve opens, signs, and where the scales of the rows begin."""


@cfunc(lsoda_sig, error_model="numpy")
def state_equation(t, x, rate, data):  # type: ignore[no-untyped-def]
    d = carray(data, (12,))
    q, v, p_a, p_b, x_v = x[0] * Q_SCALE, x[1], x[2] * P_SCALE, x[3] * P_SCALE, x[4]
    s_a, t_a, s_b, t_b = sqrt(P_S - p_a), sqrt(p_a - d[4]), sqrt(P_S - p_b), sqrt(p_b - d[4])
    valve = d[5] * x_v
    q_a, q_b = (valve * s_a, valve * t_b) if d[SIDE] > 0 else (valve * t_a, valve * s_b)
    rate[0] = v / Q_SCALE
    rate[1] = (A_A * p_a - A_B * p_b - d[0] * d[MOTION] - d[1] * v) / d[2]
    rate[2] = d[3] / P_SCALE / (A_A * (q - Q_MIN) + d[7]) * (q_a + d[6] * (s_a - t_a) - A_A * v)
    rate[3] = d[3] / P_SCALE / (A_B * (Q_MAX - q) + d[8]) * (d[6] * (s_b - t_b) - q_b + A_B * v)
    rate[4] = (d[TARGET] - x_v) / T_1


@cfunc(lsoda_sig, error_model="numpy")
def variational_equation(t, x, rate, data):  # type: ignore[no-untyped-def]
    d = carray(data, (SCALES + 36,))
    b_tau, m_q, e_oil, b_v, c_l = d[1], d[2], d[3], d[5], d[6]
    q, v, p_a, p_b, x_v = x[0] * Q_SCALE, x[1], x[2] * P_SCALE, x[3] * P_SCALE, x[4]
    s_a, t_a, s_b, t_b = sqrt(P_S - p_a), sqrt(p_a - d[4]), sqrt(P_S - p_b), sqrt(p_b - d[4])
    opening, closing = (x_v, 0.0) if d[SIDE] > 0 else (0.0, -x_v)
    per_a, per_b = 1 / (A_A * (q - Q_MIN) + d[7]), 1 / (A_B * (Q_MAX - q) + d[8])
    k_a, k_b = e_oil * per_a, e_oil * per_b
    valve_a, valve_b = opening * s_a - closing * t_a, closing * s_b - opening * t_b
    v_rate = (A_A * p_a - A_B * p_b - d[0] * d[MOTION] - b_tau * v) / m_q
    a_rate = k_a * (b_v * valve_a + c_l * (s_a - t_a) - v * A_A)
    b_rate = k_b * (b_v * valve_b + c_l * (s_b - t_b) + v * A_B)
    rate[0], rate[1], rate[2], rate[3] = v / Q_SCALE, v_rate, a_rate / P_SCALE, b_rate / P_SCALE
    rate[4] = (d[TARGET] - x_v) / T_1
    slope_sa, slope_ta = 0.5 * (b_v * opening + c_l) / s_a, 0.5 * (b_v * closing + c_l) / t_a
    slope_sb, slope_tb = 0.5 * (b_v * closing + c_l) / s_b, 0.5 * (b_v * opening + c_l) / t_b
    a_q, a_v, a_p = -a_rate * per_a * A_A, -k_a * A_A, -k_a * (slope_sa + slope_ta)
    b_q, b_v_, b_p = b_rate * per_b * A_B, k_b * A_B, -k_b * (slope_sb + slope_tb)
    for j in range(9):
        r_q, r_v, r_a, r_b = d[SCALES + j], d[SCALES + 9 + j], d[SCALES + 18 + j], d[SCALES + 27 + j]
        s_q, s_v, s_pa, s_pb = x[5 + j] * r_q, x[14 + j] * r_v, x[23 + j] * r_a, x[32 + j] * r_b
        rate[5 + j] = s_v / r_q
        rate[14 + j] = (A_A * s_pa - A_B * s_pb - b_tau * s_v) / (m_q * r_v)
        rate[23 + j] = (a_q * s_q + a_v * s_v + a_p * s_pa) / r_a
        rate[32 + j] = (b_q * s_q + b_v_ * s_v + b_p * s_pb) / r_b
    rate[14] -= d[MOTION] / (m_q * d[SCALES + 9])
    rate[15] -= v / (m_q * d[SCALES + 10])
    rate[16] -= v_rate / (m_q * d[SCALES + 11])
    rate[26] += a_rate / e_oil / d[SCALES + 21]
    rate[27] += k_a * slope_ta / d[SCALES + 22]
    rate[28] += k_a * valve_a / d[SCALES + 23]
    rate[29] += k_a * (s_a - t_a) / d[SCALES + 24]
    rate[30] -= a_rate * per_a / d[SCALES + 25]
    rate[35] += b_rate / e_oil / d[SCALES + 30]
    rate[36] += k_b * slope_tb / d[SCALES + 31]
    rate[37] += k_b * valve_b / d[SCALES + 32]
    rate[38] += k_b * (s_b - t_b) / d[SCALES + 33]
    rate[40] -= b_rate * per_b / d[SCALES + 35]


@njit
def solve(equation, start, data, theta, times, sides, rtol, ends):  # type: ignore[no-untyped-def]
    for k in range(len(theta)):
        data[:P] = theta[k]
        x = start
        for i in range(len(sides)):
            data[SIDE] = sides[i]
            x = dop853(equation, x, times[i], data=data, rtol=rtol, atol=rtol)[0][1]
        ends[k] = x


class NumbaDop853(Peer):
    name = "numbalsoda dop853"

    def outputs(self, pairs: Pairs, rtol: float) -> Solution:
        return Solution.of_states(_solve_all(state_equation.address, pairs, rtol, STATE_SCALES, 5))

    def sensitivities(self, pairs: Pairs, rtol: float) -> Solution:
        scales = np.concatenate([STATE_SCALES, sensitivity_scales()[:4].ravel()])
        ends = _solve_all(variational_equation.address, pairs, rtol, scales, 41)
        dx_dtheta = np.zeros((len(pairs), 5, 9))  # the spool's stay zero
        dx_dtheta[:, :4] = ends[:, 5:].reshape(-1, 4, 9)
        return Solution.of_states(ends[:, :5], None, dx_dtheta)


def _solve_all(equation: int, pairs: Pairs, rtol: float, scales: Array, size: int) -> Array:
    ends = np.empty((len(pairs), size))
    data = np.concatenate([np.zeros(SCALES), scales[5:]])
    for block in blocks(pairs):
        start = np.zeros(size)
        start[:5] = block.x0 / STATE_SCALES
        data[MOTION], data[TARGET] = block.motion, block.target
        # The library leaves out the row of the last time where its steps end a rounding error before that.
        times = np.array([[0.0, span.end - span.begin, (1 + 1e-9) * (span.end - span.begin)] for span in block.spans])
        sides = np.array([1.0 if span.opens_a else -1.0 for span in block.spans])
        solve(equation, start, data, np.ascontiguousarray(block.theta), times, sides, rtol, ends[block.rows])
    return ends * scales


PEERS: list[Peer] = [NumbaDop853()]
