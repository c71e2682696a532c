"""Whether points are valid on all nodes of a rule, from a memory of earlier points and from pilot nodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array, IntArray
from ..points.experiments import Experiments
from ..points.status import Status
from .pilot_nodes import SHORT, PilotNodes, fatal, lasting
from .point_information import PointInformation, statuses_over_nodes, with_covariance
from .problem import DesignProblem


class Validity:
    """Tries points on the nodes of a problem's rule, and on required plants, if any.

    Parameters
    ----------
    problem : DesignProblem
    threads : int or None
    covariances : bool
        Whether what is tried gets its predictive covariance.
    """

    def __init__(self, problem: DesignProblem, threads: int | None, covariances: bool = True) -> None:
        self._problem, self._threads, self._covariances = problem, threads, covariances
        settings = problem.integration(threads)
        self._settings = settings
        self._sieve = PilotNodes(problem, settings)
        self._known: dict[bytes, bool] = {}  # by the numbers of a point

    def ask(self, plants: Array) -> None:
        """Require plants (m, p), parameters as of `drawn_plants`: from now on valid points are also ok on all of them."""
        self._sieve = PilotNodes(self._problem, self._settings, plants)
        self._known.clear()

    def tried(self, points: PointInformation) -> tuple[PointInformation, IntArray]:
        """Return the points (K,), with their predictive covariances if requested, zero where not valid; and statuses."""
        if not self._covariances:
            return points, self.statuses(points.experiments)
        covariance = np.zeros_like(points.covariance)

        def over_nodes(rows: NDArray[np.intp]) -> IntArray:
            found, status = with_covariance(self._problem, points[rows], self._threads)
            covariance[rows] = found.covariance
            return status

        status = self._staged_statuses(points.experiments, over_nodes)
        return replace(points, covariance=covariance), status

    def statuses(self, points: Experiments) -> IntArray:
        """Statuses (K,) of points that are ok at the prior mean."""
        return self._staged_statuses(points, lambda rows: statuses_over_nodes(self._problem, points[rows], self._threads))

    def _staged_statuses(self, points: Experiments, over_nodes: Callable[[NDArray[np.intp]], IntArray]) -> IntArray:
        """Statuses on pilot nodes, on all nodes where a point passes these, and on the required plants."""
        status = self._sieve.statuses(points)
        passed = np.flatnonzero(status == Status.ok)
        there = over_nodes(passed)
        if len(self._sieve.plants):
            ok = np.flatnonzero(there == Status.ok)
            there[ok] = self._sieve.on_plants(points[passed[ok]])
        self._sieve.learn(points[passed[there != Status.ok]])
        status[passed] = there
        self._known.update(zip(_numbers(points), (status == Status.ok).tolist(), strict=True))
        return status

    def of(self, points: Experiments) -> NDArray[np.bool_]:
        """Whether points (K,) that are ok at the prior mean are valid; those for which that is not known are tried."""
        numbers = _numbers(points)
        new = [k for k, key in enumerate(numbers) if key not in self._known]
        if new:
            self.statuses(points[np.array(new)])
        return np.array([self._known[key] for key in numbers], dtype=bool)

    def cut_short(
        self, points: Experiments, shortest: float, *, ok_at_mean: bool = False, roughly: bool = False
    ) -> tuple[Experiments, IntArray, IntArray]:
        """Shorten points (K,) that fail at the prior mean or on pilot nodes to the longest dt at which they pass.

        With `ok_at_mean` all are known to be ok at the mean; `roughly` tries only the nodes that reject most.

        Returns
        -------
        points : Experiments
        places : ndarray of int
            Of these points among the given ones.
        status : ndarray of int, (K,)
            Of the given points: that at the mean or of a node on which they fail, or ok.
        """
        status, dt = np.zeros(len(points), dtype=np.int32), points.dt.copy()
        if not ok_at_mean:
            there, at_mean = self._at_mean(points)
            status, dt = np.where(fatal(there), there, np.int32(Status.ok)), np.minimum(dt, SHORT * at_mean)
        left = np.flatnonzero(dt >= shortest)
        there, dt[left] = self._sieve.shortened(lasting(points[left], dt[left]), shortest, roughly)
        if ok_at_mean:
            lost = left[there != Status.ok]
            self._known.update(dict.fromkeys(_numbers(points[lost]), False))
        status[left] = np.where(status[left] == Status.ok, there, status[left])
        places = np.flatnonzero((status != Status.ok) & (dt >= shortest))
        return lasting(points[places], dt[places]), places.astype(np.int32), status

    def cut_for_plants(self, points: Experiments, shortest: float) -> tuple[Experiments, NDArray[np.bool_]]:
        """Shorten points so that every required plant completes them; return those that can, and a mask (K,) of them."""
        lasted = np.minimum(self._sieve.lasted_on_plants(points).min(axis=1), self._at_mean(points)[1])
        dt = np.minimum(points.dt, SHORT * lasted)
        found = dt >= shortest
        return lasting(points[found], dt[found]), found

    def _at_mean(self, points: Experiments) -> tuple[IntArray, Array]:
        """Statuses (K,), and until when each point can be followed, infinite where none of `FATAL` ended it."""
        model, theta = self._problem.limited, self._problem.theta
        _, _, status, lasted = model.kernels.simulate(model.core, points.x0, points.u, points.dt, theta, *self._settings)
        return np.asarray(status), np.where(fatal(status), lasted, np.inf)

    def include(self, other: Validity) -> None:
        """Remember what another has tried of the same problem."""
        self._known.update(other._known)


def _numbers(points: Experiments) -> list[bytes]:
    return [row.tobytes() for row in points.table]
