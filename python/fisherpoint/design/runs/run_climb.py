"""The way of one start: ascents and single changes in turns, at a distance from limits that enough plants need."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from .reached_runs import ReachedRuns
from .run_ascent import ascend
from .run_feasibility import Margin, RunGuard
from .run_moves import best_moves, hopped
from .run_objective import RunObjective


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
    kappa : float, optional
        The distance from limits to begin with; that of the guard by default.
    hurried : bool, optional
        Whether there is little time: ascents are short, single changes wait until they gain little, and the distance from limits
        follows the plants from the first look on.

    Attributes
    ----------
    best, last : ReachedRuns or None
        The best runs so far, and those that the last step has led to.
    ended : bool
        Whether no more is gained.
    untried : bool
        Whether plants have not been tried with the numbers that it has come to.
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
        kappa: float | None = None,
        hurried: bool = False,
    ) -> None:
        self._tuning = objective.tuning
        self._objective, self._tried, self._chosen, self._others, self._rng = objective, tried, chosen, others, rng
        self._z, self._selected, self._reach, self._value = z, chosen(z), self._tuning.ascent.first_reach, -np.inf
        self._kappa = self._best_kappa = guard.first if kappa is None else kappa
        self._margin, self._lost, self._steps, self._moved = Margin(objective, guard), 0, 0, not hurried
        self._iterations = self._tuning.hurried_iterations if hurried else self._tuning.ascent_iterations
        self._explored = hurried or guard.first == 0.0 or not objective.margins.exist
        self.best: ReachedRuns | None = None
        self.last: ReachedRuns | None = None
        self.ended = self.untried = False

    @property
    def reached(self) -> tuple[Array, NDArray[np.bool_] | None, float]:
        """Free numbers (L, d) that it has come to, the samples that count, and what they are worth, less what they cost."""
        return self._z, self._selected, self._value

    @property
    def worth(self) -> tuple[bool, float]:
        """Key for the comparison of climbs that have not ended: whether the last runs are regular, and what they are worth."""
        return (False, -np.inf) if self.last is None else (self.last.regular, self.last.worth[2])

    @property
    def _least(self) -> float:
        """Least gain to go on."""
        objective, tuning = self._objective, self._tuning
        much = objective.work > tuning.much_work
        return tuning.rough_gain_per_parameter * objective.problem.n_unknowns if much else tuning.climb_least_gain

    def step(self) -> None:
        """An ascent; where it gains little, single changes; and a look at the plants, which adapts the distance from limits."""
        objective, tuning, self._steps = self._objective, self._tuning, self._steps + 1
        objective.kappa = self._kappa
        least, before = self._least, self._value
        peak = ascend(objective, self._z, self._selected, self._iterations, self._rng, self._reach)
        self._z, self._value, self._reach = peak.z, peak.value, peak.reach
        self.untried = bool(np.isfinite(peak.value))
        tired = self._moved or peak.done or not peak.value > before + tuning.stretch_gain
        if tired:
            self._change(least)
        found = self.last = self._tried(self._z, self._selected)
        self.untried = False
        if self.best is None or found.worth > self.best.worth:
            self.best, self._best_kappa = found, self._kappa
        self._lost = self._lost + 1 if self._explored and self.best.feasible and not found.feasible else 0
        if self._lost > tuning.most_lost_steps or self._steps >= tuning.most_steps:
            self.ended = True
        elif not self._explored:
            self._explored = self._steps >= tuning.explored_steps or not self._value > before + tuning.stretch_gain
        elif self._margin.changed(found.share, self._value):
            self._kappa, self._value, self._reach = objective.kappa, -np.inf, max(self._reach, tuning.ascent.first_reach / 4)
        else:
            self.ended = tired and not self._value > before + least

    def _change(self, least: float) -> None:
        """Single changes, and other samples."""
        objective, value = self._objective, self._value
        self._z, self._value = best_moves(objective, self._z, value, self._selected, self._others(), least, self._rng)
        self._moved = self._value > value + self._tuning.stretch_gain
        if self._selected is not None:
            chosen = self._chosen(self._z)
            there = float(objective.values(self._z[None], chosen)[0])
            if there > self._value:
                self._selected, self._value = chosen, there
        self._reach = max(self._reach, self._tuning.ascent.first_reach / 4)

    def go_on(self) -> None:
        """Hop from the best runs by changes that need not gain, and climb again, until that is in vain; then go to the very top."""
        assert self.best is not None
        hops, tuning = 0, self._tuning
        while hops < tuning.most_vain_hops and self._steps < tuning.most_steps:
            before = self.best.worth
            self._objective.kappa = self._kappa = self._best_kappa
            self._z = hopped(self._objective, self.best.z, self.best.selected, self._others(), self._rng)
            self._selected, self._value, self._reach = self.best.selected, -np.inf, tuning.ascent.first_reach
            self._lost, self.ended = 0, False
            while not self.ended:
                self.step()
            hops = 0 if self.best.worth > (*before[:2], before[2] + self._least) else hops + 1
        if self._least > tuning.climb_least_gain:
            self._refine()

    def _refine(self) -> None:
        """Ascents alone from the best runs, while they gain anything: where the work is much, steps end before."""
        assert self.best is not None
        self._objective.kappa = self._best_kappa
        z, selected, reach, value = self.best.z, self.best.selected, self._tuning.ascent.first_reach / 4, -np.inf
        for _ in range(self._tuning.most_last_ascents):
            peak = ascend(self._objective, z, selected, self._tuning.ascent_iterations, self._rng, reach)
            found = self._tried(peak.z, selected)
            if found.worth > self.best.worth:
                self.best = found
            if peak.done or not peak.value > value + self._tuning.climb_least_gain:
                break
            z, reach, value = peak.z, peak.reach, peak.value
