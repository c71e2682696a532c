"""Experiment points as rows: which are valid, and their sensitivities in units of the noise and of the prior."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ...information.candidates import surviving
from ...information.output_covariance import cholesky_factor, output_covariance, whitened
from ...information.point_information import MOST_POINTS, PointInformation, with_covariance
from ...information.problem import DesignProblem
from ...points.experiments import Experiments
from ...points.region import ExperimentRegion
from ...points.status import Status, failures_of


def check_additive(problem: DesignProblem) -> None:
    """Raise unless the information of points adds up, as weights take it."""
    if problem.output_covariance != "noise":
        raise ValueError(
            "output_covariance: expected 'noise', with which the information of points adds up and has a convex optimum, given "
            f"{problem.output_covariance!r}"
        )


class PointRows:
    """The rows of the points of a problem.

    Parameters
    ----------
    problem : DesignProblem
    threads : int or None
    elsewhere : tuple of DesignProblem
        The same problem in scenarios, in all of which points have to be valid; then there are rows of each.
    """

    def __init__(self, problem: DesignProblem, threads: int | None, elsewhere: tuple[DesignProblem, ...] = ()) -> None:
        self.problem, self._threads, self._elsewhere = problem, threads, elsewhere
        self._region = problem.region if isinstance(problem.region, ExperimentRegion) else None
        self.rejected: Counter[str] = Counter()

    def at_mean(self, points: Experiments) -> tuple[Array, NDArray[np.intp]]:
        """Rows (V, n, p), or (V, S, n, p), of those that are valid at the prior mean, and their places."""
        rows, places = [], []
        for first in range(0, max(len(points), 1), MOST_POINTS):
            information, kept, _ = self._surviving(points[first : first + MOST_POINTS])
            rows.append(self.whitened(information))
            places.append(kept + first)
        return np.concatenate(rows), np.concatenate(places)

    def valid(self, points: Experiments) -> tuple[Array, NDArray[np.intp]]:
        """Rows of those that are valid at the prior mean and on all nodes of the rule, and their places; others are counted."""
        rows, places = [], []
        for first in range(0, max(len(points), 1), MOST_POINTS):
            information, kept, lost = self._surviving(points[first : first + MOST_POINTS])
            _, status = with_covariance(self.problem, information, self._threads)
            good = status == Status.ok
            self.rejected.update(+lost)
            self.rejected.update(failures_of(status))
            rows.append(self.whitened(information[good]))
            places.append(kept[good] + first)
        return np.concatenate(rows), np.concatenate(places)

    def whitened(self, information: PointInformation) -> Array:
        """dy/dtheta times the prior std, in units of the noise (K, n, p), or (K, S, n, p)."""
        d = output_covariance(self.problem, information, self._threads)
        factor = cholesky_factor(d.given, d.names, d.kind)
        if not self._elsewhere:
            return whitened(factor, d.prepare(information).sensitivity)
        return np.stack([whitened(factor, d.prepare(one).sensitivity) for one in information.everywhere], axis=1)

    def _surviving(self, points: Experiments) -> tuple[PointInformation, NDArray[np.intp], Counter[str]]:
        return surviving(self.problem, self._region, points, self._threads, self._elsewhere)
