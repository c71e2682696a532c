"""Pilot nodes: few nodes of a rule that reject most of the points that the prior cannot run.

Most points that a search prefers fail on some nodes of its rule, and mostly on the same few. So these are tried first, which costs
a tenth of all nodes. Points that pass them are tried on all. Plants that every point has to run on are among the nodes, each with
a weight that is not to be lost.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..basics.quantity import names_of
from ..basics.values import Array, IntArray
from ..basics.work_clock import Clock
from ..points.experiments import Experiments
from ..points.predictive import nodes_of
from ..points.settings import Integration
from ..points.status import Status
from ..prior.rules import LinearizedRule
from .problem import DesignProblem

SHORT = 0.999
"""Share of the time at which a trajectory ends that is used, as this time is known to the tolerance."""


def longest(lasted: Array, weights: Array, allowed: float) -> Array:
    """Return times (K,), a little before more weight is lost than allowed; infinite where that never happens.

    What a trajectory meets by some time it meets by any later one.

    Parameters
    ----------
    lasted : ndarray, (K, m)
        Until when each point could be followed on each node; infinite where that is its end.
    weights : ndarray, (m,)
    allowed : float
        Largest weight of the nodes that may be lost.
    """
    order = np.argsort(lasted, axis=1, kind="stable")
    lost = np.cumsum(weights[order], axis=1) > allowed
    first: NDArray[np.intp] = np.argmax(lost, axis=1)
    ends = np.take_along_axis(lasted, np.take_along_axis(order, first[:, None], axis=1), axis=1)[:, 0]
    return np.where(lost.any(axis=1), SHORT * ends, np.inf)


FATAL = (Status.left_domain, Status.met_jump, Status.not_finite)
"""Statuses that make a node lost however its trajectory is computed."""

_IS_FATAL = np.isin(np.arange(max(Status) + 1), FATAL)  # by status: a search asks thousands of times

FEW, MOST = 12, 1000
"""Number of pilot nodes, and the size of a rule up to which it pays to choose them."""

AT_FIRST = 4
"""Number of pilot nodes tried first, because they reject most."""

LEARNT, REMEMBERED = 50, 300
"""Number of failed points passed by the pilot nodes after which these are chosen anew, and the number of points used for that.

