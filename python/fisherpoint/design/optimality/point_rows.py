"""Experiment points as rows: which are valid, and their sensitivities in units of the noise and of the prior."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ...information.candidates import surviving
from ...information.output_covariance import cholesky_factor, criterion, whitened
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
    """

    def __init__(self, problem: DesignProblem, threads: int | None) -> None:
        self.problem, self._threads = problem, threads
        self._region = problem.region if isinstance(problem.region, ExperimentRegion) else None
        self.rejected: Counter[str] = Counter()

    def at_mean(self, points: Experiments) -> tuple[Array, NDArray[np.intp]]:
        """Rows (V, n, p) of those that are valid at the prior mean, and their places."""
        rows, places = [], []
        for first in range(0, len(points), MOST_POINTS):
            information, kept, _ = surviving(self.problem, self._region, points[first : first + MOST_POINTS], self._threads)
            rows.append(self.whitened(information))
            places.append(kept + first)
        return np.concatenate(rows), np.concatenate(places)

    def valid(self, points: Experiments) -> tuple[Array, NDArray[np.intp]]:
        """Rows of those that are valid at the prior mean and on all nodes of the rule, and their places; others are counted."""
        rows, places = [], []
        for first in range(0, len(points), MOST_POINTS):
            information, kept, lost = surviving(self.problem, self._region, points[first : first + MOST_POINTS], self._threads)
            _, status = with_covariance(self.problem, information, self._threads)
            good = status == Status.ok
            self.rejected.update(+lost)
            self.rejected.update(failures_of(status))
            rows.append(self.whitened(information[good]))
            places.append(kept[good] + first)
        return np.concatenate(rows), np.concatenate(places)

    def whitened(self, information: PointInformation) -> Array:
        """dy/dtheta times the prior std, in units of the noise (K, n, p)."""
        d = criterion(self.problem, information, self._threads)
        prepared = d.prepare(information)
        return whitened(cholesky_factor(d.given, d.names, d.kind), prepared.sensitivity)
