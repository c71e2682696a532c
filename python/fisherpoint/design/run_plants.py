"""Plants that the prior allows, on which a design of runs is tried."""

from __future__ import annotations

import numpy as np

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

    def share(self, runs: Runs) -> float:
        """The share of plants on which all runs reach their ends."""
        many = runs[np.repeat(np.arange(len(runs)), len(self))]
        done = checked_run_trajectories(self._model, many, np.tile(self._theta, (len(runs), 1)), self._settings)
        return float((done.status.reshape(len(runs), -1) == Status.ok).all(axis=0).mean())


def _sensible(problem: DesignProblem, theta: Array) -> Array:
    least = [problem.model.least.get(name, -np.inf) for name in names_of(problem.model.parameters)]
    return np.asarray((theta > np.array(least)).all(axis=1))
