"""The other side: scipy.integrate.solve_ivp(method="RK45"), one trajectory at a time.

Right-hand sides on plain Python floats, the fastest form without a compiler. Two ways are tried: straight through, and in two
pieces around x_v = 0, whose time is known in closed form; the faster one counts.
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp, isfinite, log, sqrt
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from .workload import MODEL, STATE_SCALES, Array, Pairs

_C = MODEL.constants
A_A, A_B, Q_MIN, Q_MAX, P_S, T_1, K_U = (float(_C[name]) for name in ("A_A", "A_B", "q_min", "q_max", "p_s", "T_1", "k_u"))
OUTPUTS = [0, 2, 3, 4]
WAYS = {"one piece": False, "two pieces": True}


def roots(p_a: float, p_b: float, p_t: float) -> tuple[float, float, float, float]:
    """Square roots of the pressure drops; trial steps may pass a limit, where a magnitude keeps the solver going."""
    return sqrt(abs(P_S - p_a)), sqrt(abs(p_a - p_t)), sqrt(abs(P_S - p_b)), sqrt(abs(p_b - p_t))


def state_equation(theta: Array, u: float, motion: float) -> Callable[[float, Array], list[float]]:
    """Eq. (19); the velocity keeps its sign `motion`."""
    a_tau, b_tau, m_q, e_oil, p_t, b_v, c_l, v_0a, v_0b = theta.tolist()

    def f(_: float, x: Array) -> list[float]:
        q, v, p_a, p_b, x_v = x.tolist()
        s_a, t_a, s_b, t_b = roots(p_a, p_b, p_t)
        q_a, q_b = (b_v * x_v * s_a, -b_v * x_v * t_b) if x_v > 0 else (b_v * x_v * t_a, -b_v * x_v * s_b)
        return [
            v,
            (A_A * p_a - A_B * p_b - a_tau * motion - b_tau * v) / m_q,
            e_oil / (A_A * (q - Q_MIN) + v_0a) * (q_a + c_l * (s_a - t_a) - v * A_A),
            e_oil / (A_B * (Q_MAX - q) + v_0b) * (q_b + c_l * (s_b - t_b) + v * A_B),
            (K_U * u - x_v) / T_1,
        ]

    return f


def variational_equation(theta: Array, u: float, motion: float) -> Callable[[float, Array], Array]:
    """Eq. (19) with eq. (9): 5 states, then the 5 x 9 sensitivities row by row."""
    a_tau, b_tau, m_q, e_oil, p_t, b_v, c_l, v_0a, v_0b = theta.tolist()
    f_x, f_theta, rate = np.zeros((5, 5)), np.zeros((5, 9)), np.empty(50)
    f_x[0, 1], f_x[4, 4] = 1.0, -1.0 / T_1
    f_x[1, 1:4] = -b_tau / m_q, A_A / m_q, -A_B / m_q
    f_theta[1, 0] = -motion / m_q

    def f(_: float, y: Array) -> Array:
        q, v, p_a, p_b, x_v = y[:5].tolist()
        s_a, t_a, s_b, t_b = roots(p_a, p_b, p_t)
        opening, closing = (x_v, 0.0) if x_v > 0 else (0.0, -x_v)
        k_a, k_b = e_oil / (A_A * (q - Q_MIN) + v_0a), e_oil / (A_B * (Q_MAX - q) + v_0b)
        valve_a, valve_b = opening * s_a - closing * t_a, closing * s_b - opening * t_b
        v_rate = (A_A * p_a - A_B * p_b - a_tau * motion - b_tau * v) / m_q
        p_a_rate = k_a * (b_v * valve_a + c_l * (s_a - t_a) - v * A_A)
        p_b_rate = k_b * (b_v * valve_b + c_l * (s_b - t_b) + v * A_B)
        f_x[2] = (
            -p_a_rate * A_A * k_a / e_oil,
            -k_a * A_A,
            -0.5 * k_a * ((b_v * opening + c_l) / s_a + (b_v * closing + c_l) / t_a),
            0.0,
            k_a * b_v * (s_a if x_v > 0 else t_a),
        )
        f_x[3] = (
            p_b_rate * A_B * k_b / e_oil,
            k_b * A_B,
            0.0,
            -0.5 * k_b * ((b_v * closing + c_l) / s_b + (b_v * opening + c_l) / t_b),
            -k_b * b_v * (t_b if x_v > 0 else s_b),
        )
        f_theta[1, 1:3] = -v / m_q, -v_rate / m_q
        f_theta[2, 3:8] = (
            p_a_rate / e_oil,
            0.5 * k_a * (b_v * closing + c_l) / t_a,
            k_a * valve_a,
            k_a * (s_a - t_a),
            -p_a_rate * k_a / e_oil,
        )
        f_theta[3, 3:7] = p_b_rate / e_oil, 0.5 * k_b * (b_v * opening + c_l) / t_b, k_b * valve_b, k_b * (s_b - t_b)
        f_theta[3, 8] = -p_b_rate * k_b / e_oil
        rate[:5] = v, v_rate, p_a_rate, p_b_rate, (K_U * u - x_v) / T_1
        rate[5:] = (f_x @ y[5:].reshape(5, 9) + f_theta).ravel()
        return rate.copy()

    return f


def centre_crossing(x_v: float, u: float, dt: float) -> float | None:
    """When x_v(t) = k_u u + (x_v - k_u u) exp(-t / T_1) passes zero within dt."""
    target = K_U * u
    if x_v * target >= 0 or x_v * (target + (x_v - target) * exp(-dt / T_1)) >= 0:
        return None
    t = T_1 * log((x_v - target) / -target)
    return t if isfinite(t) and 0 < t < dt else None


def solve(equation: Callable[..., Any], pairs: Pairs, rtol: float, atol: Array, split: bool) -> Array:
    """End states of all pairs, (K, size of the equation)."""
    ends = np.empty((len(pairs), len(atol)))
    for k in range(len(pairs)):
        x0, u, dt = pairs.points.x0[k], float(pairs.points.u[k, 0]), float(pairs.points.dt[k])
        f = equation(pairs.theta[k], u, 1.0 if x0[1] > 0 else -1.0)
        y = np.concatenate([x0, np.zeros(len(atol) - 5)])
        crossing = centre_crossing(float(x0[4]), u, dt) if split else None
        for begin, end in [(0.0, dt)] if crossing is None else [(0.0, crossing), (crossing, dt)]:
            y = solve_ivp(f, (begin, end), y, method="RK45", rtol=rtol, atol=rtol * atol).y[:, -1]
            if end == crossing:
                y[4] = np.copysign(0.0, K_U * u)  # past rounding; the branch of x_v <= 0 and its limit agree there
        ends[k] = y
    return ends


def solve_states(pairs: Pairs, rtol: float, split: bool) -> Array:
    """Outputs (K, n_y)."""
    return solve(state_equation, pairs, rtol, STATE_SCALES, split)[:, OUTPUTS]


def solve_sensitivities(pairs: Pairs, rtol: float, split: bool) -> tuple[Array, Array]:
    """Outputs (K, n_y) and dy/dtheta (K, n_y, p), each entry of S held to its own root mean square."""
    size = np.sqrt(np.mean(pairs.dy_dtheta**2, axis=0))
    rows = np.array([size[0], size[0] * 0 + np.inf, size[1], size[2], size[3]])
    atol = np.concatenate([STATE_SCALES, np.where(rows > 0, rows, np.inf).ravel()])
    ends = solve(variational_equation, pairs, rtol, atol, split)
    return ends[:, OUTPUTS], ends[:, 5:].reshape(-1, 5, 9)[:, OUTPUTS]
