"""Points as the Fisher matrix takes them: standardised sensitivities, and what makes up their output covariances."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..basics.quantity import names_of
from ..basics.values import Array, IntArray
from ..points.broken_limits import refuse_failures
from ..points.experiments import Experiments
from ..points.points_or_runs import Points, joined
from ..points.predictive import PredictiveCovariance, covariance_over_nodes, linearized, nodes_of
from ..points.run_trajectories import checked_sensitivities
from ..points.runs import Runs
from ..points.settings import checked_arguments
from ..points.status import Status, only_finite
from ..prior.gaussian import GaussianPrior
from ..prior.rules import LinearizedRule, Rule
from .problem import DesignProblem
from .white_rows import white_rows

MOST_POINTS = 20_000
"""Points that the engine is given at once, so that memory stays bounded."""


@dataclass(frozen=True, eq=False)
class PointInformation:
    """K points, or the K samples of runs, as the Fisher matrix takes them.

    Attributes
    ----------
    points : Experiments or Runs
    sensitivity : ndarray, (K, n_y, n_unknowns)
        dy/dtheta times the prior std, and then by the nuisance parameters of the problem times theirs.
    covariance : ndarray, (K, n_y, n_y)
        Predictive covariances over the prior of the estimated parameters.
    assumed : ndarray, (K, n_y, n_y), or None
        What is drawn anew in each point adds to R; None where nothing is, and where the noise is not white: it is in the rows then.
    measured : ndarray of bool, (K, n_y), or None
        Which outputs are measured; None for all.
    elsewhere : tuple of PointInformation
        The same points where the parameters are others than the prior mean: at the scenarios of a criterion over the prior.
    """

    points: Points
    sensitivity: Array
    covariance: Array
    assumed: Array | None = None
    measured: NDArray[np.bool_] | None = None
    elsewhere: tuple[PointInformation, ...] = ()

    def __len__(self) -> int:
        return len(self.sensitivity)

    @property
    def experiments(self) -> Experiments:
        """The points, which are no runs."""
        if not isinstance(self.points, Experiments):
            raise TypeError(f"points: expected Experiments, given {type(self.points).__name__}")
        return self.points

    @property
    def everywhere(self) -> tuple[PointInformation, ...]:
        """The points at all scenarios; where there are none, at the prior mean."""
        return self.elsewhere or (self,)

    def __getitem__(self, rows: slice | Sequence[int] | NDArray[np.bool_] | NDArray[np.intp]) -> PointInformation:
        assumed = None if self.assumed is None else self.assumed[rows]
        measured = None if self.measured is None else self.measured[rows]
        elsewhere = tuple(one[rows] for one in self.elsewhere)
        return PointInformation(self.points[rows], self.sensitivity[rows], self.covariance[rows], assumed, measured, elsewhere)

    def of_outputs(self, used: NDArray[np.bool_]) -> PointInformation:
        if used.all():
            return self
        covariance = self.covariance[:, used][:, :, used]
        assumed = None if self.assumed is None else self.assumed[:, used][:, :, used]
        measured = None if self.measured is None else self.measured[:, used]
        return PointInformation(self.points, self.sensitivity[:, used], covariance, assumed, measured)

    @staticmethod
    def join(parts: Sequence[PointInformation]) -> PointInformation:
        """The points of all parts, which are of one problem, one after the other."""
        points = joined([part.points for part in parts])
        sensitivity = np.concatenate([part.sensitivity for part in parts])
        covariance = np.concatenate([part.covariance for part in parts])
        assumed = None
        if any(part.assumed is not None for part in parts):  # that of runs is in their sensitivities
            own = (np.zeros_like(part.covariance) if part.assumed is None else part.assumed for part in parts)
            assumed = np.concatenate(list(own))
        measured = None
        if any(part.measured is not None for part in parts):
            all_of = (np.ones(part.sensitivity.shape[:2], dtype=bool) if part.measured is None else part.measured for part in parts)
            measured = np.concatenate(list(all_of))
        elsewhere: tuple[PointInformation, ...] = ()
        if all(part.elsewhere for part in parts):
            elsewhere = tuple(PointInformation.join(ones) for ones in zip(*(part.elsewhere for part in parts), strict=True))
        return PointInformation(points, sensitivity, covariance, assumed, measured, elsewhere)


def point_sensitivities(problem: DesignProblem, points: Experiments, threads: int | None) -> tuple[PointInformation, IntArray]:
    """Standardised sensitivities at the prior mean, what is assumed, and statuses; the predictive covariances are left at zero.

    The points must be the problem's model's and off its switching surfaces: a search asks hundreds of times.
    """
    settings, assumed = problem.integration(threads), problem.assumed
    if assumed is None:
        result = checked_sensitivities(problem.limited, points, problem.theta, settings, outputs_alone=True)
    else:  # one run of the extended model has the tangents by the parameters too
        result = checked_sensitivities(assumed.model, points, assumed.theta(problem.theta), settings, outputs_alone=True)
    scaled = problem.standardised(result.dy_dtheta)
    n_y, status, share = scaled.shape[1], only_finite(result.status, scaled), None
    if not problem.white_alone:
        times, measured = np.zeros((len(points), 1)), np.broadcast_to(problem.measured, (len(points), 1, n_y))
        dy = result.dy_dtheta[:, None]
        rows, status = white_rows(problem, scaled[:, None], dy, times, result.y[:, None], measured, status)
        scaled = rows[:, 0]
    elif assumed is not None and assumed.columns:
        share = assumed.covariance(result.dy_dtheta)
        status = only_finite(status, share)
        if problem.assumed_covariance == "predictive" and not isinstance(problem.rule, LinearizedRule):
            share, over_nodes = assumed.predictive(points, problem.theta, problem.rule, settings)
            status = np.where(status != Status.ok, status, over_nodes)
    return PointInformation(points, scaled, np.zeros((len(points), n_y, n_y)), share), status


def with_covariance(problem: DesignProblem, given: PointInformation, threads: int | None) -> tuple[PointInformation, IntArray]:
    """Return the points with their predictive covariances, and the statuses over all nodes of the rule."""
    if isinstance(problem.rule, LinearizedRule):
        return with_linearized_covariance(problem, given)
    result = _over_nodes(problem, given.experiments, threads, True)
    return replace(given, covariance=result.covariance), result.status


def statuses_over_nodes(problem: DesignProblem, points: Experiments, threads: int | None) -> IntArray:
    """The statuses of `with_covariance` alone, of points that are ok at the prior mean."""
    if isinstance(problem.rule, LinearizedRule):
        return np.zeros(len(points), dtype=np.int32)
    return _over_nodes(problem, points, threads, False).status


def _over_nodes(problem: DesignProblem, points: Experiments, threads: int | None, nearest: bool) -> PredictiveCovariance:
    nodes = nodes_of(problem.rule, problem.prior, names_of(problem.model.parameters), problem.estimated)
    settings = problem.integration(threads)
    return covariance_over_nodes(problem.model, points, problem.theta, nodes, problem.rule, settings, nearest)


def with_linearized_covariance(problem: DesignProblem, given: PointInformation) -> tuple[PointInformation, IntArray]:
    """Return the points with S Sigma S^T, and statuses; S is their sensitivity, Sigma the prior's covariance by the rule."""
    moments = _second_moments(problem.rule, problem.prior, names_of(problem.model.parameters), problem.estimated)
    columns = problem.estimated_columns
    ok = np.zeros(len(given), dtype=np.int32)
    result = linearized(given.sensitivity[..., : len(columns)], moments[np.ix_(columns, columns)], ok)
    return replace(given, covariance=result.covariance), result.status


