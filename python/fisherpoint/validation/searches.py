"""The minima of many virtual experiments, searched as `estimate` does, and which of them are wrong.

A second search from the true parameters, which a simulation knows, shows whether a minimum is the right one: where it ends
clearly lower, the first one is wrong. Unlike a test of the chi-square, this needs no level, distinguishes minima that are nearly as
low, and holds for noise that is not known, with a prior and with a model error too. Its result is never taken as an estimate:
nobody who measures could start there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array
from ..estimation.least_squares import CONVERGED, LIMIT, NOT_EVALUABLE, Minima
from ..estimation.search import SAME_MINIMUM, SETTLED_TO_COMPARE
from ..estimation.unknown_noise import SETTLED, correlations_can_be_estimated, likelihood_deviance, minimise_log_det
from ..estimation.weighting import WeightedResiduals

TRIED_EVALUATIONS = 20
"""Evaluations of the search from each start before the next one has its turn.

Most need 5 to 12. A search in a wrong valley may creep through it to where trajectories cost a hundred times as much: with friction
that turns round ever more steeply, one such search of 50 evaluations took longer than the 24 others beside it.
"""

CLOSE_ENOUGH_TO_COMPARE = 1e-2
"""Tolerance of searches whose cost alone is used: it is 5e-5 too large then, far less than minima differ by."""

LAST_EVALUATIONS = 200
"""Maximum number of evaluations of a search that goes on: from the truth, where it is not in a wrong valley, or as the lowest of
several that came to no end."""


@dataclass(frozen=True, eq=False)
class Searched:
    """Ends of B searches: minima, the noise (B, n_y, n_y) where it was estimated, and which minima are wrong (B,)."""

    minima: Minima
    noise: Array
    wrong: NDArray[np.bool_]

    def put(self, rows: NDArray[np.intp], other: Searched) -> None:
        """Take where other searches ended for these experiments."""
        mine, new = self.minima, other.minima
        mine.z[rows], mine.cost[rows], mine.end[rows], self.noise[rows] = new.z, new.cost, new.end, other.noise
        mine.spacing[rows] = new.spacing

    def some(self, chosen: NDArray[Any]) -> Searched:
        return Searched(Minima(*(of[chosen] for of in self.minima)), self.noise[chosen], self.wrong[chosen])


@dataclass(frozen=True, eq=False)
class Searches:
    """Searches for B experiments that share points and unknowns.

    Attributes
    ----------
    residuals : WeightedResiduals
        With data y (B, N, n_y).
    noise_known : bool
    starts : ndarray, (k, P)
        In coordinates; first the prior mean, then nodes spread over the prior.
    solved : float
        Distance to the minimum, in standard errors, at which a search with known noise ends.
    """

    residuals: WeightedResiduals
    noise_known: bool
    starts: Array
    solved: float

    def searched(self, truth: Array) -> Searched:
        """The lowest minima that are found from the starts; `truth` (B, P), in coordinates, shows which are wrong.

        All are searched from the prior mean first, and from the other starts where that ended in a wrong minimum, or in none
        where there is one.
        """
        everything = np.arange(len(truth))
        to_compare = (SETTLED_TO_COMPARE, CLOSE_ENOUGH_TO_COMPARE)
        # Both together: the last few searches that go on take as long as many.
        starts = np.concatenate([self._inside(truth), np.tile(self.starts[0], (len(truth), 1))])
        ends = (np.repeat(pair, len(truth)) for pair in zip(to_compare, (SETTLED, self.solved), strict=True))
        both = self._searched(starts, np.tile(everything, 2), TRIED_EVALUATIONS, *ends)
        from_truth, found = both.some(everything), both.some(len(truth) + everything)
        self._finish(from_truth, from_truth.minima.end == LIMIT, self._same(from_truth.minima.cost), *to_compare)
        lowest = from_truth.minima
        same = self._same(lowest.cost)
        self._finish(found, (found.minima.end == LIMIT) & ~(found.minima.cost > lowest.cost + same), same)  # not a wrong valley
        for rank in range(len(self.starts) - 1):
            rows = np.flatnonzero(self._to_go_on(found.minima, lowest, same))
            if not len(rows):
                break
            if rank == 0:
                order = np.zeros((len(truth), len(self.starts) - 1), dtype=np.intp)
                order[rows] = self._promising(rows)
            self._take_lower(found, rows, self._searched(self.starts[1:][order[rows, rank]], rows, TRIED_EVALUATIONS), same)
        self._finish(found, found.minima.end == LIMIT, same)
        return replace(found, wrong=found.minima.cost > lowest.cost + same)

    def _finish(
        self,
        found: Searched,
        chosen: NDArray[np.bool_],
        same: Array,
        settled: float = SETTLED,
        tolerance: float | None = None,
    ) -> None:
        """Go on with these searches from where they are."""
        if len(rows := np.flatnonzero(chosen)):
            further = self._searched(found.minima.z[rows], rows, LAST_EVALUATIONS, settled, tolerance)
            self._take_lower(found, rows, further, same)

    def _inside(self, z: Array) -> Array:
        return np.clip(z, self.residuals.unknowns.lower, self.residuals.unknowns.upper)

    def _same(self, cost: Array) -> Array:
        """Difference of costs (B,) that rounding, or the trajectories' tolerance, explains."""
        if not self.noise_known:
            return np.full(len(cost), SAME_MINIMUM)
        rounding = np.broadcast_to(self.residuals.accuracy.rounding, len(cost))
        size = np.sqrt(2 * np.where(np.isfinite(cost), cost, 0.0))
        return np.asarray(np.maximum(SAME_MINIMUM, 10 * rounding * (size + rounding)))

    @staticmethod
    def _to_go_on(minima: Minima, lowest: Minima, same: Array) -> NDArray[np.bool_]:
        """Searches that ended too high, or without a minimum where the one from the truth has one: there may be none to find."""
        without = (minima.end != CONVERGED) & (lowest.end == CONVERGED)
        return np.asarray(without | (minima.cost > lowest.cost + same))

    def _promising(self, rows: NDArray[np.intp]) -> NDArray[np.intp]:
        """The order (b, k) of the further starts for these experiments, from the lowest residuals on."""
        unknowns, several = self.residuals.unknowns, self.starts[1:]
        response = self.residuals.observed.respond(unknowns.values(several))
        outputs, failed = response.y, response.status != 0
        cost = np.empty((len(rows), len(several)))
        for place, row in enumerate(rows):
            away = np.nan_to_num(outputs - self.residuals.y[row])
            variances = np.broadcast_to(self.residuals.variances, (1, *away.shape[1:]))
            cost[place] = np.square(away / np.sqrt(variances)).sum(axis=(1, 2)) + self.residuals.prior_square(several)
        cost[:, failed] = np.inf
        return np.argsort(cost, axis=1, kind="stable")

    @staticmethod
    def _take_lower(found: Searched, rows: NDArray[np.intp], other: Searched, same: Array) -> None:
        """Take the end of another search where it is lower, or as low and at a minimum."""
        mine, new = found.some(rows).minima, other.minima
        found.minima.evaluations[rows] += new.evaluations
        near = np.abs(new.cost - mine.cost) <= same[rows]
        better = np.where(near, (new.end == CONVERGED) & (mine.end != CONVERGED), new.cost < mine.cost)
        found.put(rows[better], other.some(better))

    def _searched(
        self,
        z0: Array,
        rows: NDArray[np.intp],
        evaluations: int,
        settled: float | Array = SETTLED,
        tolerance: float | Array | None = None,
    ) -> Searched:
        """Minima of the experiments `rows` from z0 (b, P), with costs that can be compared, infinite where there is none."""
        residuals, unknowns = replace(self.residuals, y=self.residuals.y[rows]), self.residuals.unknowns
        n_y = residuals.y.shape[-1]
        if self.noise_known:
            minima = residuals.minimised(z0, evaluations, tolerance=self.solved if tolerance is None else tolerance)
            cost, noise = minima.cost, np.zeros((len(rows), n_y, n_y))
        else:
            full = correlations_can_be_estimated(residuals.measured, len(unknowns))
            minima, noise = minimise_log_det(replace(residuals, covariance=np.eye(n_y)), z0, full, evaluations, settled)
            with np.errstate(divide="ignore", invalid="ignore"):
                cost = (likelihood_deviance(noise, residuals.measured, full) + residuals.prior_square(minima.z)) / 2
        evaluable = (minima.end != NOT_EVALUABLE) & np.isfinite(cost)
        minima = minima._replace(cost=np.where(evaluable, cost, np.inf), end=unknowns.ended(minima))
        return Searched(minima, noise, np.zeros(len(rows), dtype=bool))
