"""The search for an estimate: many starts together, then the best of them to its end."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..basics.stop_reason import StopReason
from ..basics.values import Array
from ..points.status import Status
from .known_noise import KnownNoise
from .least_squares import CONVERGED, ENDS, NOT_EVALUABLE, UNSETTLED, Minima, minimise
from .unknown_noise import correlations_can_be_estimated, likelihood_deviance, minimise_log_det
from .weighting import WeightedResiduals

SAME_MINIMUM = 1e-3
"""Difference of costs, in half squares of standard errors, up to which two starts have come to the same minimum."""

FIRST_EVALUATIONS = 50
"""Evaluations of each of several starts, before the best of them is followed to its end."""

MOST_EVALUATIONS = 1000
"""Maximum number of evaluations of one search: twice what the slowest of NIST's problems takes that comes to its end."""

SETTLED_TO_COMPARE = 1e-4
"""Change of estimated weights from which on starts can be compared."""

WEIGHTINGS = 20
"""How often at most the share of what is assumed is taken anew at the estimate."""

SAME_WEIGHTS = 1e-5
"""Change of variances, as a share, from which on they are the same weights."""


class FoundMinimum(NamedTuple):
    """The minimum z (P,) with the residuals as they are weighted there, why the search ended, and how many starts came there."""

    z: Array
    residuals: WeightedResiduals
    stop_reason: StopReason
    evaluations: int
    reached: int


def search_with_known_noise(residuals: WeightedResiduals, z0: Array, noise: KnownNoise) -> FoundMinimum:
    """Weighted least squares from starts (B, P); the first one is ok."""
    weighted = _weighted(residuals, noise, z0[0])
    minima = _minimised(weighted, z0, FIRST_EVALUATIONS if len(z0) > 1 else MOST_EVALUATIONS)
    best, reached = _best(minima, weighted, z0)
    evaluations = int(minima.evaluations[best])
    if minima.end[best] != CONVERGED and len(z0) > 1:
        minima, best = _minimised(weighted, minima.z[best : best + 1], MOST_EVALUATIONS), 0
        evaluations += int(minima.evaluations[0])
    z, end, settled = minima.z[best], int(minima.end[best]), not noise.assumed
    for _ in range(WEIGHTINGS if noise.assumed else 0):
        again = _weighted(residuals, noise, z)
        settled = np.allclose(again.variances, weighted.variances, rtol=SAME_WEIGHTS, atol=0.0)
        if settled:
            break
        weighted = again
        latest = _minimised(weighted, z[None], MOST_EVALUATIONS)
        z, end, evaluations = latest.z[0], int(latest.end[0]), evaluations + int(latest.evaluations[0])
    return _found(z, weighted, end if settled or end != CONVERGED else UNSETTLED, evaluations, reached)


def search_with_unknown_noise(residuals: WeightedResiduals, z0: Array) -> FoundMinimum:
    """The minimum of log det of the residual covariance (10), from starts (B, P)."""
    full = correlations_can_be_estimated(residuals.measured, len(residuals.unknowns))
    best, reached, evaluations = 0, 1, 0
    if len(z0) > 1:
        minima, covariances = minimise_log_det(residuals, z0, full, FIRST_EVALUATIONS, SETTLED_TO_COMPARE)
        twice = likelihood_deviance(covariances, residuals.measured, full) + residuals.prior_square(minima.z)
        minima = minima._replace(cost=np.where(np.isfinite(twice), twice / 2, np.inf))
        best, reached = _best(minima, residuals, z0)
        z0, evaluations = minima.z[best : best + 1], int(minima.evaluations[best])
    minima, covariances = minimise_log_det(residuals, z0, full, MOST_EVALUATIONS)
    _best(minima, residuals, z0)
    weighted = replace(residuals, covariance=covariances[0])
    end, evaluations = int(residuals.unknowns.ended(minima)[0]), evaluations + int(minima.evaluations[0])
    return _found(minima.z[0], weighted, end, evaluations, reached)


def _found(z: Array, residuals: WeightedResiduals, end: int, evaluations: int, reached: int) -> FoundMinimum:
    return FoundMinimum(z, residuals, ENDS[end], evaluations, reached)


def _minimised(residuals: WeightedResiduals, z0: Array, max_evaluations: int) -> Minima:
    unknowns = residuals.unknowns
    minima = minimise(residuals, z0, unknowns.lower, unknowns.upper, max_evaluations, accuracy=residuals.accuracy)
    return minima._replace(end=unknowns.ended(minima))


def _weighted(residuals: WeightedResiduals, noise: KnownNoise, z: Array) -> WeightedResiduals:
    """The residuals in units of the noise that there is at z (P,)."""
    theta = residuals.observed.parameters(residuals.unknowns.values(z[None]))[0]
    covariance, common = noise.at(theta)
    return replace(residuals, covariance=covariance, common=common)


def _best(minima: Minima, residuals: WeightedResiduals, z0: Array) -> tuple[int, int]:
    """The start that came lowest, and how many came there."""
    usable = minima.end != NOT_EVALUABLE
    if not usable.any():
        status = Status(residuals.observed.respond(residuals.unknowns.values(z0[:1])).status[0])
        raise ValueError(f"start: expected parameters at which trajectories are ok, given one with {status.name}. {status.advice}")
    cost = np.where(usable, minima.cost, np.inf)
    best = int(np.argmin(cost))
    return best, int((cost <= cost[best] + SAME_MINIMUM).sum())
