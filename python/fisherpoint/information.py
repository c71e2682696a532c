"""Points as the Fisher matrix takes them: standardised sensitivities and predictive covariances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .experiments import Experiments
from .predictive import covariance_over_nodes, linearized, nodes_of
from .prior import GaussianPrior
from .problem import DesignProblem
from .quantity import Array, IntArray, names_of
from .rules import Linearized, Rule
from .trajectories import Settings, Status, check_kinks, checked_arguments, checked_sensitivities, resolve_threads


@dataclass(frozen=True, eq=False)
class PointInformation:
    """K points with dy/dtheta times the prior std, (K, n_y, p), and predictive covariances, (K, n_y, n_y)."""

    points: Experiments
    sensitivity: Array
    covariance: Array

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, rows: slice | Sequence[int] | NDArray[np.bool_] | NDArray[np.intp]) -> PointInformation:
        return PointInformation(self.points[rows], self.sensitivity[rows], self.covariance[rows])

    def of_outputs(self, used: NDArray[np.bool_]) -> PointInformation:
        if used.all():
            return self
        return PointInformation(self.points, self.sensitivity[:, used], self.covariance[:, used][:, :, used])

    @staticmethod
    def join(parts: Sequence[PointInformation]) -> PointInformation:
        points = Experiments.join([part.points for part in parts])
        return PointInformation(
            points, np.concatenate([part.sensitivity for part in parts]), np.concatenate([part.covariance for part in parts])
        )


def point_sensitivities(problem: DesignProblem, points: Experiments, threads: int | None) -> tuple[PointInformation, IntArray]:
    """Standardised sensitivities at the prior mean, and statuses; the predictive covariances are left at zero.

    The points must be the problem's model's and off its switching surfaces: a search asks hundreds of times.
    """
    result = checked_sensitivities(problem.model, points, problem.theta, _settings(problem, threads))
    scaled = np.ascontiguousarray(result.dy_dtheta[:, :, problem.estimated_columns] * problem.std)
    n_y = scaled.shape[1]
    return PointInformation(points, scaled, np.zeros((len(points), n_y, n_y))), result.status


def _settings(problem: DesignProblem, threads: int | None) -> Settings:
    return float(problem.rtol), check_kinks(problem.kinks), "fastest", resolve_threads(threads)


def with_covariance(problem: DesignProblem, given: PointInformation, threads: int | None) -> tuple[PointInformation, IntArray]:
    """The same points with their predictive covariances, and the statuses over all nodes of the rule."""
    if isinstance(problem.rule, Linearized):
        return with_linearized_covariance(problem, given), np.zeros(len(given), dtype=np.int32)
    nodes = nodes_of(problem.rule, problem.prior, names_of(problem.model.parameters), problem.estimated)
    settings = _settings(problem, threads)
    result = covariance_over_nodes(problem.model, given.points, problem.theta, nodes, problem.rule, settings)
    return PointInformation(given.points, given.sensitivity, result.covariance), result.status


def with_linearized_covariance(problem: DesignProblem, given: PointInformation) -> PointInformation:
    """The same points with S Sigma S^T of the sensitivities that they have; Sigma is what the rule makes of the prior's."""
    moments = _second_moments(problem.rule, problem.prior.marginal(names_of(problem.model.parameters)), problem.estimated)
    columns = problem.estimated_columns
    ok = np.zeros(len(given), dtype=np.int32)
    covariance = linearized(given.sensitivity, moments[np.ix_(columns, columns)], ok).covariance
    return PointInformation(given.points, given.sensitivity, covariance)


@lru_cache(maxsize=4)  # a search asks for the same hundreds of times
def _second_moments(rule: Rule, prior: GaussianPrior, varied: tuple[str, ...]) -> Array:
    return rule.second_moments(prior, varied)


def point_information(problem: DesignProblem, points: Experiments, grid: bool, threads: int | None) -> PointInformation:
    """Information of given points; every one must be an experiment point.

    Raises
    ------
    ValueError
        Where a trajectory, nominal or (with `grid`) over the prior, is not ok; the message names the points and reasons.
    """
    checked_arguments(problem.model, points, problem.theta, problem.rtol, threads, problem.kinks, None)
    information, status = point_sensitivities(problem, points, threads)
    if grid and not status.any():
        information, status = with_covariance(problem, information, threads)
    bad = np.flatnonzero(status)
    if len(bad):
        first = Status(status[bad[0]])
        listed = ", ".join(f"points[{k}] ({Status(status[k]).name})" for k in bad[:5])
        raise ValueError(
            f"points: expected trajectories that are ok, given {listed}{' ...' if len(bad) > 5 else ''}. {first.advice}"
        )
    return information
