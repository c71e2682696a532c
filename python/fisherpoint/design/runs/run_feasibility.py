"""Whether enough plants can run a design, and how far its runs keep from limits so that they can.

The distance is counted in standard deviations that the prior makes of it, to first order (run_margins.py). What share of the plants
a distance leaves is counted; so the distance changes by the difference of the quantiles of what is lost and what may be.
"""

from __future__ import annotations

from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ...basics.work_clock import LANES, Clock, OutOfTime
from ...points.runs import Runs
from ..results.found_design import DRAWS
from .run_objective import RunObjective
from .sampled_plants import RunPlants
from .tuning import RunSearchTuning

NORMAL = NormalDist()
"""The normal distribution; SciPy's would make the import slow."""


class RunGuard:
    """Whether enough plants can run a design, of some that the search looks at.

    Parameters
    ----------
    plants : RunPlants
    confidence : float or None
        The required share of the plants.
    kept : Runs or None
        Runs that every plant has to run too.
    clock : Clock
    tuning : RunSearchTuning

    Attributes
    ----------
    first : float
        The distance to begin with, in standard deviations.
    most : float
        The share of the plants that may fail. Fewer than were allowed, as runs are chosen by these plants, and as the plants that
        judge the design in the end are others.
    """

    def __init__(
        self, plants: RunPlants, confidence: float | None, kept: Runs | None, clock: Clock, tuning: RunSearchTuning
    ) -> None:
        self._tuning = tuning
        self._plants, self.clock = plants, clock
        self._able = np.ones(len(plants), dtype=bool) if kept is None else plants.can_run(kept)
        may = 1.0 if confidence is None else 1.0 - confidence
        # The largest q with q + sigmas sqrt(q (1 - q) / DRAWS) <= may, the end of Wilson's interval.
        c = self._tuning.share_sigmas**2 / DRAWS
        self.most = 1.0 if confidence is None else float((may + c / 2 - np.sqrt(c * (c / 4 + may * (1 - may)))) / (1 + c))
        self.first = 0.0 if confidence is None else max(0.0, NORMAL.inv_cdf(confidence))

    def share(self, runs: Runs) -> float:
        """The share of the plants that can run a design; of the first of them, where too few of these can."""
        tuning, began = self._tuning, self.clock.seconds
        each = max(1, min(tuning.plants_at_once, tuning.most_guard_segments // runs.dt.size))
        able = tried = 0
        for first in range(0, len(self._plants), each):
            some = slice(first, first + each)
            one = self._can_run(runs, some)
            able, tried = able + int(one.sum()), tried + len(one)
            lost = 1 - able / tried
            hopeless = any(tried >= count and lost > times * max(self.most, 1 / count) for count, times in tuning.hopeless)
            few = self.clock.affordable("plants", tuning.guard_share) / len(runs)
            if hopeless or tried >= few or self.clock.late() or self.clock.over():
                break
        self.clock.reserve = max(self.clock.reserve, tuning.reserved_time * DRAWS * (self.clock.seconds - began) / tried)
        return able / tried

    def _can_run(self, runs: Runs, some: slice) -> NDArray[np.bool_]:
        """Which of some plants can run a design, of the first ones where there is no time for all."""
        found = list[NDArray[np.bool_]]()
        count = len(range(len(self._plants))[some])
        try:
            for block in self.clock.blocks("plants", count, len(runs)):
                own = slice(some.start + block.start, some.start + block.stop)
                found.append(self._plants.can_run(runs, own) & self._able[own])
                if some.start + block.stop >= self.clock.affordable("plants", self._tuning.guard_share) / len(runs):
                    break
        except OutOfTime:
            if not found:
                raise
        return np.concatenate(found)

    def each(self, runs: Runs) -> Array:
        """The share of some plants that can run each of some runs by itself, (K,)."""
        most = self.clock.affordable("plants", self._tuning.guard_share) / max(1, len(runs))
        count = int(min(self._tuning.plants_at_once, len(self._plants), max(LANES, most)))
        found = list[NDArray[np.bool_]]()
        try:
            for some in self.clock.blocks("plants", count, len(runs)):
                found.append(self._plants.outputs(runs, some)[1])
        except OutOfTime:
            if not found:
                raise
        return np.asarray(np.concatenate(found).mean(axis=0))

    def enough(self, share: float) -> bool:
        """Whether a share of the plants is enough."""
        return 1.0 - share <= self.most

    def short(self, share: float) -> float:
        """Standard deviations by which limits would have to be further away for enough plants; negative where there are more."""
        least = 0.5 / len(self._plants)
        lost = min(max(1.0 - share, least), 1.0 - least)
        return NORMAL.inv_cdf(lost) - NORMAL.inv_cdf(min(max(self.most, least), 1.0 - least))


class Margin:
    """The distance from limits that runs of one start pay for, `objective.kappa`.

    Parameters
    ----------
    objective : RunObjective
    guard : RunGuard
    """

    def __init__(self, objective: RunObjective, guard: RunGuard) -> None:
        self._objective, self._guard, self._changes, self._raised = objective, guard, 0, 0
        self._low, self._high, self._most = 0.0, np.inf, objective.tuning.most_kappa_change
        self._before = -np.inf

    def changed(self, share: float, value: float) -> bool:
        """Change the distance by the share of the plants that can run what an ascent has led to; False where it stays.

        It stays, too, where the ascent's `value` gained nothing when the distance was last made smaller.
        """
        objective, guard, tuning = self._objective, self._guard, self._objective.tuning
        if not objective.margins.exist or guard.most == 1.0 or self._changes == tuning.most_kappa_changes:
            return False
        kappa, short = objective.kappa, guard.short(share)
        if guard.enough(share):
            self._most = tuning.small_kappa_change
            if kappa == 0.0 or short > tuning.excess_sigmas or value < self._before + tuning.kappa_least_gain:
                return False
            self._before = value
            self._high = kappa
        else:
            self._low = kappa
            self._raised += 1
            if self._raised > 2 and objective.looks < tuning.more_looks_per_segment:
                objective.looks, self._raised = tuning.more_looks_per_segment, 0
        least = -self._most if guard.enough(share) else tuning.least_kappa_change
        wanted = float(np.clip(kappa + np.clip(short, least, self._most), 0.0, tuning.most_kappa))
        if not self._low < wanted < self._high:
            wanted = 0.5 * (self._low + min(self._high, tuning.most_kappa))
            self._low, self._high = 0.0, np.inf  # the runs have moved since
        if abs(wanted - kappa) < 0.5 * tuning.least_kappa_change:
            return False
        objective.kappa = wanted
        self._changes += 1
        return True
