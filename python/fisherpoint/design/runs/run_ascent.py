"""Ascent from runs to better ones, all free numbers together.

Every iteration takes the slopes of rows and limits, and asks the criterion to first order (linear_rows.py) where it is largest
within some distances. These runs and others on the way to them are computed side by side, for little more than one of them, and the
best of all is the next. So the distance that the first order is good for need not be guessed, and where log det F has a kink, as
where plants begin to stick at another time, some step gets past it all the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ...basics.work_clock import OutOfTime
from .linear_rows import LinearRows
from .run_objective import RunObjective
from .run_slopes import linear_rows


class Peak(NamedTuple):
    """Free numbers (L, d) where an ascent has ended, what the runs are worth, by how much numbers may change where it goes on, and
    whether it found no more to gain."""

    z: Array
    value: float
    reach: float
    done: bool


def ascend(
    objective: RunObjective,
    z: Array,
    selected: NDArray[np.bool_] | None,
    iterations: int,
    rng: np.random.Generator,
    reach: float,
) -> Peak:
    """The best runs that an ascent from free numbers z (L, d) finds; in the time that there is."""
    value = float(objective.values(z[None], selected)[0])
    small, done, tuning = 0, False, objective.tuning.ascent
    factors, shares = tuning.reach_factors, tuning.step_shares
    if len(z) * len(objective.plants) > objective.tuning.most_lanes:
        shares = shares[:1]
    for _ in range(iterations):
        try:
            linear = linear_rows(objective, z, selected, reach < objective.tuning.central_reach, rng)
            if linear is None or not np.isfinite(value):
                return Peak(z, value, reach, True)
            moving = linear.variable >= 0
            here = np.empty(linear.variable.max() + 1)
            here[linear.variable[moving]] = z[moving]
            steep = np.ones(len(here))
            steep[linear.variable[moving]] = objective.coordinates.steepness(z)[moving]
            changes = trial_changes(linear, here, reach / steep, shares, objective.clock.late)
            tried = np.tile(z, (len(changes), 1, 1))
            tried[:, moving] = np.clip(here + changes, 0.0, 1.0)[:, linear.variable[moving]]
            values = objective.values(tried, selected)
        except OutOfTime:
            break
        best = int(np.argmax(values))
        gain = values[best] - value
        if gain > 0:
            z, value = tried[best], float(values[best])
            longer = tuning.reach_growth * reach * factors[best % len(factors)] * shares[best // len(factors)]
            reach = float(np.clip(longer, tuning.least_reach, tuning.most_reach))
        else:
            reach *= factors[-1]
        small = small + 1 if gain < tuning.small_gain else 0
        done = small == tuning.most_small_gains or reach < tuning.least_reach
        if done:
            break
    return Peak(z, value, max(reach, tuning.least_reach), done)


def trial_changes(
    linear: LinearRows,
    here: Array,
    reach: float | Array,
    shares: Sequence[float],
    late: Callable[[], bool] | None = None,
) -> Array:
    """Changes (T, n) of variables from `here` (n,) that are worth a try: best steps within some distances, share after share.

    `reach` is by how much each variable may change, one for all or (n,); the distances are the tuning's `reach_factors` times as
    much. Steps are the best so far where it is `late`.
    """
    steps = []
    for factor in linear.tuning.reach_factors:
        distance = np.minimum(reach * factor, linear.tuning.most_reach)
        lower, upper = np.maximum(-distance, -here), np.minimum(distance, 1.0 - here)
        steps.append(linear.within(float(np.max(distance))).best_step(lower, upper, late))
    changes: Array = (np.array(shares)[:, None, None] * np.array(steps)).reshape(-1, len(here))
    return changes
