"""Noise that is not known: the estimate that minimises log det of the residual covariance (10).

Least squares weighted with the residual covariance of the estimate before, again and again: where this comes to rest, the gradient
of log det, tr(D^-1 dD), is zero.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array
from ..prior.gaussian import GaussianPrior
from .least_squares import CONVERGED, LIMIT, NOT_EVALUABLE, UNSETTLED, Minima
from .observed import EPSILON, Observed
from .weighting import WeightedResiduals

TINY = 1e-200
"""Smallest variance, of outputs that are zero; its inverse still is a number."""

MAX_ROUNDS = 300
SETTLED = 1e-10


def residual_covariance(residuals: Array) -> Array:
    """(10) of residuals (B, N, n_y): the mean over the samples in which both outputs were measured, not NaN, (B, n_y, n_y)."""
    measured = np.isfinite(residuals).astype(np.float64)
    filled = np.nan_to_num(residuals)
    count = np.maximum(measured.transpose(0, 2, 1) @ measured, 1.0)
    return filled.transpose(0, 2, 1) @ filled / count


def likelihood_deviance(covariance: Array, measured: NDArray[np.bool_], full: bool) -> Array:
    """-2 log likelihood (B,), but for a constant, where the noise has the residual covariance (B, n_y, n_y): N log det of (10).

    Without correlations, the sum over outputs of their number of values times the logarithm of the variance.
    """
    if full:
        return np.asarray(len(measured) * np.linalg.slogdet(covariance)[1])
    return np.asarray(np.log(np.einsum("bii->bi", covariance)) @ measured.sum(axis=0))


def check_noise_is_determined(observed: Observed, prior: GaussianPrior | None) -> None:
    """Raise where there are not more numbers than unknowns that the prior does not have."""
    count = int(np.isfinite(observed.y).sum())
    free = sum(prior is None or name not in prior.names for name in observed.names)
    if count <= free:
        raise ValueError(
            f"noise: expected the noise, or more than {free} numbers to estimate it beside the unknowns; given {count}"
        )


def correlations_can_be_estimated(measured: NDArray[np.bool_], n_unknowns: int) -> bool:
    """Whether log det of the full covariance has a minimum: all outputs in every sample, and more samples than can be fitted."""
    n_samples, n_y = measured.shape
    return bool(measured.all()) and n_samples > n_unknowns + 2 * n_y


def floor(y: Array) -> Array:
    """Variances (n_y,) that the rounding of outputs y (..., N, n_y) makes: residuals below cannot be distinguished from it."""
    measured = np.isfinite(y)
    squares = np.where(measured, y, 0.0) ** 2
    axes = tuple(range(y.ndim - 1))
    least: Array = EPSILON**2 * squares.sum(axis=axes) / np.maximum(measured.sum(axis=axes), 1) + TINY
    least[~measured.any(axis=axes)] = 1.0  # any number: it weighs nothing
    return least


def above_floor(covariance: Array, least: Array) -> Array:
    """Covariances (B, n_y, n_y) with variances of at least the floor (n_y,)."""
    short = np.maximum(least - np.einsum("bii->bi", covariance), 0.0)
    return np.asarray(covariance + np.eye(len(least)) * short[:, :, None])


def relative_change(update: Array, covariance: Array) -> Array:
    """Largest change (B,) of an entry of covariances (B, n_y, n_y), as a share of its standard deviations."""
    scale = np.sqrt(np.einsum("bii->bi", covariance))
    change: Array = (np.abs(update - covariance) / (scale[:, :, None] * scale[:, None, :])).max(axis=(1, 2), initial=0.0)
    return change


def minimise_log_det(
    residuals: WeightedResiduals, z0: Array, full: bool, max_evaluations: int = 200, settled: float | Array = SETTLED
) -> tuple[Minima, Array]:
    """Minimise log det of the residual covariance of B problems; its diagonal's where not `full`.

    The weights are taken anew until they change by less than `settled`, a number or (B,), of themselves, or than rounding makes
    them change. Of a single output without a prior they do not move the minimum, and are taken once.

    Returns
    -------
    minima : Minima
        The cost is that of the last weighting.
    covariance : ndarray, (B, n_y, n_y)
        The residual covariance, which is the maximum-likelihood estimate of the noise's.
    """
    unknowns, keep = residuals.unknowns, np.ones(residuals.y.shape[-1]) if full else np.eye(residuals.y.shape[-1])
    least, alone = floor(residuals.y), residuals.prior_factor is None and residuals.measured.any(axis=0).sum() == 1

    def covariance_at(z: Array, y: Array) -> Array:
        return above_floor(residual_covariance(residuals.observed.respond(unknowns.values(z)).y - y) * keep, least)

    def minimised(z: Array, y: Array, covariance: Array) -> Minima:
        weighted = replace(residuals, y=y, covariance=covariance[:, None])
        return weighted.minimised(z, max_evaluations, unit=0.0)

    y = np.broadcast_to(residuals.y, (len(z0), *residuals.y.shape[1:]))
    covariance = covariance_at(z0, y) * np.eye(len(least))  # of a start alone, correlations mean nothing
    minima = minimised(z0, y, covariance)
    going, before = np.flatnonzero(minima.end != NOT_EVALUABLE), np.full(len(z0), np.inf)
    settled = np.broadcast_to(settled, len(z0))
    for _ in range(MAX_ROUNDS):
        update = covariance_at(minima.z[going], y[going])
        change = relative_change(update, covariance[going])
        covariance[going] = update
        if alone:
            return minima, covariance
        # Where rounding moves the weights, they are settled when they come no closer.
        rounding = 10 * residuals.observed.precision / EPSILON * np.sqrt(least / np.einsum("bii->bi", update)).max(axis=1)
        rounding += 10 * minima.spacing[going] / np.sqrt(residuals.measured.sum())
        moving = (change > settled[going]) & ((change > rounding) | (change < 0.5 * before[going]))
        before[going] = change
        going = going[moving & (minima.end[going] != LIMIT)]
        if not len(going):
            return minima, covariance
        latest = minimised(minima.z[going], y[going], covariance[going])
        minima.z[going], minima.cost[going], minima.end[going] = latest.z, latest.cost, latest.end
        minima.evaluations[going] += latest.evaluations
        minima.spacing[going] = latest.spacing
    minima.end[going[minima.end[going] == CONVERGED]] = UNSETTLED  # with weights that still change they are no minima
    return minima, covariance
