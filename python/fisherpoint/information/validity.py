"""Which points are valid on all nodes of a rule, with what is remembered of them and told by few nodes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array, IntArray
from ..points.experiments import Experiments
from ..points.settings import check_jumps, check_kinks, resolve_threads
from ..points.status import Status
from .longest import SHORT
from .node_sieve import FATAL, NodeSieve, lasting
from .point_information import PointInformation, with_covariance
from .problem import DesignProblem


class Validity:
    """Tries points on the nodes of a problem's rule, and on plants where these are asked.

    Parameters
    ----------
    problem : DesignProblem
    threads : int or None
    """

    def __init__(self, problem: DesignProblem, threads: int | None) -> None:
        self._problem, self._threads = problem, threads
        settings = float(problem.rtol), check_kinks(problem.kinks), check_jumps(problem.jumps), "fastest", resolve_threads(threads)
        self._settings = settings
        self._sieve = NodeSieve(problem, settings)
        self._known: dict[bytes, bool] = {}  # by the numbers of a point

    def ask(self, plants: Array) -> None:
        """From now on a point is valid where it is also ok on all of some plants (m, p), parameters as `drawn_plants` has them."""
        self._sieve = NodeSieve(self._problem, self._settings, plants)
        self._known.clear()

    def tried(self, points: PointInformation) -> tuple[PointInformation, IntArray]:
        """The points (K,) with their predictive covariances, zero where they are not valid, and their statuses."""
        status = self._sieve.statuses(points.experiments)
        passed = np.flatnonzero(status == Status.ok)
        found, there = with_covariance(self._problem, points[passed], self._threads)
        if len(self._sieve.plants):
            ok = np.flatnonzero(there == Status.ok)
            there[ok] = self._sieve.on_plants(found.experiments[ok])
        self._sieve.learn(found.experiments[np.flatnonzero(there)])
        status[passed] = there
        self._known.update(zip(_numbers(points), (status == Status.ok).tolist(), strict=True))
        if len(passed) == len(points):
            return found, status
        covariance = np.zeros((len(points), *found.covariance.shape[1:]))
        covariance[passed] = found.covariance
        return replace(points, covariance=covariance), status

    def of(self, points: PointInformation) -> NDArray[np.bool_]:
        """Which points (K,) are valid; those of which it is not known are tried."""
        numbers = _numbers(points)
        new = [k for k, key in enumerate(numbers) if key not in self._known]
        if new:
            self.tried(points[np.array(new)])
        return np.array([self._known[key] for key in numbers], dtype=bool)

    def cut_short(
        self, points: Experiments, shortest: float, *, ok_at_mean: bool = False, roughly: bool = False
    ) -> tuple[Experiments, IntArray, IntArray]:
        """Of points (K,), those that are lost at the prior mean or on few nodes, with the longest dt at which these let them pass.

        With `ok_at_mean` all are known to be ok at the mean; `roughly` asks the nodes alone that tell most.

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
            status, dt = np.where(np.isin(there, FATAL), there, np.int32(Status.ok)), np.minimum(dt, SHORT * at_mean)
        left = np.flatnonzero(dt >= shortest)
        there, dt[left] = self._sieve.shortened(lasting(points[left], dt[left]), shortest, roughly)
        status[left] = np.where(status[left] == Status.ok, there, status[left])
        places = np.flatnonzero((status != Status.ok) & (dt >= shortest))
        return lasting(points[places], dt[places]), places.astype(np.int32), status

    def cut_for_plants(self, points: Experiments, shortest: float) -> tuple[Experiments, NDArray[np.bool_]]:
        """The points (K,) for as long as all plants that are asked run them, and for which of them there is a dt; these alone."""
        lasted = np.minimum(self._sieve.lasted_on_plants(points).min(axis=1), self._at_mean(points)[1])
        dt = np.minimum(points.dt, SHORT * lasted)
        found = dt >= shortest
        return lasting(points[found], dt[found]), found

    def _at_mean(self, points: Experiments) -> tuple[IntArray, Array]:
        """Statuses (K,), and until when each point can be followed, infinite where none of `FATAL` ended it."""
        model, theta = self._problem.limited, self._problem.theta
        _, _, status, lasted = model.kernels.simulate(model.core, points.x0, points.u, points.dt, theta, *self._settings)
        return np.asarray(status), np.where(np.isin(status, FATAL), lasted, np.inf)

    def include(self, other: Validity) -> None:
        """Remember what another has tried of the same problem."""
        self._known.update(other._known)


def _numbers(points: PointInformation) -> list[bytes]:
    return [row.tobytes() for row in points.experiments.table]
