"""Candidates: drawn uniformly in the region's box, then filtered by constraints and by how their trajectories end."""

from __future__ import annotations

from collections import Counter

import numpy as np

from .experiments import Experiments
from .information import PointInformation, point_sensitivities, with_covariance
from .problem import DesignProblem
from .quantity import IntArray
from .trajectories import Status, on_surface

MAX_DRAWN_PER_CANDIDATE = 2000
"""Draws after which a region counts as one in which nothing survives."""

SMALLEST_BATCH, LARGEST_BATCH = 64, 1024
"""Draws at once; what is left over serves the next request."""


class CandidateSource:
    """Draws valid candidates and counts what was rejected and why.

    Parameters
    ----------
    problem : DesignProblem
        With a region.
    rng : numpy.random.Generator
    threads : int or None

    Raises
    ------
    ValueError
        Where the problem has no region.
    """

    def __init__(self, problem: DesignProblem, rng: np.random.Generator, threads: int | None) -> None:
        if problem.region is None:
            raise ValueError("region: expected an ExperimentRegion to draw candidates from, given None")
        self._problem, self._region, self._rng, self._threads = problem, problem.region, rng, threads
        self._spare: PointInformation | None = None
        self.drawn = 0
        self.rejected: Counter[str] = Counter()

    @property
    def accepted(self) -> int:
        return self.drawn - self.rejected.total()

    def draw(self, count: int) -> PointInformation:
        """Return `count` candidates that are valid at the prior mean, without predictive covariances.

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
            batch = round(np.clip(4 * count / share, SMALLEST_BATCH, LARGEST_BATCH))
            tried += batch
            survivors = self._survivors(self._region.draw(self._problem.model, batch, self._rng))
            found.append(survivors)
            have += len(survivors)
        joined = PointInformation.join(found) if len(found) > 1 else found[0]
        self._spare = joined[count:] if have > count else None
        return joined[:count]

    def confirm(self, chosen: PointInformation) -> PointInformation:
        """Return those that are valid on all nodes of the rule, with their covariances; count the others as rejected."""
        information, status = with_covariance(self._problem, chosen, self._threads)
        if not status.any():
            return information
        self.rejected.update(_reasons(status))
        return information[status == Status.ok]

    def draw_confirmed(self, count: int) -> PointInformation:
        """Return `count` candidates that are valid on all nodes of the rule, with their predictive covariances."""
        found: list[PointInformation] = []
        tried = 0
        while (have := sum(map(len, found))) < count:
            if tried >= MAX_DRAWN_PER_CANDIDATE + 20 * count:
                raise ValueError(
                    f"region: expected points that survive on the prior grid, given {have} of {tried} tried: widen or move it"
                )
            batch = self.draw(count - have)
            tried += len(batch)
            found.append(self.confirm(batch))
        return PointInformation.join(found)

    def _survivors(self, points: Experiments) -> PointInformation:
        problem, drawn = self._problem, len(points)
        rejected: Counter[str] = Counter()
        if self._region.constraints:
            satisfied = self._region.satisfied(problem.model, points)
            rejected["constraint"] += int((~satisfied).sum())
            points = points[satisfied]
        keep = np.ones(len(points), dtype=bool)
        for surface, rows in on_surface(problem.model, points, problem.theta).items():
            rejected[f"starts on {surface} = 0"] += int(keep[rows].sum())
            keep[rows] = False
        information, status = point_sensitivities(problem, points[keep], self._threads)
        rejected.update(_reasons(status))
        self.drawn += drawn  # with the reasons, so that the counts add up after an interrupt too
        self.rejected.update(+rejected)
        return information[status == Status.ok]


def _reasons(status: IntArray) -> Counter[str]:
    counts = np.bincount(status, minlength=len(Status))
    return Counter({Status(value).name: int(n) for value, n in enumerate(counts) if n and value != Status.ok})
