"""Changes of parameters that leave the equations as they are, on every side of every branch: no trajectory notices them.

Sensitivities say less: what only moves a jump has none, at all points whose trajectories keep clear of that.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import sympy

from ..basics.values import Array
from .surfaces.branches import Branches
from .surfaces.evaluate import evaluate
from .symbolic import SymbolicModel
from .tape.branch import Select
from .tape.parts import parts, symbols_of

STEP = 1e-30
"""Step of the derivatives along complex directions, which lose no digits."""

SAME = 1e-4
"""Share of what the parameters change one by one, up to which their changes together cancel."""


def leaves_equations(model: SymbolicModel, theta: Array, change: Array, x: Array, u: Array) -> bool:
    """Whether rates, outputs and what they branch on are the same, to first order, when theta (p,) moves along `change` (p,).

    That is seen at the given states (K, n_x) and inputs (K, n_u), on random sides of all branches.
    """
    equations, moved = model.structure.equations, np.flatnonzero(change)
    if {equations.parameters[j] for j in moved} & {*(tau for _, tau in equations.delays), *equations.late.values()}:
        return False  # in which instants inputs switch and outputs are read, no equation shows
    own, hidden = equations.states[: x.shape[1]], equations.states[x.shape[1] :]
    branches = Branches((*equations.states, *equations.inputs, *equations.parameters), by_side=True, most=math.inf)
    anew = [one for reset in equations.resets for one in (reset.condition, *(value for _, value in reset.values))]
    anew += [value for update in equations.updates for _, value in update.values]
    rewritten = [branches.rewrite(expression) for expression in (*equations.rates, *equations.output, *anew)]
    expressions = [branches.merged(one) for one in (*rewritten, *(surface.expression for surface in branches.surfaces))]
    rng = np.random.default_rng(0)
    known: dict[Any, Any] = {surface.side: rng.choice([-1.0, 1.0], len(x)) for surface in branches.surfaces}
    known |= dict(equations.constants) | {symbol: rng.uniform(size=len(x)) for symbol in hidden}
    known |= dict(zip(own, x.T, strict=True)) | dict(zip(equations.inputs, u.T, strict=True))
    slopes = np.zeros((len(moved), len(expressions), len(x)))
    for row, j in enumerate(moved):
        at = theta.astype(complex)
        at[j] += 1j * STEP * change[j]
        values = evaluate(expressions, known | dict(zip(equations.parameters, at, strict=True)))
        slopes[row] = [np.broadcast_to(np.imag(value) / STEP, len(x)) for value in values]
    finite = np.asarray(np.isfinite(slopes).all(axis=0))
    together, apart = np.abs(slopes.sum(axis=0)), np.abs(slopes).sum(axis=0)
    return bool(finite.any(axis=1).all() and (together <= SAME * apart)[finite].all())


def jumps_by_value(model: SymbolicModel) -> bool:
    """Whether outputs branch, or rates do by a condition that no state enters: there trajectories are not ended.

    Or whether an output reads an input that is delayed by a parameter: it jumps when the input does.
    """
    structure, parameters = model.structure, frozenset(model.equations.parameters)

    def branches_on(expression: Any, values: frozenset[Any]) -> bool:
        found = (part.args[0] for part in parts(expression) if isinstance(part, Select | sympy.sign | sympy.Heaviside))
        return any(condition.free_symbols & values for condition in found)

    values = parameters | set(model.equations.states)
    delayed = {u for u, _ in structure.equations.delays}
    return any(branches_on(output, values) or symbols_of(output) & delayed for output in structure.output) or any(
        branches_on(rate, parameters) for rate in structure.rates
    )
