"""The search for an estimate: given starts and nodes of the prior together, then the best of them to its end."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..basics.quantity import names_of
from ..basics.stop_reason import StopReason
from ..basics.values import Array
from ..data.record import Record
from ..models import Model
from ..points.status import Status
from ..prior.gaussian import GaussianPrior
from ..prior.rules import Sobol
from .known_noise import KnownNoise
from .least_squares import CONVERGED, ENDS, NOT_EVALUABLE, UNSETTLED, Minima
from .observed import Observed
from .unknown_noise import correlations_can_be_estimated, likelihood_deviance, minimise_log_det
from .unknowns import Unknowns
from .weighting import WeightedResiduals

MOST_STARTS = 10**4
"""Starts of a search, past which they count as a slip."""

MOST_DRAWN = 8
"""Nodes of the prior, for each start, that are tried where trajectories are not ok."""

WIDER = 2.0
"""Distance of further starts from the prior's mean, in multiples of that of its nodes.

Of 96 fits to data of two tanks with kinks, from two standard deviations off the truth, 75 came to the truth from 8 starts, and 92
with further ones where these were requested.
"""

TRIED = 32
"""Number of further nodes, for each start, whose residuals are computed."""

FOLLOWED = 2
"""Further nodes, for each start, from which a search starts: those with the least residuals."""


def start_guess(model: Model, state: str, record: Record) -> float:
    """A start for a state of a record that is not known: the first measurement of the output of its name, or its natural size."""
    outputs = names_of(model.outputs)
    if state in outputs:
        column = record.y[:, outputs.index(state)]
        if np.isfinite(column).any():
            return float(column[np.isfinite(column)][0])
    return next(q.scale for q in model.states if q.name == state) or 1.0


def evaluable_starts(
    observed: Observed, unknowns: Unknowns, begin: Mapping[str, float], spread: GaussianPrior | None, count: int
) -> Array:
    """Coordinates (B, P) of the starts: as given, and nodes of the prior; further nodes instead of those that are not ok."""
    z = spread_starts(unknowns, begin, spread, MOST_DRAWN * count if count > 1 else 1)
    if len(z) == 1:
        return z
    ok = np.zeros(len(z), dtype=bool)
    for first in range(0, len(z), count):
        some = slice(first, first + count)
        ok[some] = observed.respond(unknowns.values(z[some])).status == Status.ok
        if ok.sum() >= count:
            break
    return z[ok][:count] if ok.any() else z[:1]


def spread_starts(unknowns: Unknowns, begin: Mapping[str, float], spread: GaussianPrior | None, count: int) -> Array:
    """Coordinates (B, P) of the starts: the first as given, others at nodes of the prior."""
    z = unknowns.coordinates(np.array([list(begin.values())]))
    named = [name for name in unknowns.names if spread is not None and name in spread.names]
    if spread is not None and named and count > 1:
        nodes, _ = Sobol(1 << (count - 1).bit_length()).nodes(spread.marginal(named))
        values = np.tile(list(begin.values()), (count - 1, 1))
        values[:, [unknowns.names.index(name) for name in named]] = nodes[: count - 1]
        z = np.concatenate([z, unknowns.coordinates(values)])
    return np.clip(z, unknowns.lower, unknowns.upper)


def further_starts(residuals: WeightedResiduals, begin: Mapping[str, float], spread: GaussianPrior, count: int) -> Array:
    """Coordinates (B, P): of many nodes that lie wider than the prior's, those with the least residuals."""
    unknowns = residuals.unknowns
    of_prior = np.array([name in spread.names for name in unknowns.names])  # whose coordinates are zero at the prior's mean
    nodes = spread_starts(unknowns, begin, spread, TRIED * count + 1)[1:]
    nodes = np.clip(np.where(of_prior, WIDER * nodes, nodes), unknowns.lower, unknowns.upper)
    cost = np.full(len(nodes), np.inf)
    for first in range(0, len(nodes), count):
        some = np.arange(first, min(first + count, len(nodes)))
        r, _, ok = residuals(nodes[some], np.zeros(len(some), dtype=np.intp))
        cost[some] = np.where(ok, np.square(r).sum(axis=1), np.inf)
    best = np.argsort(cost, kind="stable")[: FOLLOWED * count]
    followed: Array = nodes[best[np.isfinite(cost[best])]]
    return followed


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
    weighted = noise.weighed(residuals, z0[0])
    minima = _minimised(weighted, z0, FIRST_EVALUATIONS if len(z0) > 1 else MOST_EVALUATIONS)
    best, reached = _best(minima, weighted, z0)
    evaluations = int(minima.evaluations[best])
    if minima.end[best] != CONVERGED and len(z0) > 1:
        minima, best = _minimised(weighted, minima.z[best : best + 1], MOST_EVALUATIONS), 0
        evaluations += int(minima.evaluations[0])
    z, end, settled = minima.z[best], int(minima.end[best]), not noise.changes
    for _ in range(WEIGHTINGS if noise.changes else 0):
        again = noise.weighed(residuals, z)
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
    minima = residuals.minimised(z0, max_evaluations)
    return minima._replace(end=residuals.unknowns.ended(minima))


def _best(minima: Minima, residuals: WeightedResiduals, z0: Array) -> tuple[int, int]:
    """The start that came lowest, and how many came there."""
    usable = minima.end != NOT_EVALUABLE
    if not usable.any():
        status = Status(residuals.observed.respond(residuals.unknowns.values(z0[:1])).status[0])
        raise ValueError(f"start: expected parameters at which trajectories are ok, given one with {status.name}. {status.advice}")
    cost = np.where(usable, minima.cost, np.inf)
    best = int(np.argmin(cost))
    return best, int((cost <= cost[best] + SAME_MINIMUM).sum())
