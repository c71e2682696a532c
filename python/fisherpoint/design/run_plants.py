"""Plants that the prior allows, on which a design of runs is tried."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..basics.quantity import names_of
from ..basics.values import Array
from ..information.problem import DesignProblem
from ..points.run_trajectories import checked_run_trajectories
from ..points.runs import Runs
from ..points.settings import Settings
from ..points.status import Status
from ..prior.coordinates import cholesky_coordinates


class RunPlants:
    """Plants drawn from the prior, and from what is uncertain.

    Parameters
    ----------
    problem : DesignProblem
    count : int
    rng : numpy.random.Generator
    settings : Settings
        Of the trajectories.
    """

    def __init__(self, problem: DesignProblem, count: int, rng: np.random.Generator, settings: Settings) -> None:
        names, assumed = names_of(problem.model.parameters), problem.assumed
        coordinates = cholesky_coordinates(problem.prior, problem.estimated)
        columns = [problem.prior.names.index(name) for name in names]
        theta = coordinates.theta(rng.standard_normal((2 * count, len(names))))[:, columns]
        kept = theta[_sensible(problem, theta)][:count]
        self._model = problem.model
        if assumed is not None:
            kept = assumed.theta(kept)
            kept[:, assumed.columns] += assumed.std * rng.standard_normal((len(kept), len(assumed.columns)))
            self._model = assumed.model
        self._theta, self._settings = kept, settings

    def __len__(self) -> int:
        return len(self._theta)

    def can_run(self, runs: Runs) -> NDArray[np.bool_]:
        """Which plants (R,) reach the ends of all runs."""
        return np.asarray(self.outputs(runs)[1].all(axis=1))

    def outputs(self, runs: Runs) -> tuple[Array, NDArray[np.bool_]]:
        """Outputs (R, K, N, n_y) of runs on every plant, and which runs reach their ends (R, K)."""
        many = runs[np.tile(np.arange(len(runs)), len(self))]
        done = checked_run_trajectories(self._model, many, np.repeat(self._theta, len(runs), axis=0), self._settings)
        shape = len(self), len(runs)
        return done.y.reshape(*shape, *done.y.shape[1:]), done.status.reshape(shape) == Status.ok


def _sensible(problem: DesignProblem, theta: Array) -> Array:
    least = [problem.model.least.get(name, -np.inf) for name in names_of(problem.model.parameters)]
    return np.asarray((theta > np.array(least)).all(axis=1))
