"""JAX: Dormand-Prince 5(4) written by hand on arrays, jit-compiled, all nodes of a point as lanes that share their steps.

The worst lane decides on a step, and steps end at x_v = 0. The loop over points is inside of the compiled program. The variational
equation is had by forward differentiation of the right-hand side.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..workload import Array, Pairs
from .jax_cylinder import arrays, rate, scales, start, variational_rate
from .numpy_lanes import ERROR, TABLEAU
from .peer import Peer, Solution, sensitivity_scales

LANES = 729


class JaxLanes(Peer):
    name = "JAX, shared-step RK45"

    def outputs(self, pairs: Pairs, rtol: float) -> Solution:
        columns, taken = arrays(pairs, LANES)
        ends, steps = _solve(columns, rtol, scales(False), False)
        return Solution.of_states(np.asarray(ends).transpose(0, 2, 1)[taken], float(np.mean(steps)))

    def sensitivities(self, pairs: Pairs, rtol: float) -> Solution:
        columns, taken = arrays(pairs, LANES)
        own = np.concatenate([scales(False)[None], sensitivity_scales().T])
        ends, steps = _solve(columns, rtol, own, True)
        y = np.asarray(ends).transpose(0, 3, 2, 1)[taken]
        return Solution.of_states(y[:, :, 0], float(np.mean(steps)), y[:, :, 1:])


@partial(jax.jit, static_argnums=3)
def _solve(columns: dict[str, Array], rtol: float, size: Array, sensitivities: bool) -> Any:
    equation = variational_rate if sensitivities else rate

    def solve_block(block: dict[str, Any]) -> Any:
        theta, motion, target = block["theta"], block["motion"], block["target"]
        y = start(jnp.broadcast_to(block["x0"][:, None], (5, theta.shape[1])), sensitivities)
        steps = 0
        for i in range(2):
            f = partial(equation, theta=theta, side=block["sides"][i], motion=motion, target=target)
            y, count = _advance(f, y, block["lengths"][i], rtol, size[..., None])
            steps += count
        return y, steps

    return jax.lax.map(solve_block, columns)


def _advance(f: Any, y: Any, span: Any, rtol: Any, size: Any) -> Any:
    def unfinished(carry: Any) -> Any:
        return carry[0] < span

    def step(carry: Any) -> Any:
        t, h, y, first, steps = carry
        last = t + h >= span
        h = jnp.minimum(h, span - t)
        rates = [first]
        for row in TABLEAU:
            trial = y + h * sum(c * k for c, k in zip(row, rates, strict=True) if c)
            rates.append(f(trial))
        error = h * sum(c * k for c, k in zip(ERROR, rates, strict=True) if c)
        worst = jnp.max(jnp.abs(error) / jnp.maximum(jnp.abs(y), size)) / rtol
        worst = jnp.where(jnp.isfinite(jnp.sum(error)), worst, jnp.inf)  # XLA's maximum drops NaN
        good = worst <= 1
        factor = jnp.where(jnp.isfinite(worst), jnp.clip(0.9 * jnp.maximum(worst, 1e-8) ** -0.2, 0.2, 5.0), 0.2)
        t = jnp.where(good, jnp.where(last, span, t + h), t)
        return t, h * factor, jnp.where(good, trial, y), jnp.where(good, rates[-1], first), steps + 1

    end = jax.lax.while_loop(unfinished, step, (0.0, span / 8, y, f(y), 0))
    return end[2], end[4]


PEERS: list[Peer] = [JaxLanes()]
