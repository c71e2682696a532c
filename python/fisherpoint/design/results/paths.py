"""Where points go: their states and outputs on the way."""

from __future__ import annotations

import numpy as np

from ...basics.values import Array
from ...information.problem import DesignProblem
from ...points.experiments import Experiments
from ...points.runs import Runs
from ...points.simulate import simulate

FRACTIONS = np.unique(np.concatenate([[1e-6], np.geomspace(1e-4, 1.0, 17), np.linspace(0.0, 1.0, 41)[1:]]))
"""Fractions of a duration at which trajectories are drawn: what is fast at the start is seen beside what is slow."""


def paths_of(problem: DesignProblem, points: Experiments, fractions: Array, theta: Array) -> tuple[Array, Array]:
    """States (K, N, T, n_x) and outputs (K, N, T, n_y) of every point for N theta at T fractions of dt, in one call.

    A trajectory that does not reach a fraction is NaN from there on.
    """
    nodes, times = len(theta), len(fractions)
    batch, each = points[np.repeat(np.arange(len(points)), nodes)], np.tile(theta, (len(points), 1))
    if not problem.model.states:
        y = simulate(problem.model, batch, each).y.reshape(len(points), nodes, 1, -1)
        return np.empty((len(points), nodes, times, 0)), np.repeat(y, times, axis=2)
    done = simulate(problem.model, Runs.of_points(batch).divided(fractions), each)
    missed = (np.arange(times) >= done.reached[:, None])[..., None]
    shape = (len(points), nodes, times, -1)
    return np.where(missed, np.nan, done.x[:, 1:]).reshape(shape), np.where(missed, np.nan, done.y).reshape(shape)
