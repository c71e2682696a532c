"""The search for runs: starts from a pool of random ones, then all free numbers together, then single changes, and again.

One start of it takes runs from a part of the pool (run_pool.py). An ascent leads to a local maximum of log det F, all numbers of
all runs together (run_ascent.py); single changes of a run (run_moves.py) lead out of it, until none of them gains. All starts are
made a little better before the first of them, the best one then, is followed to its end. How many end at the same value is what is
known about whether there is a better one.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ...information.problem import DesignProblem
from ...information.run_information import run_rows, run_settings
from ...points.run_region import RunCoordinates, RunRegion
from ...points.runs import Runs
from ..average import Average
from ..optimality.aims import Aim
from ..optimality.told import RUNS, told_aims
from .run_ascent import Peak, ascend
from .run_moves import moved_runs
from .run_objective import MORE_LOOKS, RunObjective
from .run_plants import RunPlants
from .run_pool import RIDGE, RunPool
from .sample_choice import best_samples

LEAST_GAIN = 1e-4
"""What log det F must gain for the search to go on from a maximum."""

SAME = 1e-2
"""Starts whose log det F is this near to the best one have found the same."""

FINE = 1e-6
"""Tolerance of the trajectories that differences are taken of, or the problem's where that is finer."""

MOST_ROUNDS = 40
"""Of ascents and single changes, for one start."""

MOST_SEGMENTS_OF_POOL = 400_000

LOOKED_AT = 5
"""Of the pool's best runs, whether the plants can run them."""

PLANTS, LEAST_PART = 1000, 0.5
"""On which runs are tried during the search; and how many of the plants that may fail may do so there. Runs are chosen by these
plants, so that others fail more often."""

KAPPA, MORE_KAPPA, MOST_KAPPA = 3.0, 0.5, 6.0
"""Standard deviations that runs keep from limits at first, by how much more where too many plants fail, and at most."""

SHARE_OF_SKETCHES = 0.4
"""Of the time, after which no further start is begun."""

SKETCH, LONGEST = 12, 60
"""Iterations of the ascent for a start at first, and of those that are followed."""


class RunProgress(NamedTuple):
    """What the search reports after each start: how many are done, its log det F, the best one so far, and seconds so far."""

    start: int
    n_starts: int
    log_det: float
    best: float
    seconds: float


class Found(NamedTuple):
    """Runs that a start has ended with; replaced as a whole, so that an interrupt cannot tear it.

    `share` is that of the plants on which they reach their ends, of those that the search has tried.
    """

    z: Array
    selected: NDArray[np.bool_] | None
    value: float
    share: float
    feasible: bool


