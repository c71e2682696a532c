"""The longest durations at which points can be run at the prior mean and on some nodes of a rule."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array
from ..models import Model
from ..points.experiments import Experiments
from ..points.settings import Settings

FIRST = np.array([1e-9, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 0.95, 0.99, 0.998, 1.0])
"""Shares of the way from the shortest duration to that of a point, at which all nodes are asked; many points fail by little."""

SECOND = np.arange(12) / 12
"""Shares of the way between two of these, at which the nodes are asked that fail on it."""


def longest(
    model: Model,
    points: Experiments,
    shortest: float,
    theta: Array,
    weights: Array,
    allowed: float,
    asked: NDArray[np.bool_],
    settings: Settings,
) -> tuple[Array, NDArray[np.bool_]]:
    """The longest dt (K,) that are found of points (K,), none longer than the given ones, and for which there is one.

    What a trajectory meets by some time it meets by any later one. A run of short segments tells in one piece how far it gets.

    Parameters
    ----------
    model : Model
    points : Experiments
    shortest : float
        dt that is tried first.
    theta, weights : ndarray, (m, p) and (m,)
        Parameters with which they are run, and the weight of each.
    allowed : float
        What those that are lost may weigh.
    asked : ndarray of bool, (K, m)
        The others are known to get to the end.
    settings : Settings
        Of the trajectories.
    """
    way, core, kernels = (points.dt - shortest)[:, None], model.core, model.kernels

    def reached(shares: Array, asked: NDArray[np.bool_]) -> NDArray[np.int64]:
        """How many of the shares (K, G) of the way each node gets to, (K, m); all of those that are not asked."""
        result = np.full(asked.shape, shares.shape[1], dtype=np.int64)
        k, m = np.nonzero(asked)
        if len(k):
            dt = np.diff(shortest + way * shares, axis=1, prepend=0.0)[k]
            u = np.repeat(points.u[k][:, None], dt.shape[1], axis=1)
            _, _, result[k, m] = kernels.simulate_runs(core, points.x0[k], u, dt, theta[m], *settings)
        return result

    def last(count: NDArray[np.int64], most: int) -> NDArray[np.intp]:
        """The last of the shares that enough nodes get to, -1 for none."""
        lost = np.where(count[:, :, None] <= np.arange(most), weights[:, None], 0.0).sum(axis=1)
        return np.asarray((lost <= allowed).sum(axis=1) - 1)

    first = reached(np.broadcast_to(FIRST, (len(points), len(FIRST))), asked)
    place = last(first, len(FIRST))
    low, high = FIRST[np.maximum(place, 0)], FIRST[np.minimum(place + 1, len(FIRST) - 1)]
    shares = low[:, None] + np.outer(high - low, SECOND)
    failing = place[:, None] + 1
    second = reached(shares, first == failing)
    second[first < failing] = 0
    share = np.take_along_axis(shares, np.maximum(last(second, len(SECOND)), 0)[:, None], axis=1)
    return np.minimum(shortest + (way * share)[:, 0], points.dt), place >= 0
