"""Starts of the search for an estimate: given ones, nodes of the prior, and further ones where these do not agree."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..basics.quantity import names_of
from ..basics.values import Array
from ..data.record import Record
from ..models import Model
from ..points.status import Status
from ..prior.gaussian import GaussianPrior
from ..prior.rules import Sobol
from .observed import Observed
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
