"""Few nodes of a rule that tell most of the points that the prior cannot run.

Most points that a search would like to have are not valid on all nodes of its rule, and mostly on the same few nodes. So these are
asked first, which costs a tenth of all nodes. What they let pass is tried on all. Plants that every point has to run on are among
the nodes, each with a weight that is not to be lost.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..basics.quantity import names_of
from ..basics.values import Array, IntArray
from ..engine.levels import kernels
from ..points.experiments import Experiments
from ..points.predictive import nodes_of
from ..points.settings import Settings
from ..points.status import Status
from ..prior.rules import Linearized
from .problem import DesignProblem

FATAL = (Status.left_domain, Status.met_jump, Status.not_finite)
"""What makes a node lost however its trajectory is computed."""

FEW, MOST = 12, 1000
"""Nodes that are asked, and those of a rule up to which it is worth to look for them."""

AT_FIRST = 4
"""Of these that are asked before the others, as they tell most."""

LEARNT, AGAIN = 200, 4
"""Failed points of which the nodes are found, and the growth of their number after which they are looked for again."""

LOSS = 1.001
"""Times the allowed loss, at which a point has failed."""


class NodeSieve:
    """Which nodes of a problem's rule fail first.

    Parameters
    ----------
    problem : DesignProblem
    settings : Settings
        Of the trajectories.
    plants : ndarray, (m, p), optional
        Parameters of `problem.assumed.model`, if there is one, with which all points have to be ok.
    """

    def __init__(self, problem: DesignProblem, settings: Settings, plants: Array | None = None) -> None:
        self._problem, self._settings, rule = problem, settings, problem.rule
        self.allowed = LOSS * rule.max_lost_weight
        """What the nodes that are lost may weigh."""
        self.model, self._assumed = problem.model, None
        if plants is not None:
            self._assumed = problem.assumed
            self.model = problem.limited if self._assumed is None else self._assumed.model
        self._few, self._plants = FEW if plants is None else 2 * FEW, plants
        self._failed: list[Array] = []
        self._told = np.empty((0, len(names_of(problem.model.axes))))
        self._next, self._chosen = LEARNT, np.empty(0, dtype=np.intp)
        self._theta: Array | None = None
        self._weights = np.empty(0)
        if problem.model.kernels is not kernels:
            return
        if not isinstance(rule, Linearized) and rule.size(problem.prior) <= MOST:
            theta, weights = nodes_of(rule, problem.prior, names_of(problem.model.parameters), problem.estimated).nodes()
            if len(theta) > 2 * FEW:
                self._theta, self._weights = self.at(theta), np.abs(weights) / np.abs(weights).sum()
        if plants is not None:
            self._theta = plants if self._theta is None else np.concatenate([self._theta, plants])
            self._weights = np.append(self._weights, np.ones(len(plants)))

    def at(self, theta: Array) -> Array:
        """Parameters (m, p) of the problem's model as those of `model`."""
        return theta if self._assumed is None else self._assumed.theta(theta)

    @property
    def plants(self) -> Array:
        """Those on which every point has to be ok, (m, p); none where they are not asked."""
        return np.empty((0, len(self.model.parameters))) if self._plants is None else self._plants

    def on_plants(self, points: Experiments) -> IntArray:
        """Ok where all plants let a point (K,) pass, else the status of one on which it fails."""
        status, _ = self._at(points, self.plants)
        lost = np.isin(status, FATAL)
        return np.where(lost.any(axis=1), status[np.arange(len(points)), np.argmax(lost, axis=1)], np.int32(Status.ok))

    def lasted_on_plants(self, points: Experiments) -> Array:
        """Until when each point (K,) can be followed on all plants (K, m); infinite where that is its end."""
        return _until(*self._at(points, self.plants))

    def statuses(self, points: Experiments) -> IntArray:
        """Ok where the few nodes let a point (K,) pass, else the status of a node on which it fails."""
        result, weighs = np.zeros(len(points), dtype=np.int32), np.zeros(len(points))
        for some in (self._chosen[:AT_FIRST], self._chosen[AT_FIRST:]):
            left = np.flatnonzero(result == Status.ok)
            if len(some) and len(left):
                status, _ = self._on_nodes(points[left], some)
                lost = np.isin(status, FATAL)
                weighs[left] += lost @ self._weights[some]
                failed = weighs[left] > self.allowed
                result[left[failed]] = status[failed, np.argmax(lost[failed], axis=1)]
        return result

    def statuses_and_lasted(self, points: Experiments) -> tuple[IntArray, Array]:
        """The same, and until when each point can be followed on the few nodes (K, m); infinite where that is its end."""
        result = np.zeros(len(points), dtype=np.int32)
        if not len(self._chosen) or not len(points):
            return result, np.zeros((len(points), len(self._chosen)))
        status, lasted = self._on_nodes(points, self._chosen)
        lost = np.isin(status, FATAL)
        failed = lost @ self._weights[self._chosen] > self.allowed
        result[failed] = status[failed, np.argmax(lost[failed], axis=1)]
        return result, _until(status, lasted)

    @property
    def weights(self) -> Array:
        """Of the few nodes (m,), none as long as nothing is known of them."""
        return self._weights[self._chosen]

    def learn(self, failed: Experiments) -> None:
        """Take in points that all nodes have told to be none."""
        if self._theta is None or not len(failed):
            return
        self._failed.append(failed.table)
        count = sum(map(len, self._failed))
        if count < self._next:
            return
        self._next = AGAIN * count
        # What fails now has passed the nodes that were chosen before, and the others would pass without these.
        self._told = np.concatenate([self._told, np.concatenate(self._failed)[-LEARNT:]])
        points = Experiments.of_table(self._problem.model, self._told)
        self._chosen = self._fewest(np.isin(self._on_nodes(points, np.arange(len(self._theta)))[0], FATAL))

    def _fewest(self, lost: NDArray[np.bool_]) -> NDArray[np.intp]:
        """Nodes, one after the other, that tell most of the points that are left; of points (K, nodes) that fail."""
        allowed = self.allowed + 1e-300
        shares = lost * self._weights / allowed
        told, chosen = np.zeros(len(lost)), list[int]()
        for _ in range(self._few):
            gained = np.minimum(told[:, None] + shares, 1.0 + 1e-9).sum(axis=0) - np.minimum(told, 1.0 + 1e-9).sum()
            gained[chosen] = 0.0
            best = int(np.argmax(gained))
            if not gained[best] > 0:
                break
            chosen.append(best)
            told += shares[:, best]
        return np.array(chosen, dtype=np.intp)

    def _on_nodes(self, points: Experiments, nodes: NDArray[np.intp]) -> tuple[IntArray, Array]:
        """Of points on some nodes."""
        assert self._theta is not None
        return self._at(points, self._theta[nodes])

    def _at(self, points: Experiments, parameters: Array) -> tuple[IntArray, Array]:
        """Statuses (K, n), and until when each could be followed."""
        model, count = self.model, len(parameters)
        rows = np.repeat(np.arange(len(points)), count)
        theta = np.tile(parameters, (len(points), 1))
        _, _, *told = model.kernels.simulate(model.core, points.x0[rows], points.u[rows], points.dt[rows], theta, *self._settings)
        status, lasted = (np.asarray(one).reshape(len(points), count) for one in told)
        return status, lasted


def _until(status: IntArray, lasted: Array) -> Array:
    return np.where(status == Status.ok, np.inf, lasted)
