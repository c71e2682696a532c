"""Residuals in units of the noise: whitened by its covariance, and by what moves all samples of a run at once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..basics.messages import listed
from ..basics.quantity import names_of
from ..basics.values import Array
from ..data.measurements import Measurements
from ..information.assumed import Assumed
from ..information.run_tangents import moves_of_runs
from ..models import Model
from ..noise.common_error import CommonError
from ..noise.models import NoiseOf, checked_noise, white_alone
from ..points.settings import Integration
from ..points.status import Status
from .least_squares import Accuracy
from .observed import Observed
from .unknowns import Unknowns


@dataclass(frozen=True, eq=False)
class RunError:
    """The common error of one run.

    Attributes
    ----------
    first : int
        Number of the run's first sample among all.
    moved : ndarray, (n, n_y, q)
        By how much its n samples move with a standard deviation of each cause, in units of the noise; zero where not measured.
    """

    first: int
    moved: Array

    @property
    def rows(self) -> slice:
        return slice(self.first, self.first + len(self.moved))

    @cached_property
    def _common(self) -> CommonError:
        return CommonError.of(self.moved.reshape(-1, self.moved.shape[2]))

    @property
    def variances(self) -> Array:
        """Variances of the samples in units of those of the noise, (n, n_y)."""
        return self._common.variances.reshape(self.moved.shape[:2])

    def whitened(self, rows: Array) -> Array:
        """Whiten rows (B, n, n_y, ...), in units of the noise: multiply by R_k^-1/2."""
        white = self._common.whitened(rows.reshape(len(rows), -1, int(np.prod(rows.shape[3:]))))
        return white.reshape(rows.shape)


def run_errors(
    assumed: Assumed, data: Measurements, theta: Array, settings: Integration, std: Array, first: int = 0
) -> Iterator[RunError]:
    """The errors of measured runs, whose first sample has the number `first`; std (n_y,) is that of the noise.

    Raises
    ------
    ValueError
        Where a trajectory is not ok.
    """
    runs = data.runs
    moved, status = moves_of_runs(assumed, runs, theta, settings)
    if status.any():
        k = int(np.argmax(status != Status.ok))
        raise ValueError(f"runs: expected trajectories that are ok, given runs[{k}] ({Status(status[k]).name})")
    moved = np.where(np.isfinite(data.run_outputs)[..., None], moved / std[:, None], 0.0)
    for of_run, there in zip(moved, runs.measured, strict=True):
        yield RunError(first, of_run[there])
        first += int(there.sum())


def whiten(covariance: Array, measured: NDArray[np.bool_], *arrays: Array) -> list[Array]:
    """Return L^-1 a for each array a (B, N, n_y, ...), where L L^T is the covariance of the outputs that were measured.

    Parameters
    ----------
    covariance : ndarray, broadcastable to (B, N, n_y, n_y)
        Of every sample.
    measured : ndarray of bool, (N, n_y)
        Rows of outputs that were not are zero in the result.
    """
    n_y = covariance.shape[-1]
    if not np.any(covariance * (1 - np.eye(n_y))):
        std = np.sqrt(np.einsum("...ii->...i", covariance))
        weight = np.where(measured, 1 / np.where(measured, std, 1.0), 0.0)
        return [np.where(_spread(measured, a), a, 0.0) * _spread(weight, a) for a in arrays]
    both = measured[:, :, None] & measured[:, None, :]
    factor = np.linalg.cholesky(np.where(both, covariance, np.eye(n_y)))
    results: list[Array] = []
    for a in arrays:
        rows = np.where(_spread(measured, a), a, 0.0).reshape(*a.shape[:3], -1)
        results.append(np.asarray(np.linalg.solve(factor, rows)).reshape(a.shape))
    return results


def _spread(given: NDArray[Any], like: Array) -> NDArray[Any]:
    """`given` (..., N, n_y) with the trailing axes that `like` (B, N, n_y, ...) has after these."""
    return given.reshape(*given.shape, *(1,) * (like.ndim - 3))


def noise_covariance(model: Model, noise: NoiseOf) -> Array:
    """R (n_y, n_y) of the noise, 1 of an output that is not named: it is not measured."""
    names = names_of(model.outputs)
    stds = white_alone(checked_noise(noise, names), "noise", "of fits")
    if not stds:
        raise ValueError(f"noise: expected at least one of {listed(names)}; given none")
    return np.diag([stds.get(name, 1.0) ** 2 for name in names])


@dataclass(frozen=True, eq=False)
class WeightedResiduals:
    """Residuals of B problems that share points and unknowns, each with data of its own, as `least_squares.minimise` takes them.

    Attributes
    ----------
    observed : Observed
    unknowns : Unknowns
    y : ndarray, (1 or B, N, n_y)
        Data; NaN, the same for all problems, where not measured.
    covariance : ndarray, broadcastable to (B, N, n_y, n_y)
        Of the noise of every sample.
    prior_factor : ndarray, (P, P), or None
        L^-1 of the prior's covariance L L^T in coordinates z, for residuals L^-1 z that are added: the maximum a posteriori.
    common : tuple of RunError
        Of runs, what moves all samples of one; the covariance of these samples is R alone.
    """

    observed: Observed
    unknowns: Unknowns
    y: Array
    covariance: Array
    prior_factor: Array | None = None
    common: tuple[RunError, ...] = ()

    @property
    def measured(self) -> NDArray[np.bool_]:
        measured: NDArray[np.bool_] = np.isfinite(self.y[0])
        return measured

    @property
    def variances(self) -> Array:
        """Variances of the noise of every output, (..., n_y), with what is common to runs."""
        variances = np.einsum("...ii->...i", self.covariance)
        if self.common:
            variances = np.broadcast_to(variances, self.measured.shape).copy()
            for error in self.common:
                variances[error.rows] *= error.variances
        return np.asarray(variances)

    @property
    def accuracy(self) -> Accuracy:
        """Accuracy of the residuals in units of the noise: rounding, or the trajectories' tolerance, is a share of the outputs.

        It has that of the unknowns too: one that is many standard errors from zero has few digits for these.
        """
        share = self.observed.precision * np.nan_to_num(self.y) / np.sqrt(np.einsum("...ii->...i", self.covariance))
        return Accuracy(np.asarray(np.sqrt(np.square(share).sum(axis=(1, 2)))), self.observed.precision, self.unknowns.spacing)

    def prior_square(self, z: Array) -> Array:
        """Sum of squares of the prior's residuals at z (B, P), zero without a prior."""
        return np.zeros(len(z)) if self.prior_factor is None else np.square(z @ self.prior_factor.T).sum(axis=1)

    def whitened(self, residuals: Array) -> Array:
        """Residuals (N, n_y) in units of the noise, zero where not measured."""
        white: Array = self._whitened(self.covariance, residuals[None])[0][0]
        return white

    def _whitened(self, covariance: Array, *arrays: Array) -> list[Array]:
        white = whiten(covariance, self.measured, *arrays)
        for error in self.common:
            for array in white:
                array[:, error.rows] = error.whitened(array[:, error.rows])
        return white

    def __call__(self, z: Array, rows: NDArray[np.intp]) -> tuple[Array, Array, NDArray[np.bool_]]:
        values = self.unknowns.values(z)
        response = self.observed.respond(values)
        y = self.y if len(self.y) == 1 else self.y[rows]
        covariance = self.covariance
        if covariance.ndim == 4 and len(covariance) > 1:
            covariance = covariance[rows]
        slopes = self.unknowns.slopes(values)[:, None, None, :]
        e, jacobian = self._whitened(covariance, response.y - y, response.dy * slopes)
        r, jacobian = e.reshape(len(z), -1), jacobian.reshape(len(z), -1, z.shape[1])
        if self.prior_factor is not None:
            r = np.concatenate([r, z @ self.prior_factor.T], axis=1)
            jacobian = np.concatenate([jacobian, np.broadcast_to(self.prior_factor, (len(z), *self.prior_factor.shape))], axis=1)
        return r, jacobian, response.status == 0
