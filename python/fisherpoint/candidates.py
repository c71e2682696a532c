"""Candidates: drawn uniformly in the region's box, then filtered by constraints and by how their trajectories end."""

from __future__ import annotations

from collections import Counter

import numpy as np

from .experiments import Experiments
from .information import PointInformation, point_sensitivities, with_covariance
from .problem import DesignProblem
from .quantity import IntArray
from .trajectories import Status, on_surface, simulate

MAX_DRAWN_PER_CANDIDATE = 2000
"""Draws after which a region counts as one in which nothing survives."""


class CandidateSource:
    """Draws valid candidates and counts what was rejected and why.

    Parameters
    ----------
    problem : DesignProblem
        With a region.
    rng : numpy.random.Generator
    grid : bool
        Whether every candidate is tried on all nodes of the rule and gets its predictive covariance; otherwise only the nominal
        trajectory is, and `confirm` tries the nodes for those that matter.
    threads : int or None

    Raises
    ------
    ValueError
        Where the problem has no region.
    """

    def __init__(self, problem: DesignProblem, rng: np.random.Generator, grid: bool, threads: int | None) -> None:
        if problem.region is None:
            raise ValueError("region: expected an ExperimentRegion to draw candidates from, given None")
        self._problem, self._region, self._rng, self._grid, self._threads = problem, problem.region, rng, grid, threads
        self._spare: PointInformation | None = None
        self.drawn = 0
        self.rejected: Counter[str] = Counter()

    @property
    def accepted(self) -> int:
        return self.drawn - self.rejected.total()

    def draw(self, count: int) -> PointInformation:
        """Return `count` valid candidates.

        Raises
        ------
        ValueError
            Where hardly any point of the region survives; the reasons are listed.
        """
        found = [] if self._spare is None else [self._spare]
        have, tried, before = sum(map(len, found)), 0, self.rejected.copy()
        while have < count:
            if tried >= max(MAX_DRAWN_PER_CANDIDATE, MAX_DRAWN_PER_CANDIDATE // 20 * count):
                reasons = ", ".join(f"{reason} {n}" for reason, n in (self.rejected - before).most_common())
                raise ValueError(
                    f"region: expected points that survive, given {have} of {tried} drawn ({reasons}): widen or move the region"
                )
            share = max(self.accepted / self.drawn, 0.05) if self.drawn else 0.7
            batch = max(8, round((count - have) / share))
            tried += batch
            survivors = self._survivors(self._region.draw(self._problem.model, batch, self._rng))
            if survivors is not None:
                found.append(survivors)
                have += len(survivors)
        joined = PointInformation.join(found)
        self._spare = joined[count:] if have > count else None
        return joined[:count]

    def confirm(self, chosen: PointInformation) -> np.ndarray:
        """Try candidates on all nodes of the rule; return which are valid, and count the others as rejected."""
        if self._grid:
            return np.ones(len(chosen), dtype=bool)
        _, status = with_covariance(self._problem, chosen, self._threads)
        self.rejected.update(_reasons(status))
        return np.asarray(status == Status.ok)

    def draw_confirmed(self, count: int) -> PointInformation:
        """Return `count` candidates that are valid on all nodes of the rule."""
        found: list[PointInformation] = []
        tried = 0
        while (have := sum(map(len, found))) < count:
            if tried >= MAX_DRAWN_PER_CANDIDATE + 20 * count:
                raise ValueError(
                    f"region: expected points that survive on the prior grid, given {have} of {tried} tried: widen or move it"
                )
            batch = self.draw(count - have)
            tried += len(batch)
            found.append(batch[self.confirm(batch)])
        return PointInformation.join(found)

    def _survivors(self, points: Experiments) -> PointInformation | None:
        problem, drawn = self._problem, len(points)
        rejected: Counter[str] = Counter()
        satisfied = self._region.satisfied(problem.model, points)
        rejected["constraint"] += int((~satisfied).sum())
        points = points[satisfied]
        keep = np.ones(len(points), dtype=bool)
        for surface, rows in on_surface(problem.model, points, problem.theta).items():
            rejected[f"starts on {surface} = 0"] += int(keep[rows].sum())
            keep[rows] = False
        points = points[keep]
        # Most of what fails does so at the mean already: the states alone tell, for a fraction of the sensitivities' cost.
        status = simulate(problem.model, points, problem.theta, problem.rtol, self._threads, problem.kinks).status
        rejected.update(_reasons(status))
        information, status = point_sensitivities(problem, points[status == Status.ok], self._threads)
        rejected.update(_reasons(status))
        information = information[status == Status.ok]
        if self._grid:
            information, status = with_covariance(problem, information, self._threads)
            rejected.update(_reasons(status))
            information = information[status == Status.ok]
        self.drawn += drawn  # with the reasons, so that the counts add up after an interrupt too
        self.rejected.update(+rejected)
        return information if len(information) else None


def _reasons(status: IntArray) -> Counter[str]:
    values, counts = np.unique(status[status != Status.ok], return_counts=True)
    return Counter({Status(value).name: int(n) for value, n in zip(values, counts, strict=True)})
