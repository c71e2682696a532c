"""Points that climb at random: they follow limits that bend, where ascents along a straight way end.

Between a valid point and a better one may be others that are not valid on some node of the rule, as where a pressure touches a
limit in the middle of a trajectory. Candidates are drawn near each point, half of them on in the directions from which it has come.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...basics.quantity import names_of
from ...basics.values import Array
from ...information.candidates import CandidateSource
from ...information.point_information import PointInformation
from ...information.problem import DesignProblem
from ...points.experiments import Experiments
from ...points.region import ExperimentRegion
from .lineage import Lineage
from .pool import best_of_each, far_apart

EDGES, MOST = 5000, 200
"""Candidates at the edges of the region, and how many of them climb at most: the highest that are far apart."""

AGAIN = 60
"""The highest that have climbed before, which go on."""

ROUNDS = 30

NEAR = 16
"""Candidates near each point in a round."""

EARLIER = 4
"""Candidates near each point that are sampled earlier where some plants cannot run them to their end."""

LEAST_CLIMB = 1 + 1e-6
"""By which a candidate must exceed the point that it takes the place of."""

Height = Callable[[PointInformation], Array]
"""Of points that are valid at the prior mean, what they climb, (K,)."""


class Climbs:
    """Looks for high points of a region; each time it begins elsewhere, and goes on with the highest from before.

    Parameters
    ----------
    problem : DesignProblem
    rng : numpy.random.Generator
    threads : int or None
    elsewhere : tuple of DesignProblem
        The problem in scenarios, in all of which points have to be valid.
    """

    def __init__(
        self, problem: DesignProblem, rng: np.random.Generator, threads: int | None, elsewhere: tuple[DesignProblem, ...] = ()
    ) -> None:
        region = problem.region
        assert isinstance(region, ExperimentRegion)
        bounds = region.in_units_of(problem.model).bounds
        lower, upper = np.array([bounds[name] for name in names_of(problem.model.axes)]).T
        self._width = upper - lower
        self._source = CandidateSource(problem, rng, threads, elsewhere=elsewhere)
        self._lineage = Lineage()
        self._highest: Experiments | None = None

    @property
    def drawn(self) -> int:
        """Candidates so far."""
        return self._source.drawn

    def run(self, height: Height, beside: Experiments) -> Experiments:
        """Where candidates at the edges and some `beside` them have come to by climbing; all are valid on all nodes."""
        candidates = PointInformation.join([self._source.draw_at_edges(EDGES), self._source.survivors(beside)[0]])
        first = candidates[far_apart(self._numbers(candidates), self._width, height(candidates), MOST)]
        points = first[self._source.confirmed(first)[1]]
        if self._highest is not None:
            points = PointInformation.join([points, self._source.survivors(self._highest)[0]])
        now = height(points)
        for _ in range(ROUNDS):
            points, now = self._round(points, now, height)
        self._highest = points.experiments[np.sort(np.argsort(-now, kind="stable")[:AGAIN])]
        return points.experiments

    def _round(self, points: PointInformation, now: Array, height: Height) -> tuple[PointInformation, Array]:
        """Each point, or the highest valid one of what is drawn near it and of this sampled earlier; and how high they are."""
        near, place = self._source.draw_near(points.experiments, NEAR, self._lineage.steps(self._numbers(points)))
        of, least, found = place.astype(np.intp), LEAST_CLIMB * now, height(near)
        wanted = best_of_each(found, of, least, EARLIER, np.ones(len(of), dtype=bool))
        earlier, of_wanted, lost = self._source.sampled_earlier(near.experiments[wanted])
        passed = np.delete(wanted, lost)
        tried, of = PointInformation.join([near[passed], earlier]), np.append(of[passed], of[wanted[of_wanted]])
        found = np.append(found[passed], height(earlier))
        best = best_of_each(found, of, least, 1, np.ones(len(of), dtype=bool))
        best = best[self._source.confirmed(tried[best])[1]]
        self._lineage.add(self._numbers(tried[best]), self._numbers(points[of[best]]))
        rows = np.arange(len(points))
        rows[of[best]] = len(points) + np.arange(len(best))
        return PointInformation.join([points, tried[best]])[rows], np.append(now, found[best])[rows]

    def _numbers(self, points: PointInformation) -> Array:
        """Of points, (K, d)."""
        return points.experiments.table[:, : len(self._width)]
