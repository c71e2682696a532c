"""Random runs that leave a limit, brought back within it.

Where strokes are short or a mass swings, next to no random run reaches its end, but all of them do when they are small enough. So
each is drawn towards a run that does, as far as needed, by bisection. The first runs that do are held inputs, such as those at
rest, or the random runs that last longest, prolonged by changes of their inputs before their ends.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from .run_objective import RunObjective


def brought_within(
    objective: RunObjective, outside: Array, inside: Array, fits: Callable[[Array], NDArray[np.bool_]], rng: np.random.Generator
) -> Array:
    """Free numbers (K', d) of runs between those outside (K, d) and some of those inside (A, d), as near to the former as fit.

    Numbers with levels are those of the one or the other run, others in proportion.
    """
    to = inside[rng.integers(len(inside), size=len(outside))]
    stepped = objective.coordinates.stepped > 0
    turn = rng.random(outside.shape)

    def between(share: Array) -> Array:
        part = share[:, None]
        return np.where(stepped, np.where(turn < part, outside, to), to + part * (outside - to))

    low, high = np.zeros(len(outside)), np.ones(len(outside))
    for _ in range(objective.tuning.halvings_within):
        middle = (low + high) / 2
        ok = fits(between(middle))
        low, high = np.where(ok, middle, low), np.where(ok, high, middle)
    return between(low)[low >= objective.tuning.least_share_within]


def first_within(objective: RunObjective, drawn: Array, rng: np.random.Generator) -> Array:
    """Free numbers (A, d) of runs that reach their ends: of held inputs, or the longest of some (K, d), prolonged; or none."""
    held = _held(objective, rng)
    lasted = objective.lasted(held)
    if lasted.ok.any():
        return held[lasted.ok]
    z = np.concatenate([held, drawn])
    ends = np.append(lasted.segments, objective.lasted(drawn).segments)
    for _ in range(objective.tuning.prolonged_rounds):
        best = np.argsort(-ends, kind="stable")[: objective.tuning.prolonged_runs]
        z, ends = z[best], ends[best]
        children = np.concatenate([_prolonged(objective, one, int(end), rng) for one, end in zip(z, ends, strict=True)])
        lasted = objective.lasted(children)
        if lasted.ok.any():
            return children[lasted.ok]
        z, ends = np.concatenate([children, z]), np.append(lasted.segments, ends)
    return z[:0]


def _held(objective: RunObjective, rng: np.random.Generator) -> Array:
    """Runs of inputs that stay: those at rest, and others, from several starts."""
    coordinates, held, levels = objective.coordinates, objective.tuning.held_runs, objective.tuning.held_levels
    z = np.tile(coordinates.quiet, (held, 1))
    inputs = np.array([name in coordinates.input_names for name in coordinates.names], dtype=bool)
    z[1:, ~inputs] = rng.random((held - 1, (~inputs).sum()))
    for name in coordinates.input_names:
        where = np.array([one == name for one in coordinates.names])
        z[held // 4 :, where] = rng.integers(0, levels, (held - held // 4, 1)) / (levels - 1)
    return np.array([coordinates.still(one) for one in z])


def _prolonged(objective: RunObjective, z: Array, end: int, rng: np.random.Generator) -> Array:
    """Runs whose inputs differ in some segments before the end, (children, d)."""
    quiet = objective.coordinates.quiet
    found, levels = np.tile(z, (objective.tuning.prolonged_children, 1)), objective.tuning.held_levels
    for child in found:
        for _, where in objective.coordinates.inputs:
            last = min(end + 1, where.stop - where.start)
            first = last - int(np.ceil(last ** rng.random()))
            stop = first + int(np.ceil((last - first) * rng.random()))
            child[where][first:stop] = rng.integers(0, levels) / (levels - 1)
        for one in objective.coordinates.signals:
            child[one.where] = one.profile.drawn(rng, one.clock, float(quiet[one.where.start]))
    return found
