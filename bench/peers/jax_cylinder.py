"""What the two JAX programs share: the cylinder for one trajectory, its variational equation, and pairs in equal blocks."""

from __future__ import annotations

import os
from typing import Any

# One core is one core; XLA reads this when it starts, so it comes before the import.
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from ..scipy_peer import A_A, A_B, P_S, Q_MAX, Q_MIN, T_1
from ..workload import STATE_SCALES, Array, Pairs
from .peer import blocks, column_scales

jax.config.update("jax_enable_x64", True)


def rate(x: Any, theta: Any, side: Any, motion: Any, target: Any) -> Any:
    """Eq. (19), for any shape of its numbers; states x are the first axis."""
    a_tau, b_tau, m_q, e_oil, p_t, b_v, c_l, v_0a, v_0b = theta
    q, v, p_a, p_b, x_v = x
    s_a, t_a, s_b, t_b = jnp.sqrt(P_S - p_a), jnp.sqrt(p_a - p_t), jnp.sqrt(P_S - p_b), jnp.sqrt(p_b - p_t)
    valve = b_v * x_v
    q_a, q_b = valve * jnp.where(side > 0, s_a, t_a), valve * jnp.where(side > 0, t_b, s_b)
    return jnp.stack(
        [
            v,
            (A_A * p_a - A_B * p_b - a_tau * motion - b_tau * v) / m_q,
            e_oil / (A_A * (q - Q_MIN) + v_0a) * (q_a + c_l * (s_a - t_a) - A_A * v),
            e_oil / (A_B * (Q_MAX - q) + v_0b) * (c_l * (s_b - t_b) - q_b + A_B * v),
            jnp.broadcast_to((target - x_v) / T_1, q.shape),
        ]
    )


def variational_rate(y: Any, theta: Any, side: Any, motion: Any, target: Any) -> Any:
    """Eq. (9) by forward differentiation: y holds the states, then the nine columns of dx/dtheta, (10, 5, ...)."""
    x, columns = y[0], y[1:]
    of_column = jax.vmap(lambda dx, dtheta: jax.jvp(lambda a, b: rate(a, b, side, motion, target), (x, theta), (dx, dtheta))[1])
    lanes = x.ndim - 1
    directions = jnp.broadcast_to(jnp.eye(9).reshape(9, 9, *[1] * lanes), (9, *theta.shape))
    return jnp.concatenate([rate(x, theta, side, motion, target)[None], of_column(columns, directions)])


def start(x0: Any, sensitivities: bool) -> Any:
    """Return the start of either equation."""
    return jnp.concatenate([x0[None], jnp.zeros((9, *x0.shape))]) if sensitivities else x0


def arrays(pairs: Pairs, most: int) -> tuple[dict[str, Array], NDArray[np.bool_]]:
    """Return blocks of at most `most` pairs as arrays with one row each, and which of their places are pairs, (blocks, n).

    A block has up to two spans; the second is empty where the spool stays on its side. Short blocks repeat their last node.
    """
    found = list(blocks(pairs, most))
    size = max(len(block.theta) for block in found)
    spans = [[*block.spans, block.spans[-1]][:2] for block in found]
    lengths = [[first.end, second.end - first.end] for first, second in spans]
    columns = {
        "theta": np.stack([np.pad(block.theta, ((0, size - len(block.theta)), (0, 0)), mode="edge").T for block in found]),
        "x0": np.stack([block.x0 for block in found]),
        "motion": np.array([block.motion for block in found]),
        "target": np.array([block.target for block in found]),
        "lengths": np.array(lengths),
        "sides": np.array([[float(span.opens_a) for span in pair] for pair in spans]),
    }
    taken = np.arange(size) < np.array([len(block.theta) for block in found])[:, None]
    return columns, taken


def scales(sensitivities: bool) -> Array:
    """Return the scale of every component of the start."""
    rows = STATE_SCALES[None]
    return np.concatenate([rows, STATE_SCALES / column_scales()[:, None]]) if sensitivities else STATE_SCALES