class RunSearch:
    """The state of one search.

    Parameters
    ----------
    problem : DesignProblem
    region : RunRegion
    n_runs : int
    plants : ndarray, (R, p)
        Parameters of the model over which log det F is averaged.
    average : Average
        How.
    previous : ndarray, (R, p, p)
    aims : sequence of Aim
        What is maximised on each plant.
    confidence : float or None
        Share of the prior's plants that must be able to run the design.
    n_starts, n_candidates, seed, threads : int
    time_limit : float or None
    kept : Runs, optional
        Which plants have to run too; what they tell is in `previous`.

    Attributes
    ----------
    ends : list of Found
        What each start ended with.
    pool : RunPool
        Random runs, with which starts begin.
    singular : bool
        Whether log det F is asked for, and no runs determine all parameters.
    """

    def __init__(
        self,
        problem: DesignProblem,
        region: RunRegion,
        n_runs: int,
        plants: Array,
        average: Average,
        previous: Array,
        aims: Sequence[Aim],
        *,
        confidence: float | None,
        n_starts: int,
        n_candidates: int,
        seed: int,
        threads: int,
        time_limit: float | None,
        kept: Runs | None = None,
    ) -> None:
        self._began = time.perf_counter()
        self.problem, self.region, self.n_runs, self.n_starts, self._limit = problem, region, n_runs, n_starts, time_limit
        self.coordinates: RunCoordinates = region.coordinates(problem.model)
        self._settings = run_settings(problem, threads)
        finer = (min(self._settings[0], FINE), *self._settings[1:])
        self.objective = RunObjective(problem, self.coordinates, plants, average, previous, aims, finer)
        self._rng = np.random.default_rng(seed)
        self._confidence = confidence
        self.guard = RunPlants(problem, PLANTS, np.random.default_rng([seed, 1]), self._settings)
        self._can_run_kept = np.ones(PLANTS, dtype=bool) if kept is None else self.guard.can_run(kept)
        self.ends: list[Found] = []
        self._sketched: list[Found] = []
        wanted = max(4 * n_runs, 20, min(n_candidates, MOST_SEGMENTS_OF_POOL // (region.segments * len(plants))))
        self.pool = RunPool(self.objective, wanted, self._rng)
        self.singular = self.pool.singular and aims[0].of_all
        if self.singular:
            self.objective.previous = self.objective.previous + RIDGE * np.eye(previous.shape[-1])
        elif not aims[0].of_all:
            self.objective.aims, _ = told_aims(problem, aims, self.pool.rows, previous, n_runs, "estimable", RUNS)
        self._kappa = 0.0 if confidence is None or self._easy() else KAPPA
        if self._kappa:
            self.objective.kappa = self._kappa
            self.pool.judge_again()

    def _easy(self) -> bool:
        """Whether enough plants can run the best single runs of the pool as they are: then limits hardly matter."""
        _, able = self.guard.outputs(self.pool.best(LOOKED_AT))
        return all(self._enough(share) for share in able.mean(axis=0))

    def _enough(self, share: float) -> bool:
        return self._confidence is None or 1.0 - share <= LEAST_PART * (1.0 - self._confidence)

    @property
    def seconds(self) -> float:
        return time.perf_counter() - self._began

    @property
    def best(self) -> Found:
        """The best runs so far: such that enough plants can run them, where there are any."""
        return max(self.ends + self._sketched, key=_worth)

    @property
    def again(self) -> int:
        """How many starts have ended where the best one did."""
        return sum(end.value >= self.best.value - SAME and end.feasible == self.best.feasible for end in self.ends)

    def runs(self) -> Runs:
        """The best runs."""
        return self._planned(self.best.z, self.best.selected)

    def _planned(self, z: Array, selected: NDArray[np.bool_] | None) -> Runs:
        runs = self.coordinates.runs(z)
        return runs if selected is None else runs.measuring(selected)

    def run(self, progress: Callable[[RunProgress], None] | None) -> str:
        try:
            for start, z in enumerate(self._sketches()):
                self.ends.append(self._followed(z))
                if progress is not None:
                    progress(RunProgress(start + 1, self.n_starts, self.ends[-1].value, self.best.value, self.seconds))
                if self._late():
                    return "time_limit" if start + 1 < self.n_starts else "all_starts"
        except KeyboardInterrupt:
            if not self.ends:
                raise
            return "interrupted"
        return "all_starts"

    def _late(self) -> bool:
        return self._limit is not None and self.seconds >= self._limit

    def _sketches(self) -> list[Array]:
        """Free numbers of all starts, the best first; each has had some iterations and a single change."""
        sketched = []
        for _ in range(self.n_starts):
            z = self.pool.chosen(self.n_runs, self._rng)
            if self.n_starts > 1:
                selected = self._chosen_samples(z)
                z, value = self._by_moves(*self._ascended(z, selected, SKETCH), selected)
                sketched.append((value, z))
                self._sketched.append(self._tried(z, selected))
                if self._limit is not None and self.seconds > SHARE_OF_SKETCHES * self._limit:
                    break
            else:
                sketched.append((0.0, z))
        order = sorted(range(len(sketched)), key=lambda k: -sketched[k][0])
        return [sketched[k][1] for k in order]

    def _followed(self, z: Array) -> Found:
        """The best runs that a start leads to: ascents and single changes in turns, until neither gains.

        Where too many plants fail, the runs go on further from the limits.
        """
        objective, selected = self.objective, self._chosen_samples(z)
        objective.kappa = self._kappa
        best: Found | None = None
        for _ in range(MOST_ROUNDS):
            z, value = self._ascended(z, selected, LONGEST)
            found = self._tried(z, selected)
            best = found if best is None else max(best, found, key=_worth)
            if self._late():
                break
            if not found.feasible:
                if objective.kappa >= MOST_KAPPA:
                    break
                if objective.kappa > 0 and objective.looks < MORE_LOOKS:
                    objective.looks = MORE_LOOKS
                else:
                    objective.kappa = max(KAPPA, objective.kappa + MORE_KAPPA)
                value = objective.of(objective.judged(objective.tried(z, selected)))
            before = value
            z, value = self._by_moves(z, value, selected)
            if self.region.samples is not None:
                chosen = self._chosen_samples(z)
                if (again := objective.of(objective.judged(objective.tried(z, chosen)))) > value:
                    selected, value = chosen, again
            if found.feasible and not value > before + LEAST_GAIN:
                break
        assert best is not None
        return best

    def _tried(self, z: Array, selected: NDArray[np.bool_] | None) -> Found:
        """What runs are worth without costs, and how many plants can run them.

        At the problem's own tolerance they may touch a surface that they just miss at the search's, and have no derivative there.
        """
        planned = self._planned(z, selected)
        if run_rows(self.problem, planned, self.problem.theta, self._settings).status.any():
            return Found(z, selected, -np.inf, 0.0, False)
        judged = self.objective.judged(self.objective.tried(z, selected))
        value = self.objective.of(judged) + float(judged.costs.sum())
        share = float((self.guard.can_run(planned) & self._can_run_kept).mean())
        return Found(z, selected, value, share, self._enough(share))

    def _chosen_samples(self, z: Array) -> NDArray[np.bool_] | None:
        if self.region.samples is None:
            return None
        return best_samples(self.objective, self.coordinates.runs(z), self.region.samples)

    def _ascended(self, z: Array, selected: NDArray[np.bool_] | None, iterations: int) -> Peak:
        return ascend(self.objective, z, selected, iterations, self._late, self._rng)

    def _by_moves(self, z: Array, value: float, selected: NDArray[np.bool_] | None) -> tuple[Array, float]:
        """The best single change of each run, one after the other."""
        judged = self.objective.judged(self.objective.tried(z, selected))
        total = judged.matrices.sum(axis=0) + self.objective.previous
        paid = float(judged.costs.sum())
        for k in range(len(z)):
            moved = moved_runs(self.coordinates, z[k], self._rng)
            if not len(moved):  # nothing of it is free
                continue
            rows = None if selected is None else np.repeat(selected[k : k + 1], len(moved), axis=0)
            tried, own = self.objective.judged(self.objective.tried(moved, rows)), judged.some([k])
            values = self.objective.averages(total - own.matrices[0] + tried.matrices) - (paid - own.costs[0] + tried.costs)
            values = np.where(tried.ok, values, -np.inf)
            m = int(np.argmax(values))
            if values[m] > value + LEAST_GAIN:
                z, value = z.copy(), float(values[m])
                z[k] = moved[m]
                total = total - own.matrices[0] + tried.matrices[m]
                paid += float(tried.costs[m] - own.costs[0])
        return z, value


def _worth(found: Found) -> tuple[bool, float]:
    """By which runs are compared: what too few plants can run is worth less than what enough can."""
    return found.feasible, found.value if found.feasible else found.share
