"""Residuals in units of the noise: whitened by its covariance, and by what moves all samples of a run at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array
from ..data.measurements import Measurements
from ..information.assumed import Assumed
from ..information.run_tangents import moves_of_runs
from ..noise.common_error import CommonError
from ..noise.sensors import Sensors
from ..points.settings import Integration
from ..points.status import Status
from .least_squares import TOLERANCE, Accuracy, Minima, minimise
from .observed import Observed
from .response import Response
from .sensor_noise import Readings, SensorNoise
from .tangent_space import DENSE, Layout
from .unknowns import Unknowns


@dataclass(frozen=True, eq=False)
class RunError:
    """The common error of one run.

    Attributes
    ----------
    first : int
        Number of the run's first sample among all.
    moved : ndarray, (n, n_y, q)
        By how much its n samples move with a standard deviation of each cause, whitened by the noise; zero where not measured.
    variances : ndarray, (n, n_y)
        What that adds to the variances of the samples, SI units.
    """

    first: int
    moved: Array
    variances: Array

    @property
    def rows(self) -> slice:
        return slice(self.first, self.first + len(self.moved))

    @cached_property
    def _common(self) -> CommonError:
        return CommonError.of(self.moved.reshape(-1, self.moved.shape[2]))

    def whitened(self, rows: Array) -> Array:
        """Whiten rows (B, n, n_y, ...) that the noise has whitened: multiply by (I + H H^T)^-1/2."""
        white = self._common.whitened(rows.reshape(len(rows), -1, int(np.prod(rows.shape[3:]))))
        return white.reshape(rows.shape)


class RunMoves(NamedTuple):
    """By how much the n samples of a run, from `first` on among all, move with a standard deviation of each cause, (n, n_y, q)."""

    first: int
    moved: Array


def run_moves(assumed: Assumed, data: Measurements, theta: Array, settings: Integration, first: int = 0) -> Iterator[RunMoves]:
    """The moves of measured runs, SI units; their first sample has the number `first`.

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
    moved = np.where(np.isfinite(data.run_outputs)[..., None], moved, 0.0)
    for of_run, there in zip(moved, runs.measured, strict=True):
        yield RunMoves(first, of_run[there])
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
        Of the noise of every sample; of independent readings that are more than white, about the standard deviation alone.
    prior_factor : ndarray, (P, P), or None
        L^-1 of the prior's covariance L L^T in coordinates z, for residuals L^-1 z that are added: the maximum a posteriori.
    common : tuple of RunError
        Of runs, what moves all samples of one; the covariance of these samples is R alone.
    noise : SensorNoise, optional
        Of sensors that are more than white.
    """

    observed: Observed
    unknowns: Unknowns
    y: Array
    covariance: Array
    prior_factor: Array | None = None
    common: tuple[RunError, ...] = ()
    noise: SensorNoise | None = None

    def weighed(self, covariance: Array, moves: Sequence[RunMoves], noise: SensorNoise | None) -> WeightedResiduals:
        """The residuals by other weights: covariances of samples, what moves those of runs, and the sensors' noise."""
        plain = replace(self, covariance=covariance, noise=noise, common=())
        moved = np.zeros((1, *self.measured.shape, max((one.moved.shape[2] for one in moves), default=0)))
        for one in moves:
            moved[0, one.first : one.first + len(one.moved), :, : one.moved.shape[2]] = one.moved
        white = plain._whitened(covariance, moved)[0][0] if moves else moved[0]
        return replace(plain, common=tuple(_run_error(one, white) for one in moves))

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
                variances[error.rows] += error.variances
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

    def whitened(self, predicted: Array) -> Array:
        """Residuals measured - predicted, (N, n_y), in units of the noise, zero where not measured; of readings, their scores."""
        if (readings := self._readings) is not None:
            e, _ = readings.scores(predicted[None], np.zeros((1, *predicted.shape, 0)))
            return np.asarray(-e[0])
        white: Array = self._whitened(self.covariance, (self.y[0] - predicted)[None])[0][0]
        return white

    @cached_property
    def _readings(self) -> Readings | None:
        """The likelihoods of independent readings that are more than white."""
        return None if self.noise is None or self.noise.normal else self.noise.likelihoods(self.y, self.measured)

    def _whitened(self, covariance: Array, *arrays: Array) -> list[Array]:
        white = whiten(covariance, self.measured, *arrays)
        if self.noise is not None:
            self.noise.whiten_series(self.measured, arrays, white)
        for error in self.common:
            for array in white:
                array[:, error.rows] = error.whitened(array[:, error.rows])
        return white

    @cached_property
    def _stored(self) -> tuple[Layout, Array | None]:
        """How Jacobians are stored, and the prior's rows in them."""
        local = self.observed.local
        if not local.each:
            return DENSE, self.prior_factor
        further = np.zeros((0, len(self.unknowns))) if self.prior_factor is None else self.prior_factor
        return local.layout(self.y.shape[-1], further)

    @property
    def layout(self) -> Layout:
        """How `stored` has Jacobians."""
        return self._stored[0]

    @property
    def uneven(self) -> Sensors | None:
        """The sensors where readings are rounded or limited."""
        return None if self._readings is None or not self._readings.sensors.uneven.any() else self._readings.sensors

    def rows(self, values: Array, response: Response, place: Array | None = None) -> Array:
        """Rows J (M, P) with the information J^T J, from the response to unknowns (1, P).

        That of rounded and limited readings as it is there, or where the tangents have the outputs at a `place` (P,).
        """
        jacobian = response.dy * self.slopes(values)
        if (readings := self._readings) is not None:
            moved = 0.0 if place is None else (jacobian * self._of_columns(place[None])).sum(axis=3)
            white = readings.rows(response.y + moved, jacobian)
        else:
            white = self._whitened(self.covariance, jacobian)[0]
        rows, prior = white.reshape(-1, jacobian.shape[3]), self._stored[1]
        whole: Array = self.layout.dense((rows if prior is None else np.concatenate([rows, prior]))[None])[0]
        return whole

    def __call__(self, z: Array, rows: NDArray[np.intp]) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Residuals r (B, M), where r^T r / 2 is minimised, their Jacobian (B, M, P), and whether they are there (B,)."""
        r, jacobian, ok = self.stored(z, rows)
        return r, self.layout.dense(jacobian), ok

    def scores(self, z: Array, rows: NDArray[np.intp]) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Residuals e of variance 1, and rows J with the information J^T J and the gradient J^T e.

        As in `__call__`; only of independent readings that are more than white they are others.
        """
        r, jacobian, ok = self.stored(z, rows, scores=True)
        return r, self.layout.dense(jacobian), ok

    def stored(self, z: Array, rows: NDArray[np.intp], scores: bool = False) -> tuple[Array, Array, NDArray[np.bool_]]:
        """As a call, or `scores`, with Jacobians as the layout has them."""
        values = self.unknowns.values(z)
        response = self.observed.respond(values)
        dy = response.dy * self.slopes(values)
        if (readings := self._readings) is not None:
            readings = readings if len(self.y) == 1 else readings.some(rows)
            e, jacobian = (readings.scores if scores else readings.deviance)(response.y, dy)
        else:
            y = self.y if len(self.y) == 1 else self.y[rows]
            covariance = self.covariance
            if covariance.ndim == 4 and len(covariance) > 1:
                covariance = covariance[rows]
            e, jacobian = self._whitened(covariance, response.y - y, dy)
        r, jacobian = e.reshape(len(z), -1), jacobian.reshape(len(z), -1, dy.shape[3])
        prior = self._stored[1]
        if self.prior_factor is not None and prior is not None:
            r = np.concatenate([r, z @ self.prior_factor.T], axis=1)
            jacobian = np.concatenate([jacobian, np.broadcast_to(prior, (len(z), *prior.shape))], axis=1)
        return r, jacobian, response.status == 0

    def minimised(self, z0: Array, max_evaluations: int, *, unit: float = 1.0, tolerance: float | Array = TOLERANCE) -> Minima:
        """Minima from starts z0 (B, P) within the bounds; `unit` and `tolerance` as `least_squares.minimise` has them."""
        unknowns = self.unknowns
        return minimise(
            self.stored,
            z0,
            unknowns.lower,
            unknowns.upper,
            max_evaluations,
            unit=unit,
            accuracy=self.accuracy,
            tolerance=tolerance,
            layout=self.layout,
            has_prior=unknowns.has_prior,
        )

    def slopes(self, values: Array) -> Array:
        """d values / dz at unknowns (B, P) of each column of a response, (B, 1 or N, 1, columns)."""
        return self._of_columns(self.unknowns.slopes(values))

    def _of_columns(self, of_unknowns: Array) -> Array:
        """Values of unknowns (B, P) at the columns of a response, (B, 1 or N, 1, columns)."""
        local, common = self.observed.local, self.observed.common
        if not local.each:
            return np.asarray(of_unknowns[:, None, None, :])
        own = of_unknowns[:, common:][:, local.samples]
        shared = np.broadcast_to(of_unknowns[:, None, :common], (*own.shape[:2], common))
        return np.concatenate([shared, own], axis=2)[:, :, None]


def _run_error(moves: RunMoves, white: Array) -> RunError:
    rows = slice(moves.first, moves.first + len(moves.moved))
    return RunError(moves.first, white[rows, :, : moves.moved.shape[2]], np.square(moves.moved).sum(axis=2))
