"""Noise that is not known: the estimate that minimises log det of the residual covariance (10).

Least squares weighted with the residual covariance of the estimate before, again and again: where this comes to rest, the gradient
of log det, tr(D^-1 dD), is zero.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..prior import GaussianPrior
from ..quantity import Array
from .least_squares import NOT_EVALUABLE, Minima, minimise
from .response import Observed
from .weighting import WeightedResiduals

FLOOR = 1e-12
"""Share of an output's mean square below which its residuals cannot be told from rounding."""

MAX_ROUNDS = 100
SETTLED = 1e-10


def residual_covariance(residuals: Array) -> Array:
    """(10) of residuals (B, N, n_y): the mean over the samples in which both outputs were measured, not NaN, (B, n_y, n_y)."""
    measured = np.isfinite(residuals).astype(np.float64)
    filled = np.nan_to_num(residuals)
    count = np.maximum(measured.transpose(0, 2, 1) @ measured, 1.0)
    covariance: Array = filled.transpose(0, 2, 1) @ filled / count
    return covariance


def likelihood_deviance(covariance: Array, measured: NDArray[np.bool_], full: bool) -> Array:
    """-2 log likelihood (B,), but for a constant, where the noise has the residual covariance (B, n_y, n_y): N log det of (10).

    Where correlations are not told, the sum over outputs of their number of values times the logarithm of the variance.
    """
    if full:
        return np.asarray(len(measured) * np.linalg.slogdet(covariance)[1])
    return np.asarray(np.log(np.einsum("bii->bi", covariance)) @ measured.sum(axis=0))


def check_noise_can_be_told(observed: Observed, prior: GaussianPrior | None) -> None:
    """Raise where there are not more numbers than unknowns that the prior does not have."""
    count = int(np.isfinite(observed.y).sum())
    free = sum(prior is None or name not in prior.names for name in observed.names)
    if count <= free:
        raise ValueError(
            f"noise_std: expected the noise, or more than {free} numbers to estimate it beside the unknowns; given {count}"
        )


def correlations_can_be_told(measured: NDArray[np.bool_], n_unknowns: int) -> bool:
    """Whether log det of the full covariance has a minimum: all outputs in every sample, and more samples than can be fitted."""
    n_samples, n_y = measured.shape
    return bool(measured.all()) and n_samples > n_unknowns + 2 * n_y


def minimise_log_det(
    residuals: WeightedResiduals, z0: Array, full: bool, max_iterations: int = 200, settled: float = SETTLED
) -> tuple[Minima, Array]:
    """Minimise log det of the residual covariance of B problems; its diagonal's where not `full`.

    The weights are taken anew until they change by less than `settled` of themselves.

    Returns
    -------
    minima : Minima
        The cost is that of the last weighting.
    covariance : ndarray, (B, n_y, n_y)
        The residual covariance, which is the maximum-likelihood estimate of the noise's.
    """
    unknowns, keep = residuals.unknowns, np.ones(residuals.y.shape[-1]) if full else np.eye(residuals.y.shape[-1])
    counts = np.maximum(residuals.measured.sum(axis=0), 1)
    least = FLOOR * np.nansum(residuals.y**2, axis=(0, 1)) / counts / len(residuals.y) + 1e-300
    least[~residuals.measured.any(axis=0)] = 1.0  # any number: it weighs nothing

    def covariance_at(z: Array, y: Array) -> Array:
        covariance = residual_covariance(residuals.observed.respond(unknowns.values(z)).y - y) * keep
        floored: Array = covariance + np.eye(len(least)) * np.maximum(least - np.einsum("bii->bi", covariance), 0.0)[:, :, None]
        return floored

    def minimised(z: Array, y: Array, covariance: Array) -> Minima:
        weighted = replace(residuals, y=y, covariance=covariance[:, None])
        return minimise(weighted, z, unknowns.lower, unknowns.upper, max_iterations)

    y = np.broadcast_to(residuals.y, (len(z0), *residuals.y.shape[1:]))
    covariance = covariance_at(z0, y) * np.eye(len(least))  # of a start alone, correlations mean nothing
    minima = minimised(z0, y, covariance)
    active = np.flatnonzero(minima.end != NOT_EVALUABLE)
    for _ in range(MAX_ROUNDS):
        update = covariance_at(minima.z[active], y[active])
        scale = np.sqrt(np.einsum("bii->bi", covariance[active]))
        change = np.abs(update - covariance[active]) / (scale[:, :, None] * scale[:, None, :])
        covariance[active] = update
        active = active[change.max(axis=(1, 2), initial=0.0) > settled]
        if not len(active):
            break
        latest = minimised(minima.z[active], y[active], covariance[active])
        minima.z[active], minima.cost[active], minima.end[active] = latest.z, latest.cost, latest.end
        minima.iterations[active] += latest.iterations
    return minima, covariance