@lru_cache(maxsize=4)  # a search asks for the same hundreds of times
def _second_moments(rule: Rule, prior: GaussianPrior, names: tuple[str, ...], varied: tuple[str, ...]) -> Array:
    return rule.second_moments(prior.marginal(names), varied)  # priors are equal in whatever order; the names fix it


def point_information(problem: DesignProblem, points: Experiments, grid: bool, threads: int | None) -> PointInformation:
    """Information of given points; every one must be an experiment point.

    A sample in the instant of a jump that the outputs feel has no derivative: it counts no information, and a warning names it.

    Raises
    ------
    ValueError
        Where a trajectory, nominal or (with `grid`) over the prior, is not ok; the message names the points and reasons.
    """
    checked_arguments(problem.model, points, problem.theta, problem.rtol, threads, problem.kinks, problem.jumps, None)
    information, status = point_sensitivities(problem, points, threads)
    if (status == Status.on_jump).any():
        status = _without_derivatives(problem, points, status, threads)
    if grid and not status.any():
        information, status = with_covariance(problem, information, threads)
    refuse_failures(problem.limited, Runs.of_points(points), problem.theta, problem.integration(threads), status)
    return information


def _without_derivatives(problem: DesignProblem, points: Experiments, status: IntArray, threads: int | None) -> IntArray:
    """The statuses, where points that end on a jump need no derivative: they are ok if they have a trajectory."""
    model, rows = problem.limited, np.flatnonzero(status == Status.on_jump)
    given = points[rows]
    theta = np.tile(problem.theta, (len(rows), 1))
    _, _, ended, _ = model.kernels.simulate(model.core, given.x0, given.u, given.dt, theta, *problem.integration(threads))
    some = rows[ended == Status.ok]
    if len(some):
        listed = ", ".join(f"points[{k}]" for k in some[:5]) + (" ..." if len(some) > 5 else "")
        warnings.warn(f"points: expected samples beside jumps, given {listed} in the instant of one: no information", stacklevel=5)
    status = status.copy()
    status[rows] = ended
    return status
