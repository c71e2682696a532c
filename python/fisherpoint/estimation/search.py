"""The search for an estimate: many starts together, then SciPy's `least_squares` from the best of them."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..quantity import Array
from ..trajectories import Status
from .known_noise import KnownNoise
from .least_squares import CONVERGED, ENDS, NOT_EVALUABLE, Minima, minimise
from .unknown_noise import correlations_can_be_told, likelihood_deviance, minimise_log_det
from .weighting import WeightedResiduals

SAME_MINIMUM = 1e-3
"""Difference of costs, in half squares of standard errors, up to which two starts have come to the same minimum."""

FIRST_ITERATIONS = 50
"""Iterations of each start, before the best of them is followed to its end."""

SETTLED_TO_COMPARE = 1e-4
"""Change of estimated weights from which on starts can be compared."""

WEIGHTINGS = 20
"""How often at most the share of what is assumed is taken anew at the estimate."""

SAME_WEIGHTS = 1e-5
"""Change of variances, as a share, from which on they are the same weights."""


class Found(NamedTuple):
    """The minimum z (P,) with the residuals as they are weighted there, how the search ended, and how many starts came there."""

    z: Array
    residuals: WeightedResiduals
    converged: bool
    message: str
    evaluations: int
    reached: int


def search_with_known_noise(residuals: WeightedResiduals, z0: Array, noise: KnownNoise) -> Found:
    """Weighted least squares from starts (B, P), of which the first one is ok."""
    weighted = _weighted(residuals, noise, z0[0])
    minima = minimise(weighted, z0, weighted.unknowns.lower, weighted.unknowns.upper, FIRST_ITERATIONS)
    best, reached = _best(minima, weighted, z0)
    found = _polished(weighted, minima, best)
    for _ in range(WEIGHTINGS - 1 if noise.assumed else 0):
        weighted = _weighted(residuals, noise, found.z)
        if np.allclose(weighted.variances, found.residuals.variances, rtol=SAME_WEIGHTS, atol=0.0):
            break
        again = _polished(weighted, minima._replace(z=np.where(np.arange(len(z0))[:, None] == best, found.z, minima.z)), best)
        found = again._replace(evaluations=found.evaluations + again.evaluations)
    return found._replace(reached=reached)


def search_with_unknown_noise(residuals: WeightedResiduals, z0: Array) -> Found:
    """The minimum of log det of the residual covariance (10), from starts (B, P)."""
    full = correlations_can_be_told(residuals.measured, len(residuals.unknowns))
    minima, covariances = minimise_log_det(residuals, z0, full, FIRST_ITERATIONS, SETTLED_TO_COMPARE)
    twice = likelihood_deviance(covariances, residuals.measured, full) + residuals.prior_square(minima.z)
    minima = minima._replace(cost=np.where(np.isfinite(twice), twice / 2, np.inf))
    best, reached = _best(minima, residuals, z0)
    settled, covariance = minimise_log_det(residuals, minima.z[best : best + 1], full)
    found = _polished(replace(residuals, covariance=covariance[0]), settled, 0)
    return found._replace(evaluations=found.evaluations + int(minima.iterations[best]), reached=reached)


def _weighted(residuals: WeightedResiduals, noise: KnownNoise, z: Array) -> WeightedResiduals:
    """The residuals in units of the noise that there is at z (P,)."""
    theta = residuals.observed.parameters(residuals.unknowns.values(z[None]))[0]
    return replace(residuals, covariance=noise.covariance(theta))


def _best(minima: Minima, residuals: WeightedResiduals, z0: Array) -> tuple[int, int]:
    """The start that came lowest, and how many came there."""
    usable = minima.end != NOT_EVALUABLE
    if not usable.any():
        status = Status(residuals.observed.respond(residuals.unknowns.values(z0[:1])).status[0])
        raise ValueError(f"start: expected parameters at which trajectories are ok, given one with {status.name}. {status.advice}")
    cost = np.where(usable, minima.cost, np.inf)
    best = int(np.argmin(cost))
    return best, int((cost <= cost[best] + SAME_MINIMUM).sum())


def _polished(residuals: WeightedResiduals, minima: Minima, best: int) -> Found:
    """SciPy's minimum from one of those that were found together."""
    from scipy.optimize import least_squares

    z, end, iterations = minima.z[best], int(minima.end[best]), int(minima.iterations[best])
    row, kept = np.zeros(1, dtype=np.intp), {}

    def function(at: Array) -> Array:
        r, jacobian, ok = residuals(at[None], row)
        kept["at"], kept["jacobian"] = at.copy(), jacobian[0]
        return r[0] if ok[0] else np.full(r.shape[1], np.inf)

    def jacobian(at: Array) -> Array:
        return kept["jacobian"] if np.array_equal(kept["at"], at) else residuals(at[None], row)[1][0]

    lower, upper = residuals.unknowns.lower, residuals.unknowns.upper
    bounded = np.isfinite(lower).any() or np.isfinite(upper).any()
    try:
        found = least_squares(
            function,
            np.clip(z, lower, upper),
            jacobian,
            bounds=(lower, upper) if bounded else (-np.inf, np.inf),
            method="trf",
            x_scale="jac",
            ftol=1e-15,
            xtol=1e-12,
            gtol=1e-12,
            max_nfev=100,
        )
    except ValueError as error:
        if "not finite" not in str(error):
            raise
        return Found(z, residuals, False, "the trajectories at the estimate are not ok", iterations + 1, 0)
    converged = bool(found.success) or end == CONVERGED
    message = str(found.message) if found.success or end == CONVERGED else ENDS[end]
    return Found(found.x, residuals, converged, message, iterations + int(found.nfev), 0)
