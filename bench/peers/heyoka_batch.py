"""heyoka: Taylor series of adaptive order in compiled code, many lanes at a time (its batch mode).

There is one integrator for either side of x_v = 0, so that every piece is smooth. Pressures are counted in 1e7 Pa, because the
tolerance is relative to the largest state. For the outputs, what depends on theta alone is computed outside. For sensitivities,
heyoka derives the variational equations itself, for parameters in units that move the states by about their scales. Wide batches
pay for the states; for sensitivities they take long to compile.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import heyoka as hy
import numpy as np

from ..scipy_peer import A_A, A_B, P_S, Q_MAX, Q_MIN, T_1
from ..workload import STATE_SCALES, Array, Pairs
from .peer import Block, Peer, Solution, blocks, column_scales

LANES, LANES_OF_SENSITIVITIES = 64, 16
UNIT = 1e7
OPTIONS = dict(force_avx512=True, fast_math=True, high_accuracy=False, compact_mode=False)
"""What was fastest: vectors as wide as the machine has, and unrolled code."""


class HeyokaBatch(Peer):
    name = "heyoka batch"

    def outputs(self, pairs: Pairs, rtol: float) -> Solution:
        ends, steps = np.empty((len(pairs), 5)), 0.0
        units = np.array([1.0, 1.0, UNIT, UNIT, 1.0])
        for block in blocks(pairs):
            x, count = _solve(block, _state_parameters(block), block.x0 / units, rtol, LANES, _state_integrator)
            ends[block.rows] = x * units
            steps += count
        return Solution.of_states(ends, steps / len(pairs))

    def sensitivities(self, pairs: Pairs, rtol: float) -> Solution:
        ends, steps = np.empty((len(pairs), 50)), 0.0
        start = np.zeros(50)
        for block in blocks(pairs):
            n = len(block.theta)
            values = np.vstack([block.theta.T / column_scales()[:, None], np.full(n, block.motion), np.full(n, block.target)])
            start[:5] = block.x0 / STATE_SCALES
            ends[block.rows], count = _solve(block, values, start, rtol, LANES_OF_SENSITIVITIES, _variational_integrator)
            steps += count
        dx_dtheta = ends[:, 5:].reshape(-1, 5, 9) * STATE_SCALES[:, None] / column_scales()
        return Solution.of_states(ends[:, :5] * STATE_SCALES, steps / len(pairs), dx_dtheta)


def _solve(block: Block, values: Array, start: Array, rtol: float, lanes: int, integrator: Any) -> tuple[Array, float]:
    """Return the ends of a block's trajectories (n, size) and their steps, for parameter values (count, n).

    To ask for the steps costs time, so it is done for the first batch alone, which stands for the block.
    """
    n, steps = values.shape[1], 0
    values = np.pad(values, ((0, 0), (0, -n % lanes)), mode="edge")
    ends = np.empty((values.shape[1], len(start)))
    for first in range(0, n, lanes):
        x = np.repeat(start[:, None], lanes, axis=1)
        for span in block.spans:
            batch = integrator(span.opens_a, rtol)
            batch.state[:], batch.pars[:] = x, values[:, first : first + lanes]
            batch.set_time(span.begin)
            batch.propagate_until(span.end)
            x = batch.state
            if first == 0:
                steps += sum(result[3] for result in batch.propagate_res)
        ends[first : first + lanes] = x.T
    return ends[:n], steps * n / lanes


def _state_parameters(block: Block) -> Array:
    a_tau, b_tau, m_q, e_oil, p_t, b_v, c_l, v_0a, v_0b = block.theta.T
    compliance, root = UNIT / e_oil, np.sqrt(UNIT)
    rows = (a_tau * block.motion / m_q, b_tau / m_q, A_A * UNIT / m_q, A_B * UNIT / m_q, p_t / UNIT, b_v * root, c_l * root)
    volumes = ((v_0a - A_A * Q_MIN) * compliance, A_A * compliance, (v_0b + A_B * Q_MAX) * compliance, A_B * compliance)
    return np.stack([*rows, *volumes, np.full(len(block.theta), block.target)])


@cache
def _state_integrator(opens_a: bool, rtol: float) -> Any:
    q, v, p_a, p_b, x_v = hy.make_vars("q", "v", "p_a", "p_b", "x_v")
    friction, viscous, to_a, to_b, p_t, b_v, c_l, a_0, a_q, b_0, b_q, target = (hy.par[i] for i in range(12))
    q_a, q_b = _flows(p_a, p_b, x_v, P_S / UNIT, p_t, b_v, c_l, opens_a)
    system = [
        (q, v),
        (v, to_a * p_a - to_b * p_b - friction - viscous * v),
        (p_a, (q_a - A_A * v) / (a_0 + a_q * q)),
        (p_b, (q_b + A_B * v) / (b_0 - b_q * q)),
        (x_v, (target - x_v) * (1 / T_1)),
    ]
    return hy.taylor_adaptive_batch(system, state=np.zeros((5, LANES)), pars=np.ones((12, LANES)), tol=rtol, **OPTIONS)


@cache
def _variational_integrator(opens_a: bool, rtol: float) -> Any:
    scaled = hy.make_vars("q", "v", "p_a", "p_b", "x_v")
    q, v, p_a, p_b, x_v = (x * scale for x, scale in zip(scaled, STATE_SCALES.tolist(), strict=True))
    parameters = [hy.par[i] for i in range(9)]
    a_tau, b_tau, m_q, e_oil, p_t, b_v, c_l, v_0a, v_0b = (
        parameter * scale for parameter, scale in zip(parameters, column_scales().tolist(), strict=True)
    )
    motion, target = hy.par[9], hy.par[10]
    q_a, q_b = _flows(p_a, p_b, x_v, P_S, p_t, b_v, c_l, opens_a)
    rates = [
        v,
        (A_A * p_a - A_B * p_b - a_tau * motion - b_tau * v) / m_q,
        e_oil * (q_a - A_A * v) / (A_A * (q - Q_MIN) + v_0a),
        e_oil * (q_b + A_B * v) / (A_B * (Q_MAX - q) + v_0b),
        (target - x_v) * (1 / T_1),
    ]
    pairs = zip(scaled, rates, STATE_SCALES.tolist(), strict=True)
    system = hy.var_ode_sys([(x, rate * (1 / scale)) for x, rate, scale in pairs], args=parameters, order=1)
    shape = (5, LANES_OF_SENSITIVITIES), (11, LANES_OF_SENSITIVITIES)
    return hy.taylor_adaptive_batch(system, state=np.zeros(shape[0]), pars=np.ones(shape[1]), tol=rtol, **OPTIONS)


def _flows(p_a: Any, p_b: Any, x_v: Any, p_s: float, p_t: Any, b_v: Any, c_l: Any, opens_a: bool) -> tuple[Any, Any]:
    s_a, t_a, s_b, t_b = hy.sqrt(p_s - p_a), hy.sqrt(p_a - p_t), hy.sqrt(p_s - p_b), hy.sqrt(p_b - p_t)
    valve = b_v * x_v
    return valve * (s_a if opens_a else t_a) + c_l * (s_a - t_a), c_l * (s_b - t_b) - valve * (t_b if opens_a else s_b)


PEERS: list[Peer] = [HeyokaBatch()]
