"""How far runs keep from the limits of the model's domain, counted in what the prior makes of that distance.

A run that is fine with the parameters at the prior mean may break a limit on many of the plants that the prior allows. To first
order the value of a limit h along a run varies by the root of sum_j (h_x S_j + h_theta_j)^2 over the principal parts of the prior,
and of what is uncertain. A distance of fewer than `kappa` of these standard deviations costs, so that gradients lead away from the
limit. The share of the plants that can run a design is computed from its trajectories; this only shows where to go.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ...information.problem import DesignProblem
from ...information.run_tangents import RunTangents
from .tuning import RunSearchTuning


class RunMargins:
    """How far runs keep from limits of the domain."""

    def __init__(self, problem: DesignProblem, tuning: RunSearchTuning) -> None:
        self._tuning = tuning
        assumed = problem.assumed
        model = problem.limited if assumed is None else assumed.model
        self._model, self._poles, self.exist = model, len(model.poles), bool(model.domain)
        names = [quantity.name for quantity in problem.model.parameters]
        chosen = problem.prior.marginal(problem.estimated)
        factor = np.linalg.cholesky(chosen.covariance)
        size = len(names) if assumed is None else len(assumed.model.parameters)
        parts = np.zeros((len(problem.estimated), size))
        parts[:, problem.estimated_columns] = factor.T
        if assumed is not None:
            anew, std_anew = assumed.drawn
            columns, std = [*assumed.nuisance, *anew], np.append(assumed.nuisance_std, std_anew)
            further = np.zeros((len(columns), size))
            further[np.arange(len(columns)), columns] = std
            parts = np.concatenate([parts, further])
        self._parts = parts

    def distances(self, tangents: RunTangents, looks: NDArray[np.intp] | None = None) -> Array:
        """Distances of each run at the ends of segments `looks` (K, M) from each limit, (K, M, c), in standard deviations.

        Without them they are those of all segments, (K, N, c).
        """
        count, segments = tangents.runs.dt.shape if looks is None else looks.shape
        each = max(1, self._tuning.states_at_once // (segments * (1 + len(self._parts))))
        some = [slice(first, first + each) for first in range(0, count, each)]
        return np.concatenate([self._distances(tangents, one, None if looks is None else looks[one]) for one in some])

    def _distances(self, tangents: RunTangents, some: slice, looks: NDArray[np.intp] | None) -> Array:
        runs = tangents.runs[some]
        there = runs.dt > 0 if looks is None else np.ones(looks.shape, dtype=bool)
        x, theta = tangents.x[some, 1:], tangents.theta[some]
        k, place = np.nonzero(there)
        n = place if looks is None else looks[k, place]
        moves = tangents.dx[some][k, n] @ self._parts.T  # (S, n_x, q)
        q = len(self._parts)
        states = np.concatenate([x[k, n][None], x[k, n] + moves.transpose(2, 0, 1)])
        states = self._model.at(states, np.cumsum(runs.dt, axis=1)[k, n]).reshape((1 + q) * len(k), -1)
        inputs = np.tile(runs.u[k, n], (1 + q, 1))
        parameters = np.concatenate([theta[k][None], theta[k] + self._parts[:, None]]).reshape(-1, theta.shape[1])
        with np.errstate(all="ignore"):  # outside the domain there may be no number
            h = np.asarray(self._model.core.limits(states, inputs, parameters)).reshape(1 + q, len(k), -1)
            h[:, :, : self._poles] *= np.sign(h[:1, :, : self._poles])
            spread = np.linalg.norm(h[1:] - h[0], axis=0)
            spread = np.maximum(spread, self._tuning.least_spread * np.abs(h[0]).max(axis=0, initial=0.0)) + 1e-300
            near = h[0] / spread
        most = self._tuning.most_distance
        found = np.full((*there.shape, h.shape[2]), most)
        found[k, place] = np.where(np.isfinite(near), np.minimum(near, most), 0.0)
        return found


def costs_of(distances: Array, kappa: float, cost: float) -> Array:
    """What runs cost, (K,), at distances (K, ...) of fewer than kappa standard deviations, each of which has a `cost`."""
    return np.asarray(cost * np.square(np.maximum(0.0, kappa - distances)).reshape(len(distances), -1).sum(axis=1))
