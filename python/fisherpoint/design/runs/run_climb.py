"""The way of one start: ascents and single changes in turns, at a distance from limits that enough plants need."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from .reached_runs import ReachedRuns
from .run_ascent import FIRST, ascend
from .run_guard import Margin, RunGuard
from .run_moves import best_moves, hopped
from .run_objective import RunObjective

ITERATIONS = 8
"""Iterations of an ascent between two looks at the plants."""

STRETCH_GAIN, LEAST_GAIN, ROUGH_GAIN = 0.05, 1e-4, 5e-3
"""Least gain of an ascent in log det F for another to follow before single changes are tried; least gain of both for the climb to
go on; and this gain per parameter where the work is much: half a percent of D-efficiency."""

MUCH = 500_000
"""Segments of work that are much."""

EXPLORED = 4
"""Steps near the limits, whether enough plants can run what they lead to or not: from there it is not far to the best that enough
can. Fewer where they gain little."""

MOST_LOST, MOST_HOPS, MOST_STEPS, MOST_LAST = 2, 2, 60, 5
"""How often in a row too few plants may be able to run what a climb comes to, after enough could; how often it goes on, in vain,
from its best runs by changes that do not gain at once; its steps altogether; and the last ascents, without changes."""


class Climb:
    """Runs on their way up.

    Parameters
    ----------
    objective : RunObjective
    guard : RunGuard
    z : ndarray, (L, d)
        Free numbers of runs to begin with.
    tried : callable
        From free numbers and samples to what runs are worth, and how many plants can run them.
    chosen : callable
        From free numbers to the samples that count.
    others : callable
        Free numbers (K, d) of good runs; single changes copy parts of them.
    rng : numpy.random.Generator

    Attributes
    ----------
    best, last : ReachedRuns or None
        The best runs so far, and those that the last step has led to.
    ended : bool
        Whether no more is gained.
    """

    def __init__(
        self,
        objective: RunObjective,
        guard: RunGuard,
        z: Array,
        tried: Callable[[Array, NDArray[np.bool_] | None], ReachedRuns],
        chosen: Callable[[Array], NDArray[np.bool_] | None],
        others: Callable[[], Array],
        rng: np.random.Generator,
    ) -> None:
        self._objective, self._tried, self._chosen, self._others, self._rng = objective, tried, chosen, others, rng
        self._z, self._selected, self._reach, self._value = z, chosen(z), FIRST, -np.inf
        self._kappa = self._best_kappa = guard.first
        self._margin, self._lost, self._steps, self._moved = Margin(objective, guard), 0, 0, True
        self._explored = guard.first == 0.0 or not objective.margins.exist
        self.best: ReachedRuns | None = None
        self.last: ReachedRuns | None = None
        self.ended = False

    @property
    def worth(self) -> tuple[bool, float]:
        """Key for the comparison of climbs that have not ended: whether the last runs are regular, and what they are worth."""
        return (False, -np.inf) if self.last is None else (self.last.regular, self.last.worth[2])

    @property
    def _least(self) -> float:
        """Least gain to go on."""
        return ROUGH_GAIN * self._objective.problem.n_unknowns if self._objective.work > MUCH else LEAST_GAIN

    def step(self) -> None:
        """An ascent; where it gains little, single changes; and a look at the plants, which adapts the distance from limits."""
        objective, self._steps = self._objective, self._steps + 1
        objective.kappa = self._kappa
        least, before = self._least, self._value
        peak = ascend(objective, self._z, self._selected, ITERATIONS, self._rng, self._reach)
        self._z, self._value, self._reach = peak.z, peak.value, peak.reach
        tired = self._moved or peak.done or not peak.value > before + STRETCH_GAIN
        if tired:
            self._change(least)
        found = self.last = self._tried(self._z, self._selected)
        if self.best is None or found.worth > self.best.worth:
            self.best, self._best_kappa = found, self._kappa
        self._lost = self._lost + 1 if self._explored and self.best.feasible and not found.feasible else 0
        if self._lost > MOST_LOST or self._steps >= MOST_STEPS:
            self.ended = True
        elif not self._explored:
            self._explored = self._steps >= EXPLORED or not self._value > before + STRETCH_GAIN
        elif self._margin.changed(found.share, self._value):
            self._kappa, self._value, self._reach = objective.kappa, -np.inf, max(self._reach, FIRST / 4)
        else:
            self.ended = tired and not self._value > before + least

    def _change(self, least: float) -> None:
        """Single changes, and other samples."""
        objective, value = self._objective, self._value
        self._z, self._value = best_moves(objective, self._z, value, self._selected, self._others(), least, self._rng)
        self._moved = self._value > value + STRETCH_GAIN
        if self._selected is not None:
            chosen = self._chosen(self._z)
            there = float(objective.values(self._z[None], chosen)[0])
            if there > self._value:
                self._selected, self._value = chosen, there
        self._reach = max(self._reach, FIRST / 4)

    def go_on(self) -> None:
        """Hop from the best runs by changes that need not gain, and climb again, until that is in vain; then go to the very top."""
        assert self.best is not None
        hops = 0
        while hops < MOST_HOPS and self._steps < MOST_STEPS:
            before = self.best.worth
            self._objective.kappa = self._kappa = self._best_kappa
            self._z = hopped(self._objective, self.best.z, self.best.selected, self._others(), self._rng)
            self._selected, self._value, self._reach, self._lost, self.ended = self.best.selected, -np.inf, FIRST, 0, False
            while not self.ended:
                self.step()
            hops = 0 if self.best.worth > (*before[:2], before[2] + self._least) else hops + 1
        if self._least > LEAST_GAIN:
            self._refine()

    def _refine(self) -> None:
        """Ascents alone from the best runs, while they gain anything: where the work is much, steps end before."""
        assert self.best is not None
        self._objective.kappa = self._best_kappa
        z, selected, reach, value = self.best.z, self.best.selected, FIRST / 4, -np.inf
        for _ in range(MOST_LAST):
            peak = ascend(self._objective, z, selected, ITERATIONS, self._rng, reach)
            found = self._tried(peak.z, selected)
            if found.worth > self.best.worth:
                self.best = found
            if peak.done or not peak.value > value + LEAST_GAIN:
                break
            z, reach, value = peak.z, peak.reach, peak.value
