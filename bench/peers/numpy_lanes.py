"""NumPy: Dormand-Prince 5(4) on arrays, all nodes of a point as lanes that share their steps.

The worst lane decides on a step. Stages are combined by matrix products, and what depends on theta alone is computed once. There
are two thousand lanes at a time: enough to share the cost of Python, few enough to stay in the cache.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..scipy_peer import A_A, A_B, P_S, Q_MAX, Q_MIN, T_1
from ..workload import STATE_SCALES, Array, Pairs
from .peer import Block, Peer, Solution, Span, blocks

LANES = 2187

TABLEAU = [
    np.array(row)
    for row in (
        [1 / 5],
        [3 / 40, 9 / 40],
        [44 / 45, -56 / 15, 32 / 9],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
        [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    )
]
"""Dormand and Prince's stages; the last row is the solution, whose rate is the next step's first."""
ERROR = np.array([71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])


class NumpyLanes(Peer):
    name = "NumPy, shared-step RK45"
    has_sensitivities = False

    def outputs(self, pairs: Pairs, rtol: float) -> Solution:
        ends, steps = np.empty((len(pairs), 5)), 0
        for block in blocks(pairs, LANES):
            x = np.repeat(block.x0[:, None], len(block.theta), axis=1)
            for span in block.spans:
                x, count = _advance(_rate(block, span), x, span.end - span.begin, rtol)
                steps += count * len(block.theta)
            ends[block.rows] = x.T
        return Solution.of_states(ends, steps / len(pairs))


def _rate(block: Block, span: Span) -> Callable[[Array, Array], None]:
    a_tau, b_tau, m_q, e_oil, p_t, b_v, c_l, v_0a, v_0b = np.ascontiguousarray(block.theta.T)
    friction, viscous, to_a, to_b = a_tau * block.motion / m_q, b_tau / m_q, A_A / m_q, A_B / m_q
    per_e = 1 / e_oil
    a_0, a_q, b_0, b_q = (v_0a - A_A * Q_MIN) * per_e, A_A * per_e, (v_0b + A_B * Q_MAX) * per_e, A_B * per_e
    roots, insides = np.empty((4, len(block.theta))), np.empty((4, len(block.theta)))
    gate_a, gate_b = (roots[0], roots[3]) if span.opens_a else (roots[1], roots[2])

    def f(x: Array, rate: Array) -> None:
        q, v, p_a, p_b, x_v = x
        np.subtract(P_S, x[2:4], out=insides[::2])
        np.subtract(x[2:4], p_t, out=insides[1::2])
        np.sqrt(insides, out=roots)
        leak_a, leak_b = c_l * (roots[0] - roots[1]), c_l * (roots[2] - roots[3])
        valve = b_v * x_v
        rate[0] = v
        rate[1] = to_a * p_a - to_b * p_b - friction - viscous * v
        np.divide(valve * gate_a + leak_a - A_A * v, a_0 + a_q * q, out=rate[2])
        np.divide(leak_b - valve * gate_b + A_B * v, b_0 - b_q * q, out=rate[3])
        np.subtract(block.target, x_v, out=rate[4])
        rate[4] *= 1 / T_1

    return f


def _advance(f: Callable[[Array, Array], None], x: Array, span: float, rtol: float) -> tuple[Array, int]:
    rates = np.empty((7, *x.shape))
    flat = rates.reshape(7, -1)
    scales = STATE_SCALES[:, None]
    t, h, steps = 0.0, span / 8, 0
    with np.errstate(invalid="ignore"):  # a trial step past the domain gives NaN, which fails the test below
        f(x, rates[0])
        while t < span:
            last = t + h >= span
            h = min(h, span - t)
            for stage, row in enumerate(TABLEAU, 1):
                trial = x + ((h * row) @ flat[:stage]).reshape(x.shape)
                f(trial, rates[stage])
            size = np.maximum(np.abs(x), scales)
            error = float(np.max(np.abs(((h * ERROR) @ flat).reshape(x.shape)) / size)) / rtol  # NaN stays NaN
            steps += 1
            if error <= 1:
                t, x = (span if last else t + h), trial
                rates[0] = rates[6]
            h *= min(5.0, max(0.2, 0.9 * max(error, 1e-8) ** -0.2)) if error < np.inf else 0.2
    return x, steps


PEERS: list[Peer] = [NumpyLanes()]
