"""The other side: scipy.integrate.solve_ivp(method="RK45"), one trajectory at a time.

The right-hand sides are plain Python on floats, which for five states is faster than NumPy. Two ways are tried: straight through,
and restarted where x_v = 0. The time of that restart is known in closed form, which costs less than an event function. Neither way
looks for v = 0 or for the limits of the domain, as ours does.
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp, log, nan, sqrt
from typing import Any, Literal

import numpy as np
from scipy.integrate import solve_ivp

from .workload import MODEL, OUTPUT_ROWS, STATE_SCALES, Array, Pairs

Method = Literal["RK45", "DOP853", "LSODA"]
WAYS = {"straight through": False, "restarted at x_v = 0": True}

_C = MODEL.constants
A_A, A_B, Q_MIN, Q_MAX, P_S, T_1, K_U = (_C[name] for name in ("A_A", "A_B", "q_min", "q_max", "p_s", "T_1", "k_u"))
NO_VALUE = [nan] * 5  # a trial step past the domain: RK45 takes it for a failed step


def state_equation(theta: Array, u: float, motion: float) -> Callable[[float, Array], list[float]]:
    """Eq. (19); the velocity keeps its sign `motion`."""
    a_tau, b_tau, m_q, e_oil, p_t, b_v, c_l, v_0a, v_0b = theta.tolist()
    friction, target = a_tau * motion, K_U * u

    def f(_: float, x: Array) -> list[float]:
        q, v, p_a, p_b, x_v = x.tolist()
        try:
            s_a, t_a, s_b, t_b = sqrt(P_S - p_a), sqrt(p_a - p_t), sqrt(P_S - p_b), sqrt(p_b - p_t)
        except ValueError:
            return NO_VALUE
        valve = b_v * x_v
        q_a, q_b = (valve * s_a, -valve * t_b) if x_v > 0 else (valve * t_a, -valve * s_b)
        return [
            v,
            (A_A * p_a - A_B * p_b - friction - b_tau * v) / m_q,
            e_oil / (A_A * (q - Q_MIN) + v_0a) * (q_a + c_l * (s_a - t_a) - v * A_A),
            e_oil / (A_B * (Q_MAX - q) + v_0b) * (q_b + c_l * (s_b - t_b) + v * A_B),
            (target - x_v) / T_1,
        ]

    return f


def variational_equation(theta: Array, u: float, motion: float) -> Callable[[float, Array], Array]:
    """Eq. (19) with eq. (9): 5 states, then the 5 x 9 sensitivities row by row; Jacobians by hand, their zeros set once."""
    a_tau, b_tau, m_q, e_oil, p_t, b_v, c_l, v_0a, v_0b = theta.tolist()
    friction, target = a_tau * motion, K_U * u
    f_x, f_theta = np.zeros((5, 5)), np.zeros((5, 9))
    f_x[0, 1], f_x[4, 4] = 1.0, -1.0 / T_1
    f_x[1, 1:4] = -b_tau / m_q, A_A / m_q, -A_B / m_q
    f_theta[1, 0] = -motion / m_q

    def f(_: float, y: Array) -> Array:
        q, v, p_a, p_b, x_v = y[:5].tolist()
        try:
            s_a, t_a, s_b, t_b = sqrt(P_S - p_a), sqrt(p_a - p_t), sqrt(P_S - p_b), sqrt(p_b - p_t)
        except ValueError:
            return np.full(50, nan)
        opening, closing = (x_v, 0.0) if x_v > 0 else (0.0, -x_v)
        k_a, k_b = e_oil / (A_A * (q - Q_MIN) + v_0a), e_oil / (A_B * (Q_MAX - q) + v_0b)
        valve_a, valve_b = opening * s_a - closing * t_a, closing * s_b - opening * t_b
        v_rate = (A_A * p_a - A_B * p_b - friction - b_tau * v) / m_q
        p_a_rate = k_a * (b_v * valve_a + c_l * (s_a - t_a) - v * A_A)
        p_b_rate = k_b * (b_v * valve_b + c_l * (s_b - t_b) + v * A_B)
        # The slopes of the flows with the pressure on either side of each edge; c_L shares the edge with the valve.
        slope_sa, slope_ta = 0.5 * (b_v * opening + c_l) / s_a, 0.5 * (b_v * closing + c_l) / t_a
        slope_sb, slope_tb = 0.5 * (b_v * closing + c_l) / s_b, 0.5 * (b_v * opening + c_l) / t_b
        stiffening_a, stiffening_b = p_a_rate * k_a / e_oil, p_b_rate * k_b / e_oil
        f_x[2] = -stiffening_a * A_A, -k_a * A_A, -k_a * (slope_sa + slope_ta), 0.0, k_a * b_v * (s_a if x_v > 0 else t_a)
        f_x[3] = stiffening_b * A_B, k_b * A_B, 0.0, -k_b * (slope_sb + slope_tb), -k_b * b_v * (t_b if x_v > 0 else s_b)
        f_theta[1, 1:3] = -v / m_q, -v_rate / m_q
        f_theta[2, 3:8] = p_a_rate / e_oil, k_a * slope_ta, k_a * valve_a, k_a * (s_a - t_a), -stiffening_a
        f_theta[3, 3:7] = p_b_rate / e_oil, k_b * slope_tb, k_b * valve_b, k_b * (s_b - t_b)
        f_theta[3, 8] = -stiffening_b
        rate = np.empty(50)
        rate[:5] = v, v_rate, p_a_rate, p_b_rate, (target - x_v) / T_1
        rate[5:] = (f_x @ y[5:].reshape(5, 9) + f_theta).ravel()
        return rate

    return f


def pieces(x_v: float, u: float, dt: float) -> list[tuple[float, float]]:
    """Return the spans before and after x_v(t) = k_u u + (x_v - k_u u) exp(-t / T_1) passes zero, or the whole."""
    target = K_U * u
    if x_v * target >= 0 or x_v * (target + (x_v - target) * exp(-dt / T_1)) >= 0:
        return [(0.0, dt)]
    t = T_1 * log((x_v - target) / -target)
    return [(0.0, t), (t, dt)]


def solve(
    equation: Callable[..., Any], pairs: Pairs, rtol: float, scales: Array, restart: bool, method: Method = "RK45"
) -> tuple[Array, int]:
    """Return the end states of all pairs, (K, size of the equation), and the number of evaluations of the equation."""
    ends, evaluations = np.empty((len(pairs), len(scales))), 0
    atol, sensitivities = rtol * scales, np.zeros(len(scales) - 5)
    columns = pairs.points.x0, pairs.points.u[:, 0].tolist(), pairs.points.dt.tolist(), pairs.theta
    for k, (x0, u, dt, theta) in enumerate(zip(*columns, strict=True)):
        f = equation(theta, u, 1.0 if x0[1] > 0 else -1.0)
        y = np.concatenate([x0, sensitivities])
        for begin, end in pieces(x0[4], u, dt) if restart else [(0.0, dt)]:
            if begin > 0:
                y[4] = np.copysign(1e-300, K_U * u)  # past the kink, whatever the rounding
            solution = solve_ivp(f, (begin, end), y, method=method, rtol=rtol, atol=atol)
            y = solution.y[:, -1]
            evaluations += solution.nfev
        ends[k] = y
    return ends, evaluations


def solve_states(pairs: Pairs, rtol: float, restart: bool, method: Method = "RK45") -> Array:
    """Return the outputs, (K, n_y)."""
    return solve(state_equation, pairs, rtol, STATE_SCALES, restart, method)[0][:, OUTPUT_ROWS]


def solve_sensitivities(pairs: Pairs, rtol: float, restart: bool, scales: Array, method: Method = "RK45") -> tuple[Array, Array]:
    """Return the outputs (K, n_y) and dx/dtheta (K, n_x, p), each entry of which is held to its own scale, (n_x, p)."""
    together = np.concatenate([STATE_SCALES, scales.ravel()])
    ends, _ = solve(variational_equation, pairs, rtol, together, restart, method)
    return ends[:, OUTPUT_ROWS], ends[:, 5:].reshape(-1, 5, 9)
