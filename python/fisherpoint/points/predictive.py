"""Predictive covariances of experiment points: the spread of their outputs over the prior, by any rule."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.checks import check_names, check_type, some_names_among
from ..basics.quantity import names_of
from ..basics.values import Array, IntArray
from ..engine import _core
from ..models import Model
from ..prior.gaussian import GaussianPrior
from ..prior.rules import LinearizedRule, Rule
from ..show.numbers import counted
from .experiments import Experiments
from .natural_sizes import warn_of_small_states
from .run_trajectories import checked_sensitivities
from .settings import Integration, checked_arguments
from .status import Status, named, only_finite
from .trajectories import counted_statuses

ROUNDING = 1e-13
"""Share of what states of their natural sizes make of an output, below which its spread is rounding."""


class _CovarianceAndStatus(NamedTuple):
    covariance: Array
    status: IntArray


class PredictiveCovariance(_CovarianceAndStatus):
    """Predictive covariances, and how much of the rule they are; unpacks to `covariance, status`.

    Attributes
    ----------
    covariance : ndarray, (K, n_y, n_y)
        In squared output units; zero where the status is not ok.
    status : ndarray, (K,)
        `Status` values.
    projection : ndarray, (K,)
        Where a rule with negative weights gives a matrix that is not positive semidefinite, `covariance` is the nearest one that
        is; this is their distance as a share of the matrix (Frobenius norms, outputs scaled to unit variance). 0 elsewhere.
    lost_weight : ndarray, (K,)
        Share of the sum of |weights| of nodes whose trajectory is not ok; 1 where work ended at the first one.
    """

    projection: Array
    lost_weight: Array

    def __new__(cls, covariance: Array, status: IntArray, projection: Array, lost_weight: Array) -> PredictiveCovariance:
        self = super().__new__(cls, covariance, status)
        self.projection, self.lost_weight = projection, lost_weight
        return self

    @property
    def statuses(self) -> tuple[Status, ...]:
        """The statuses by their names, such as Status.met_jump."""
        return named(self.status)

    def __repr__(self) -> str:
        sizes = f"{counted(len(self.status), 'point')}, {counted(self.covariance.shape[-1], 'output')}"
        return f"PredictiveCovariance({sizes}; status: {counted_statuses(self.status)})"

    def __getnewargs__(self) -> tuple[Array, IntArray, Array, Array]:
        return (self.covariance, self.status, self.projection, self.lost_weight)


def predictive_covariance(
    model: Model,
    points: Experiments,
    prior: GaussianPrior,
    rule: Rule,
    *,
    rtol: float = 1e-6,
    threads: int | None = None,
    kinks: str = "cross",
    jumps: str = "cross",
    parameters: tuple[str, ...] | None = None,
    method: str | None = None,
) -> PredictiveCovariance:
    """Spread of the outputs over the prior, (14)-(16), around the output at the prior mean.

    The nodes of a tensor rule are worked through without storing them: memory does not grow with their number.

    Parameters
    ----------
    model, points, rtol, threads, kinks, jumps, method
        As in `simulate`.
    prior : GaussianPrior
    rule : TensorGrid, GaussHermite, SparseGaussHermite, Sobol, Unscented or LinearizedRule
    parameters : tuple of str, optional
        Parameters that vary; the others stay at their mean. Default: all.

    Returns
    -------
    PredictiveCovariance
        A point whose trajectory at the mean is not ok carries its status. Under `TensorGrid` a point with any node that is not ok
        carries the status of the first such node; under another rule only where these nodes have more than
        `rule.max_lost_weight` of the absolute weight. Up to that they are left out of the sum.

    Raises
    ------
    TypeError, ValueError
        As `simulate`; and where the rule does not fit the prior.
    """
    check_type(model, Model, "model")
    check_type(prior, GaussianPrior, "prior")
    check_type(points, Experiments, "points")
    if not isinstance(rule, Rule):
        raise TypeError(f"rule: expected a rule such as fisherpoint.SparseGaussHermite(2), given {type(rule).__name__}")
    names = names_of(model.parameters)
    check_names(prior.names, names, "prior")
    varied = some_names_among(names if parameters is None else parameters, names, "parameters")
    theta = model.theta({name: prior.mean[name] for name in names})
    if isinstance(rule, LinearizedRule):
        arguments = checked_arguments(model, points, theta, rtol, threads, kinks, jumps, method)
        result = checked_sensitivities(model, points, theta, arguments, outputs_alone=True)
        warn_of_small_states(model, "the trajectories keep", points.x0, result.x)
        ordered = prior.marginal(names)
        with np.errstate(over="ignore"):  # what overflows is given a status
            scaled = result.dy_dtheta * np.array(list(ordered.std.values()))
        return linearized(scaled, rule.second_moments(ordered, varied), result.status)
    if model.updates or model.late_outputs:
        what = "updates" if model.updates else "late outputs"
        raise ValueError(f"rule: expected LinearizedRule() for a model with {what}, given {type(rule).__name__}")
    nodes = nodes_of(rule, prior, names, varied)
    settings = checked_arguments(model, points, theta, rtol, threads, kinks, jumps, method)
    warn_of_small_states(model, "the starts keep", points.x0)
    return covariance_over_nodes(model, points, theta, nodes, rule, settings)


def covariance_over_nodes(
    model: Model,
    points: Experiments,
    theta: Array,
    nodes: _core.PriorNodes,
    rule: Rule,
    settings: Integration,
    nearest: bool = True,
) -> PredictiveCovariance:
    """As `predictive_covariance`, of checked arguments; with `nearest` it is semidefinite in any case."""
    covariance, status, *_, lost_weight = model.kernels.predictive_covariance(
        model.core, points.x0, points.u, points.dt, theta, nodes, *settings, max_lost=rule.max_lost_weight
    )
    status, projection = only_finite(status, covariance), np.zeros(len(points))
    if rule.signed and nearest:
        covariance, projection = nearest_semidefinite(
            covariance, lambda rows: rounding_of_outputs(model, points[rows], theta, settings)
        )
    return PredictiveCovariance(covariance, status, projection, lost_weight)


@lru_cache(maxsize=4)  # a search asks for the same nodes hundreds of times
def nodes_of(rule: Rule, prior: GaussianPrior, names: tuple[str, ...], varied: tuple[str, ...]) -> _core.PriorNodes:
    return rule.core_nodes(prior.marginal(names), varied)  # priors are equal in whatever order; the names fix it


def linearized(sensitivity: Array, correlation: Array, status: IntArray) -> PredictiveCovariance:
    """S Sigma S^T of sensitivities (K, n_y, p) times the prior std, with the correlation (p, p) of the parameters."""
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is given a status
        covariance = sensitivity @ correlation @ sensitivity.transpose(0, 2, 1)
        covariance = (covariance + covariance.transpose(0, 2, 1)) / 2
    status = only_finite(status, covariance)
    failed = status != Status.ok
    covariance[failed] = 0.0
    return PredictiveCovariance(covariance, status, np.zeros(len(status)), failed.astype(np.float64))


def rounding_of_outputs(model: Model, points: Experiments, theta: Array, settings: Integration) -> Array:
    """Spread of every output (K, n_y) that may be rounding of the states, by what their natural sizes make of it at the start."""
    scales = np.array([1.0 if quantity.scale is None else quantity.scale for quantity in model.states])
    moved = points.x0 + np.vstack([np.zeros_like(scales), np.diag(scales)])[:, None]  # (1 + n_x, K, n_x)
    count, k, n_x = moved.shape
    u, dt = np.tile(points.u, (count, 1)), np.zeros(count * k)
    _, y, *_ = model.kernels.simulate(model.core, moved.reshape(count * k, n_x), u, dt, theta, *settings)
    y = y.reshape(count, k, -1)
    return np.asarray(ROUNDING * np.nan_to_num(np.abs(y[1:] - y[0]), posinf=0.0).sum(axis=0))


def nearest_semidefinite(covariance: Array, rounding_of: Callable[[NDArray[np.intp]], Array] | None = None) -> tuple[Array, Array]:
    """Return the nearest positive semidefinite matrices, and how far they are from the given (K, n, n).

    Distances are Frobenius norms where the outputs are scaled to unit diagonal, as shares of the given matrix' norm. Matrices whose
    negative eigenvalues are rounding are returned as they are. `rounding_of` some matrices (R,) returns which standard deviations
    of their outputs (R, n) are rounding: these have no spread, as scaled to unit diagonal they would spoil the others.
    """
    covariance = covariance.copy()
    rows = _not_semidefinite(covariance, np.arange(len(covariance)))
    if len(rows) and rounding_of is not None:
        spread = np.abs(np.diagonal(covariance[rows], axis1=1, axis2=2)) > rounding_of(rows) ** 2
        covariance[rows] *= spread[:, :, None] & spread[:, None, :]
        rows = _not_semidefinite(covariance, rows)
    size = np.zeros(len(covariance))
    if len(rows):
        values, vectors, diagonal, scales = _scaled_eigenvalues(covariance[rows])
        nearest = (vectors * np.maximum(values, 0.0)[:, None, :]) @ vectors.transpose(0, 2, 1)
        nearest *= (diagonal > 0)[:, :, None] & (diagonal > 0)[:, None, :]  # an output without spread keeps none
        covariance[rows] = (nearest + nearest.transpose(0, 2, 1)) / 2 * scales
        size[rows] = np.linalg.norm(np.minimum(values, 0.0), axis=1) / np.linalg.norm(values, axis=1)
    return covariance, size


def _not_semidefinite(covariance: Array, rows: NDArray[np.intp]) -> NDArray[np.intp]:
    """Which of these rows have a negative eigenvalue that is not rounding."""
    values = _scaled_eigenvalues(covariance[rows])[0]
    rounding = 16 * np.finfo(np.float64).eps * covariance.shape[1]
    return np.asarray(rows[values.min(axis=1, initial=0.0) < -rounding * np.abs(values).max(axis=1, initial=0.0)])


def _scaled_eigenvalues(covariance: Array) -> tuple[Array, Array, Array, Array]:
    """Eigenvalues and eigenvectors with the outputs scaled to unit diagonal, that diagonal, and what entries were divided by."""
    diagonal = np.abs(np.diagonal(covariance, axis1=1, axis2=2))
    scale = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    scales = scale[:, :, None] * scale[:, None, :]
    values, vectors = np.linalg.eigh(covariance / scales)
    return values, vectors, diagonal, scales