A search moves on, and so do the nodes on which its candidates fail.
"""

ROUGH = 1e-4
"""Tolerance of the trajectories on pilot nodes: points that pass are tried on all nodes to that of the problem."""

LOSS = 1.001
"""Multiple of the allowed loss at which a point has failed."""


class PilotNodes:
    """Nodes of a problem's rule that fail first.

    Parameters
    ----------
    problem : DesignProblem
    settings : Integration
        Of the trajectories.
    plants : ndarray, (m, p), optional
        Parameters of `problem.assumed.model`, if there is one, with which all points have to be ok.
    clock : Clock, optional
    """

    def __init__(
        self, problem: DesignProblem, settings: Integration, plants: Array | None = None, clock: Clock | None = None
    ) -> None:
        self._clock = Clock() if clock is None else clock
        self._problem, self._settings, rule = problem, settings, problem.rule
        self.allowed = LOSS * rule.max_lost_weight
        """Largest weight of the nodes that may be lost."""
        self.model, self._assumed = problem.model, None
        if plants is not None:
            self._assumed = problem.assumed
            self.model = problem.limited if self._assumed is None else self._assumed.model
        self._few, self._plants = FEW if plants is None else 2 * FEW, plants
        self._failed: list[Array] = []
        self._chosen = np.empty(0, dtype=np.intp)
        self._theta: Array | None = None
        self._weights = np.empty(0)
        if not problem.model.in_core:
            return
        if not isinstance(rule, LinearizedRule) and rule.size(problem.prior) <= MOST:
            theta, weights = nodes_of(rule, problem.prior, names_of(problem.model.parameters), problem.estimated).nodes()
            if len(theta) > 2 * FEW:
                self._theta, self._weights = self.at(theta), np.abs(weights) / np.abs(weights).sum()
        if plants is not None:
            self._theta = plants if self._theta is None else np.concatenate([self._theta, plants])
            self._weights = np.append(self._weights, np.ones(len(plants)))
        self._lost = np.zeros((0, len(self._weights)), dtype=bool)  # of points that have failed, the nodes (K, n) that are lost

    def at(self, theta: Array) -> Array:
        """Parameters (m, p) of the problem's model as those of `model`."""
        return theta if self._assumed is None else self._assumed.theta(theta)

    @property
    def plants(self) -> Array:
        """Plants on which every point has to be ok, (m, p); none where none are required."""
        return np.empty((0, len(self.model.parameters))) if self._plants is None else self._plants

    def on_plants(self, points: Experiments) -> IntArray:
        """Statuses (K,) of points on plants: ok where a point passes on all, else that of a plant on which it fails."""
        status, _ = self._at(points, self.plants, self._settings)
        lost = fatal(status)
        return np.where(lost.any(axis=1), status[np.arange(len(points)), np.argmax(lost, axis=1)], np.int32(Status.ok))

    def statuses_on_plants(self, points: Experiments) -> IntArray:
        """Statuses (K, m) of points on each plant."""
        return self._at(points, self.plants, self._settings)[0]

    def lasted_on_plants(self, points: Experiments) -> Array:
        """Times (K, m) until which points can be followed on each plant; infinite where none of `FATAL` ended them."""
        return self._at(points, self.plants, self._settings)[1]

    def statuses(self, points: Experiments) -> IntArray:
        """Statuses (K,) of points on pilot nodes: ok where a point passes, else that of a node on which it fails."""
        result, weighs = np.zeros(len(points), dtype=np.int32), np.zeros(len(points))
        for some in self._in_turn:
            left = np.flatnonzero(result == Status.ok)
            if len(some) and len(left):
                status, _ = self._on_nodes(points[left], some)
                lost = fatal(status)
                weighs[left] += lost @ self._weights[some]
                failed = weighs[left] > self.allowed
                result[left[failed]] = status[failed, np.argmax(lost[failed], axis=1)]
        return result

    @property
    def _in_turn(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """The pilot nodes that are tried first, and those on which points that pass are tried next."""
        return self._chosen[:AT_FIRST], self._chosen[AT_FIRST:]

    def shortened(self, points: Experiments, shortest: float, first_alone: bool) -> tuple[IntArray, Array]:
        """Statuses (K,) as of `statuses`, and the longest dt (K,) at which the few nodes let each point pass.

        A dt below the `shortest` one is not the longest; the other nodes have not been tried. With `first_alone` only those
        that reject most are tried.
        """
        status, dt = np.zeros(len(points), dtype=np.int32), points.dt.copy()
        lasted, tried = np.empty((len(points), 0)), np.empty(0, dtype=np.intp)
        for some in self._in_turn[:1] if first_alone else self._in_turn:
            left = np.flatnonzero(dt >= shortest)
            if not len(some) or not len(left):
                continue
            there, until = self._on_nodes(lasting(points[left], dt[left]), some)
            tried = np.append(tried, some)
            lasted = np.column_stack([lasted, np.full((len(points), len(some)), np.inf)])
            lasted[left, -len(some) :] = until
            dt[left] = np.minimum(dt[left], longest(lasted[left], self._weights[tried], self.allowed))
            first = np.argmax(fatal(there), axis=1)
            new = (status[left] == Status.ok) & (dt[left] < points.dt[left])
            status[left[new]] = there[new, first[new]]
        return status, dt

    def learn(self, failed: Experiments) -> None:
        """Learn from points that failed on all nodes together."""
        if self._theta is None or not len(failed) or self._clock.costly("nodes", LEARNT * len(self._theta)):
            return
        self._failed.append(failed.table)
        if sum(map(len, self._failed)) < LEARNT:
            return
        points = Experiments.of_table(self._problem.model, np.concatenate(self._failed)[-REMEMBERED:])
        self._failed = []
        lost = fatal(self._on_nodes(points, np.arange(len(self._theta)))[0])
        self._lost = np.concatenate([self._lost, lost])[-REMEMBERED:]
        self._chosen = self._fewest(self._lost)

    def _fewest(self, lost: NDArray[np.bool_]) -> NDArray[np.intp]:
        """Nodes, chosen one after the other, that reject most of the remaining points; `lost` (K, nodes) is of points that fail."""
        allowed = self.allowed + 1e-300
        shares = lost * self._weights / allowed
        reached, chosen = np.zeros(len(lost)), list[int]()
        for _ in range(self._few):
            gained = np.minimum(reached[:, None] + shares, 1.0 + 1e-9).sum(axis=0) - np.minimum(reached, 1.0 + 1e-9).sum()
            gained[chosen] = 0.0
            best = int(np.argmax(gained))
            if not gained[best] > 0:
                break
            chosen.append(best)
            reached += shares[:, best]
        return np.array(chosen, dtype=np.intp)

    def _on_nodes(self, points: Experiments, nodes: NDArray[np.intp]) -> tuple[IntArray, Array]:
        """Roughly, of points on some nodes."""
        assert self._theta is not None
        return self._at(points, self._theta[nodes], self._settings._replace(rtol=max(self._settings.rtol, ROUGH)))

    def _at(self, points: Experiments, parameters: Array, settings: Integration) -> tuple[IntArray, Array]:
        """Statuses (K, n), and until when each could be followed; infinite where none of `FATAL` ended it."""
        model, count, parts = self.model, len(parameters), []
        for some in self._clock.blocks("nodes", len(points), max(1, count)):
            own = points[some]
            given = (np.repeat(part, count, axis=0) for part in (own.x0, own.u, own.dt))
            theta = np.tile(parameters, (len(own), 1))
            _, _, *results = model.kernels.simulate(model.core, *given, theta, *settings)
            parts.append([np.asarray(one).reshape(len(own), count) for one in results])
        status, lasted = (np.concatenate(found) for found in zip(*parts, strict=True))
        return status, np.where(fatal(status), lasted, np.inf)


def fatal(status: IntArray) -> NDArray[np.bool_]:
    """Whether statuses are of `FATAL`."""
    return np.asarray(_IS_FATAL[status])


def lasting(points: Experiments, dt: Array) -> Experiments:
    """Return the points with other durations (K,)."""
    return Experiments(points.x0, points.u, dt, columns=points.columns)
