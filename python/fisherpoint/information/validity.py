"""Whether points are valid on all nodes of a rule, from a memory of earlier points and from pilot nodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array, IntArray
from ..basics.work_clock import LANES, Clock
from ..points.experiments import Experiments
from ..points.status import Status
from ..prior.rules import LinearizedRule
from .draws import drawn_plants
from .pilot_nodes import SHORT, PilotNodes, fatal, lasting
from .point_information import PointInformation, statuses_over_nodes, with_covariance
from .problem import DesignProblem

RULE_SHARE = 0.25
"""Share of a limit of time that all points that are tried may take on the nodes of the rule."""

PLANTS_SEED = 4_000_037
"""Seed of the plants that stand for the nodes where these take too long."""


class Validity:
    """Tries points on the nodes of a problem's rule, and on required plants, if any.

    Parameters
    ----------
    problem : DesignProblem
    threads : int or None
    covariances : bool
        Whether what is tried gets its predictive covariance.
    clock : Clock, optional
        Where all nodes of the rule would take too much of its limit, points are tried on some plants in their place.
    expected : int
        Number of points that will be tried, about.

    Attributes
    ----------
    plants : int or None
        Number of plants that stand for the nodes of the rule; None where points are tried on all nodes.
    """

    def __init__(
        self,
        problem: DesignProblem,
        threads: int | None,
        covariances: bool = True,
        clock: Clock | None = None,
        expected: int = 1,
    ) -> None:
        self._problem, self._threads, self._covariances = problem, threads, covariances
        settings = problem.integration(threads)
        self._settings, self._clock, self._expected = settings, Clock() if clock is None else clock, expected
        self._sieve = PilotNodes(problem, settings, clock=clock)
        self._known: dict[bytes, bool] = {}  # by the numbers of a point
        self._instead: PilotNodes | None = None
        self._decided = covariances or not self._clock.limited or isinstance(problem.rule, LinearizedRule)

    def ask(self, plants: Array) -> None:
        """Require plants (m, p), parameters as of `drawn_plants`: from now on valid points are also ok on all of them."""
        self._sieve = PilotNodes(self._problem, self._settings, plants, self._clock)
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

        def over_nodes(rows: NDArray[np.intp]) -> IntArray:
            if self._instead is not None:
                return self._on_plants(self._instead, points[rows])
            return statuses_over_nodes(self._problem, points[rows], self._threads)

        if not self._decided and len(points):
            self._decide(points[:1])
        return self._staged_statuses(points, over_nodes)

    @property
    def plants(self) -> int | None:
        return None if self._instead is None else len(self._instead.plants)

    def _decide(self, point: Experiments) -> None:
        """Whether all nodes are tried, or some plants in their place, by what a few trajectories cost."""
        some, _ = drawn_plants(self._problem, LANES, np.random.default_rng(PLANTS_SEED))
        PilotNodes(self._problem, self._settings, some, self._clock).on_plants(point)
        most = self._clock.affordable("nodes", RULE_SHARE / self._expected)
        if self._problem.rule.size(self._problem.prior) > most:
            plants, _ = drawn_plants(self._problem, max(LANES, int(most)), np.random.default_rng(PLANTS_SEED))
            self._instead = PilotNodes(self._problem, self._settings, plants, self._clock)
        self._decided = True

    def _on_plants(self, instead: PilotNodes, points: Experiments) -> IntArray:
        """Statuses (K,) of points on plants that stand for the nodes: ok where no more are lost than may be."""
        status = instead.statuses_on_plants(points)
        lost = status != Status.ok
        failed = lost.mean(axis=1) > self._problem.rule.max_lost_weight
        return np.where(failed, status[np.arange(len(points)), np.argmax(lost, axis=1)], np.int32(Status.ok))

    def _staged_statuses(self, points: Experiments, over_nodes: Callable[[NDArray[np.intp]], IntArray]) -> IntArray:
        """Statuses on pilot nodes, on all nodes where a point passes these, and on the required plants."""
        status = self._sieve.statuses(points)
        passed = np.flatnonzero(status == Status.ok)
        lanes = len(self._instead.plants) if self._instead else self._problem.rule.size(self._problem.prior)
        there = np.concatenate([over_nodes(passed[some]) for some in self._clock.blocks("rule", len(passed), lanes)])
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
        model, theta, parts = self._problem.limited, self._problem.theta, []
        for some in self._clock.blocks("nodes", len(points)):
            given = points.x0[some], points.u[some], points.dt[some]
            parts.append(model.kernels.simulate(model.core, *given, theta, *self._settings)[2:])
        status, lasted = (np.concatenate([np.asarray(one) for one in found]) for found in zip(*parts, strict=True))
        return status, np.where(fatal(status), lasted, np.inf)

    def include(self, other: Validity) -> None:
        """Remember what another has tried of the same problem."""
        self._known.update(other._known)


def _numbers(points: Experiments) -> list[bytes]:
    return [row.tobytes() for row in points.table]
