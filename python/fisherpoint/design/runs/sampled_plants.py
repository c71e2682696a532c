"""Plants that the prior allows, on which runs are tried during the search, and which show the spread of outputs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ...information.draws import drawn_plants
from ...information.problem import DesignProblem
from ...points.run_trajectories import checked_run_trajectories
from ...points.runs import Runs
from ...points.settings import Integration
from ...points.status import Status


class RunPlants:
    """Plants drawn from the prior, and from what is uncertain; each has one deviation of what is drawn anew in each run.

    Parameters
    ----------
    problem : DesignProblem
    count : int
    rng : numpy.random.Generator
    settings : Integration
        Of the trajectories.
    """

    def __init__(self, problem: DesignProblem, count: int, rng: np.random.Generator, settings: Integration) -> None:
        self._theta, _ = drawn_plants(problem, count, rng)
        assumed = problem.assumed
        self._model, self._settings = problem.limited if assumed is None else assumed.model, settings
        columns, std = ([], np.empty(0)) if assumed is None else assumed.drawn
        if columns:
            self._theta[:, columns] += std * rng.standard_normal((count, len(columns)))

    def __len__(self) -> int:
        return len(self._theta)

    def can_run(self, runs: Runs, some: slice = slice(None)) -> NDArray[np.bool_]:
        """Which of some plants (R,) reach the ends of all runs."""
        return np.asarray(self.outputs(runs, some)[1].all(axis=1))

    def outputs(self, runs: Runs, some: slice = slice(None)) -> tuple[Array, NDArray[np.bool_]]:
        """Outputs (R, K, N, n_y) of runs on some plants, and which runs reach their ends (R, K)."""
        plants = self._theta[some]
        many = runs[np.tile(np.arange(len(runs)), len(plants))]
        theta = np.repeat(plants, len(runs), axis=0)
        done = checked_run_trajectories(self._model, many, theta, self._settings)
        y, status = done.y, done.status
        near = np.flatnonzero(status == Status.grazes_jump)
        if len(near):
            again = checked_run_trajectories(self._model, many[near], theta[near], self._settings.finer())
            y[near], status[near] = again.y, again.status
        shape = len(plants), len(runs)
        return y.reshape(*shape, *y.shape[1:]), status.reshape(shape) == Status.ok
