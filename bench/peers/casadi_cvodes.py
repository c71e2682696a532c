"""CasADi with SUNDIALS' CVODES: Adams formulas with functional iteration, restarted at x_v = 0.

Time is divided by the length of the piece, because an integrator's end is fixed when it is made. The variational equation is
CasADi's own derivative of the right-hand side, integrated beside the states: fixed-point iteration asks for no Jacobian of it.
States and sensitivities are divided by their scales, because the tolerance is one number for all components.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import casadi as ca
import numpy as np

from ..scipy_peer import A_A, A_B, P_S, Q_MAX, Q_MIN, T_1
from ..workload import STATE_SCALES, Array, Pairs
from .peer import Peer, Solution, blocks, sensitivity_scales


class CasadiCvodes(Peer):
    name = "CasADi CVODES"
    compiled = False

    def outputs(self, pairs: Pairs, rtol: float) -> Solution:
        return Solution.of_states(_solve(pairs, rtol, False))

    def sensitivities(self, pairs: Pairs, rtol: float) -> Solution:
        ends = _solve(pairs, rtol, True)
        return Solution.of_states(ends[:, :5], None, ends[:, 5:].reshape(-1, 9, 5).transpose(0, 2, 1))


def _solve(pairs: Pairs, rtol: float, with_sensitivities: bool) -> Array:
    sizes = _sizes(with_sensitivities)
    ends = np.empty((len(pairs), len(sizes)))
    for block in blocks(pairs):
        n = len(block.theta)
        start = np.zeros(len(sizes))
        start[:5] = block.x0 / STATE_SCALES
        x: Any = np.repeat(start[:, None], n, axis=1)
        for span in block.spans:
            known = np.repeat([[block.motion], [block.target], [span.end - span.begin]], n, axis=1)
            parameters = np.vstack([block.theta.T, known])
            x = _integrators(span.opens_a, rtol, with_sensitivities, n)(x0=x, p=parameters)["xf"]
        ends[block.rows] = x.full().T
    return ends * sizes


def _sizes(with_sensitivities: bool) -> Array:
    columns = sensitivity_scales().T.ravel() if with_sensitivities else np.empty(0)
    return np.concatenate([STATE_SCALES, columns])


@cache
def _integrators(opens_a: bool, rtol: float, with_sensitivities: bool, count: int) -> Any:
    """Return the integrator of one trajectory, mapped over `count` of them."""
    x, p = ca.SX.sym("x", 5), ca.SX.sym("p", 12)
    a_tau, b_tau, m_q, e_oil, p_t, b_v, c_l, v_0a, v_0b, motion, target, length = ca.vertsplit(p)
    q, v, p_a, p_b, x_v = ca.vertsplit(x)
    s_a, t_a, s_b, t_b = ca.sqrt(P_S - p_a), ca.sqrt(p_a - p_t), ca.sqrt(P_S - p_b), ca.sqrt(p_b - p_t)
    valve = b_v * x_v
    rate = ca.vertcat(
        v,
        (A_A * p_a - A_B * p_b - a_tau * motion - b_tau * v) / m_q,
        e_oil / (A_A * (q - Q_MIN) + v_0a) * (valve * (s_a if opens_a else t_a) + c_l * (s_a - t_a) - A_A * v),
        e_oil / (A_B * (Q_MAX - q) + v_0b) * (c_l * (s_b - t_b) - valve * (t_b if opens_a else s_b) + A_B * v),
        (target - x_v) / T_1,
    )
    rates, states = rate, x
    if with_sensitivities:
        columns = ca.SX.sym("S", 5, 9)
        slopes = ca.jacobian(rate, x) @ columns + ca.jacobian(rate, p)[:, :9]
        rates, states = ca.vertcat(rate, ca.vec(slopes)), ca.vertcat(x, ca.vec(columns))
    sizes = _sizes(with_sensitivities)
    scaled = ca.SX.sym("y", len(sizes))
    ode = ca.substitute(rates, states, scaled * sizes) / sizes * length
    options: dict[str, Any] = {
        "reltol": rtol,
        "abstol": rtol,
        "linear_multistep_method": "adams",
        "nonlinear_solver_iteration": "functional",
        "max_num_steps": 100000,
    }
    return ca.integrator("cylinder", "cvodes", {"x": scaled, "p": p, "ode": ode}, 0.0, 1.0, options).map(count)


PEERS: list[Peer] = [CasadiCvodes()]
