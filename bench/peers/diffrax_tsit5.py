"""diffrax: Tsit5 with its PID controller, jit-compiled and mapped over trajectories with `vmap`.

Each trajectory has its own steps and is solved in two pieces around x_v = 0. States and sensitivities are divided by their scales,
because the tolerance is one number for all components. The loop over points is inside of the compiled program, so that lanes with
alike steps go together. The variational equation is had by forward differentiation of the right-hand side.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

from ..workload import Array, Pairs
from .jax_cylinder import arrays, rate, scales, start, variational_rate
from .peer import Peer, Solution, sensitivity_scales

LANES = 729
"""Trajectories at a time; more wait longer for the slowest of them."""


class DiffraxTsit5(Peer):
    name = "diffrax Tsit5"

    def outputs(self, pairs: Pairs, rtol: float) -> Solution:
        columns, taken = arrays(pairs, LANES)
        ends, steps = _solve(columns, rtol, scales(False), False)
        return Solution.of_states(np.asarray(ends)[taken], float(np.mean(np.asarray(steps)[taken])))

    def sensitivities(self, pairs: Pairs, rtol: float) -> Solution:
        columns, taken = arrays(pairs, LANES)
        own = np.concatenate([scales(False)[None], sensitivity_scales().T])
        ends, steps = _solve(columns, rtol, own, True)
        y = np.asarray(ends)[taken]
        slopes = y[:, 1:].transpose(0, 2, 1)
        return Solution.of_states(y[:, 0], float(np.mean(np.asarray(steps)[taken])), slopes)


def _largest(errors: Any) -> Any:
    return jnp.where(jnp.isfinite(jnp.sum(errors)), jnp.max(jnp.abs(errors)), jnp.inf)  # XLA's maximum drops NaN


@partial(jax.jit, static_argnums=3)
def _solve(columns: dict[str, Array], rtol: float, size: Array, sensitivities: bool) -> Any:
    equation = variational_rate if sensitivities else rate

    def solve_block(block: dict[str, Any]) -> Any:
        def solve_one(theta: Any) -> Any:
            def scaled_rate(t: Any, y: Any, side: Any) -> Any:
                return equation(y * size, theta, side, block["motion"], block["target"]) / size

            y, steps = start(block["x0"], sensitivities) / size, 0
            for i in range(2):
                solution = diffrax.diffeqsolve(
                    diffrax.ODETerm(scaled_rate),
                    diffrax.Tsit5(),
                    t0=0.0,
                    t1=block["lengths"][i],
                    dt0=None,
                    y0=y,
                    args=block["sides"][i],
                    stepsize_controller=diffrax.PIDController(rtol=rtol, atol=rtol, norm=_largest),
                    adjoint=diffrax.ForwardMode(),
                    max_steps=None,
                )
                y = solution.ys[-1]
                steps += solution.stats["num_steps"]
            return y * size, steps

        return jax.vmap(solve_one, in_axes=1)(block["theta"])

    return jax.lax.map(solve_block, columns)


PEERS: list[Peer] = [DiffraxTsit5()]
