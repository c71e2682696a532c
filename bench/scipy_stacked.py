"""The other side at its best: many nodes of one candidate stacked to one system, with a NumPy right-hand side.

The nodes then share their steps and the cost of Python. That works for this model, whose kink comes at a time that does not
depend on theta; in general the nodes have no common restart. The bench shows this ratio too, but its target is the other one.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

from .scipy_peer import A_A, A_B, K_U, P_S, Q_MAX, Q_MIN, T_1, pieces
from .workload import OUTPUT_ROWS, STATE_SCALES, Array, Pairs

NODES = 2187
"""Nodes per system: enough to share the cost of Python, few enough to stay in the cache."""


def stacked_equation(theta: Array, u: float, motion: float, opens_a: bool) -> Callable[[float, Array], Array]:
    """Eq. (19) for theta (R, p) and states (5 R,), state by state; v and x_v keep their signs."""
    a_tau, b_tau, m_q, e_oil, p_t, b_v, c_l, v_0a, v_0b = np.ascontiguousarray(theta.T)
    friction, target = a_tau * motion, K_U * u
    rate = np.empty((5, len(theta)))

    def f(_: float, y: Array) -> Array:
        q, v, p_a, p_b, x_v = y.reshape(5, -1)
        s_a, t_a, s_b, t_b = np.sqrt(P_S - p_a), np.sqrt(p_a - p_t), np.sqrt(P_S - p_b), np.sqrt(p_b - p_t)
        valve = b_v * x_v
        q_a, q_b = (s_a, t_b) if opens_a else (t_a, s_b)
        rate[0] = v
        rate[1] = (A_A * p_a - A_B * p_b - friction - b_tau * v) / m_q
        rate[2] = e_oil / (A_A * (q - Q_MIN) + v_0a) * (valve * q_a + c_l * (s_a - t_a) - A_A * v)
        rate[3] = e_oil / (A_B * (Q_MAX - q) + v_0b) * (A_B * v - valve * q_b + c_l * (s_b - t_b))
        rate[4] = (target - x_v) / T_1
        return rate.ravel().copy()

    return f


def solve_stacked(pairs: Pairs, rtol: float) -> Array:
    """Return the outputs (K, n_y) of pairs whose points come in runs of `NODES` equal ones."""
    ends = []
    for first in range(0, len(pairs), NODES):
        theta = pairs.theta[first : first + NODES]
        x0, u, dt = pairs.points.x0[first], float(pairs.points.u[first, 0]), float(pairs.points.dt[first])
        y = np.repeat(x0, len(theta))
        atol = rtol * np.repeat(STATE_SCALES, len(theta))
        for begin, end in pieces(x0[4], u, dt):
            opens_a = bool(x0[4] > 0) if begin == 0 else K_U * u > 0
            f = stacked_equation(theta, u, np.sign(x0[1]), opens_a)
            with np.errstate(invalid="ignore"):  # a trial step past the domain: RK45 takes NaN for a failed step
                y = solve_ivp(f, (begin, end), y, method="RK45", rtol=rtol, atol=atol).y[:, -1]
        ends.append(y.reshape(5, -1)[OUTPUT_ROWS].T)
    return np.concatenate(ends)
