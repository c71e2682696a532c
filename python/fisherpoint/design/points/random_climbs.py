"""Points that climb at random: they follow limits that bend, where ascents along a straight way end.

Between a valid point and a better one may be others that are not valid on some node of the rule, as where a pressure touches a
limit in the middle of a trajectory. Candidates are drawn near each point, half of them on in the directions from which it has come.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ...information.candidates import CandidateSource
from ...information.point_information import PointInformation
from ...information.problem import DesignProblem
from ...information.validity import Validity
from ...points.experiments import Experiments
from .past_moves import Lineage
from .pool import best_of_each, far_apart
from .tuning import ClimbTuning, RegionClimbTuning

Height = Callable[[PointInformation], Array]
"""The function to climb, (K,), of points that are valid at the prior mean."""


def higher(
    source: CandidateSource, points: PointInformation, steps: Array, now: Array, height: Height, tuning: ClimbTuning
) -> tuple[PointInformation, NDArray[np.intp]]:
    """Near each point the highest candidate, where one exceeds what it is `now`, (K,); and the places of these points.

    Candidates go on by the `steps` (K, m, d) that points have come by. The highest of each are also sampled earlier where few
    nodes do not let them pass. Whether what is found is valid on all nodes is not known.
    """
    near, place = source.draw_near(points.experiments, tuning.near_per_point, steps)
    of, least, found = place.astype(np.intp), (1 + tuning.least_gain) * now, height(near)
    wanted = best_of_each(found, of, least, tuning.shortened_per_point)
    cut, of_wanted, lost = source.sampled_earlier(near.experiments[wanted])
    passed = np.delete(wanted, lost)
    tried, of = PointInformation.join([near[passed], cut]), np.append(of[passed], of[wanted[of_wanted]])
    best = best_of_each(np.append(found[passed], height(cut)), of, least, 1)
    return tried[best], of[best]


class Climbs:
    """Looks for high points of a region; each time it begins elsewhere, and goes on with the highest from before.

    Parameters
    ----------
    problem : DesignProblem
    rng : numpy.random.Generator
    threads : int or None
    elsewhere : tuple of DesignProblem
        The problem in scenarios, in all of which points have to be valid.
    tuning : RegionClimbTuning, optional
    """

    def __init__(
        self,
        problem: DesignProblem,
        rng: np.random.Generator,
        threads: int | None,
        elsewhere: tuple[DesignProblem, ...] = (),
        tuning: RegionClimbTuning | None = None,
    ) -> None:
        self.tuning = RegionClimbTuning() if tuning is None else tuning
        lower, upper = problem.point_region.box(problem.model)
        self._width = upper - lower
        self._source = CandidateSource(problem, rng, threads, elsewhere=elsewhere, validity=Validity(problem, threads, False))
        self._lineage = Lineage(self.tuning.climb.generations)
        self._highest: Experiments | None = None

    def run(self, height: Height, beside: Experiments) -> Experiments:
        """Where candidates at the edges and some `beside` them have come to by climbing; all are valid on all nodes."""
        tuning = self.tuning
        edges = self._source.draw_at_edges(tuning.edge_candidates)
        candidates = PointInformation.join([edges, self._source.survivors(beside)[0]])
        numbers, heights = self._numbers(candidates), height(candidates)
        first = candidates[far_apart(numbers, self._width, heights, tuning.most_climbing, tuning.climb.least_distance)]
        points = first[self._source.confirmed(first)[1]]
        if self._highest is not None:
            points = PointInformation.join([points, self._source.survivors(self._highest)[0]])
        now = height(points)
        for _ in range(tuning.climb.rounds):
            points, now = self._round(points, now, height)
        self._highest = points.experiments[np.sort(np.argsort(-now, kind="stable")[: tuning.going_on])]
        return points.experiments

    def _round(self, points: PointInformation, now: Array, height: Height) -> tuple[PointInformation, Array]:
        """Each point, or the highest candidate near it where that is valid; and how high they are."""
        steps = self._lineage.steps(self._numbers(points))
        found, of = higher(self._source, points, steps, now, height, self.tuning.climb)
        valid = self._source.confirmed(found)[1]
        found, of = found[valid], of[valid]
        self._lineage.add(self._numbers(found), self._numbers(points[of]))
        rows = np.arange(len(points))
        rows[of] = len(points) + np.arange(len(of))
        return PointInformation.join([points, found])[rows], np.append(now, height(found))[rows]

    def _numbers(self, points: PointInformation) -> Array:
        """The numbers of points, (K, d)."""
        return points.experiments.table[:, : len(self._width)]
