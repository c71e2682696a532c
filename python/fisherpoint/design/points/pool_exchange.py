"""Exchange of a design's points for those of a pool whose rows are all in memory.

In each scenario, F is the sum of W W^T over the points, W (p, n) the whitened rows of a point as columns. Columns of all candidates
lie side by side, (p, n, N); the criterion is evaluated at F + W W^T for all of them. The average over the scenarios is
compared.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ...engine.levels import kernels
from ..goal.criteria import Criterion
from ..goal.scenario_average import Average
from .tuning import ExchangeTuning

SINGULAR = 1e-8
"""The pivot of F, as a share, below which a design is singular."""

TINY = 1e-10
"""Relative diagonal shift of F while a point is removed; with as few points as parameters it would be singular."""


class PoolExchange:
    """A design among candidates, some of which may replace its points.

    Parameters
    ----------
    columns : ndarray, (S, p, n, N)
        W of all candidates in each scenario.
    chosen : ndarray of int, (L,)
        The design's, among them.
    fixed : ndarray, (S, p, p)
        What is added to F.
    average : Average
    criteria : sequence of Criterion
        What is maximised in each scenario.
    tuning : ExchangeTuning
    """

    def __init__(
        self,
        columns: Array,
        chosen: NDArray[np.intp],
        fixed: Array,
        average: Average,
        criteria: Sequence[Criterion],
        tuning: ExchangeTuning = ExchangeTuning(),
    ) -> None:
        self.chosen, self._average, self.tuning = chosen.copy(), average, tuning
        self._parts = [_Scenario(columns[s], chosen, fixed[s], criterion) for s, criterion in enumerate(criteria)]
        self._bounded = any(criterion.bounded for criterion in criteria)

    def promising(self, among: NDArray[np.intp], most: int, place: NDArray[np.intp] | None = None) -> NDArray[np.intp]:
        """The `most` best candidates that raise the criterion instead of each point, all together.

        Where the `place` of each candidate is given, it is looked at there alone.
        """
        found = [np.empty(0, dtype=np.intp)]
        for own in self._distinct():
            some = among if place is None else among[place == own]
            if len(some):
                ratios = self._ratios(own, self._taken(np.append(some, self.chosen[own])), len(some), most)
                ratios, least = ratios[:-1], (1 + self.tuning.least_gain) * ratios[-1]
                best = np.argpartition(-ratios, most)[:most] if len(ratios) > most else np.arange(len(ratios))
                found.append(some[best[ratios[best] > least]])
        return np.unique(np.concatenate(found))

    def run(self, among: NDArray[np.intp], late: Callable[[], bool]) -> None:
        """Replace points by the best of some candidates, its own ones with them, until none raises the criterion any more."""
        columns = self._taken(among)
        for _ in range(self.tuning.most_passes):
            changed = False
            for own in self._distinct():
                if late():
                    return
                here = int(np.searchsorted(among, self.chosen[own]))
                ratios = self._ratios(own, columns, here, 1)
                best = int(np.argmax(ratios))
                if ratios[best] > (1 + self.tuning.least_gain) * ratios[here]:
                    self.chosen[own], changed = among[best], True
            if not changed:
                return

    def gains(self, among: NDArray[np.intp]) -> Array:
        """Factors by which candidates raise the criterion beside all points of the design."""
        parts, offsets = self._beside(self.chosen, self._taken(among))
        exactly = [part.criterion.added_exactly(f, w) if self._bounded else part.criterion.added(f, w) for part, f, w in parts]
        return self._average.ratios(offsets, exactly)

    def _beside(
        self, chosen: NDArray[np.intp], columns: Sequence[Array]
    ) -> tuple[list[tuple[_Scenario, Array, Array]], Array | None]:
        """Each scenario, with F of some points and the columns of candidates, and what the average needs to know of F."""
        fishers = [part.of(chosen) for part in self._parts]
        offsets = None
        if not self._average.is_mean:
            offsets = np.array([part.criterion.offset(f, part.factor) for part, f in zip(self._parts, fishers, strict=True)])
        return list(zip(self._parts, fishers, columns, strict=True)), offsets

    def _distinct(self) -> NDArray[np.intp]:
        """Places of the points, one of those that are the same."""
        return np.sort(np.unique(self.chosen, return_index=True)[1])

    def _taken(self, among: NDArray[np.intp]) -> list[Array]:
        return [part.columns.take(among, axis=2) for part in self._parts]

    def _ratios(self, place: int, columns: Sequence[Array], here: int, most: int) -> Array:
        """Factors by which columns raise the criterion without the point at a place, next to each other.

        Where the criterion has bounds for all, what cannot be among the `most` best is 0, but for that which is `here` now.
        """
        parts, offsets = self._beside(np.concatenate([self.chosen[:place], self.chosen[place + 1 :]]), columns)
        ratios = self._average.ratios(offsets, [part.criterion.added(f, w) for part, f, w in parts])
        if not self._bounded:
            return ratios
        exact = np.zeros(len(ratios))

        def look_at(some: NDArray[np.intp]) -> None:
            taken = [part.criterion.added_exactly(f, w[:, :, some]) for part, f, w in parts]
            exact[some] = self._average.ratios(offsets, taken)

        look_at(np.array([here]))
        order = np.argsort(-ratios, kind="stable")
        order = order[order != here]
        for first in range(0, len(order), self.tuning.exact_at_once):
            some = order[first : first + self.tuning.exact_at_once]
            known = exact[order[:first]]
            least = max(exact[here], np.partition(known, -most)[-most] if len(known) >= most else 0.0)
            if not ratios[some[0]] > least:
                break
            look_at(some)
        return exact


class _Scenario:
    """One scenario: its columns (p, n, N) and its criterion in coordinates in which F is about I."""

    def __init__(self, columns: Array, chosen: NDArray[np.intp], fixed: Array, criterion: Criterion) -> None:
        own, least = columns[:, :, chosen], criterion.least
        # In such coordinates the scales of F do not matter, nor what is added to it.
        factor = _factor(np.einsum("pnk,qnk->pq", own, own) + fixed)
        if _singular(factor):  # then in those of the candidates, and with more of I, so that what is missing shows
            factor = _factor(np.einsum("pnk,qnk->pq", columns, columns) * len(chosen) / columns.shape[2] + fixed)
            least = criterion.small
        self.columns = kernels.divided(factor, columns)
        half = np.linalg.solve(factor, _root(fixed))
        self._fixed = half @ half.T + least * np.eye(len(fixed))
        self.criterion, self.factor = criterion.in_coordinates(factor), factor

    def of(self, chosen: NDArray[np.intp]) -> Array:
        """F of some points, with a tiny addition to its diagonal."""
        columns = self.columns.take(chosen, axis=2).reshape(len(self._fixed), -1)
        fisher = columns @ columns.T + self._fixed
        fisher.flat[:: len(fisher) + 1] *= 1 + TINY
        return fisher


def _root(known: Array) -> Array:
    """A root R of information R R^T that may be singular: its rounding errors do not make it indefinite in other coordinates."""
    scale = np.sqrt(np.where(np.diag(known) > 0, np.diag(known), 1.0))
    values, vectors = np.linalg.eigh(known / np.outer(scale, scale))
    kept = values > len(known) * np.finfo(float).eps * max(values[-1], 0.0)
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.where(kept, values, 0.0)))


def _factor(fisher: Array) -> Array:
    """Lower triangle of F with a tiny addition to its diagonal: a parameter may be without influence."""
    scale = np.diag(fisher)
    kept = TINY * np.maximum(scale, TINY * scale.max() + np.finfo(float).tiny / TINY)
    return np.asarray(np.linalg.cholesky(fisher + np.diag(kept)), dtype=np.float64)


def _singular(factor: Array) -> bool:
    """Whether F is singular to working precision."""
    pivots: Array = np.diag(factor) ** 2 / np.square(factor).sum(axis=1)
    return bool((pivots < SINGULAR).any())


def greedy(
    columns: Array,
    count: int,
    fixed: Array,
    average: Average,
    criteria: Sequence[Criterion],
    first: NDArray[np.intp] | None = None,
) -> NDArray[np.intp]:
    """Candidates (count,) that are chosen one after the other, each as the best beside those before it and the `first` ones.

    Columns are (S, p, n, N) and `fixed` is (S, p, p), for S scenarios.
    """
    chosen = [] if first is None else first.tolist()
    fishers = []
    for own, known in zip(columns, fixed, strict=True):
        spread = np.einsum("pnk,pnk->p", own, own) / own.shape[2]
        fisher = known + np.diag(np.maximum(1e-8 * spread, np.finfo(float).tiny))
        for place in chosen:
            fisher = fisher + own[:, :, place] @ own[:, :, place].T
        fishers.append(fisher)
    while len(chosen) < count:
        offsets = None
        if not average.is_mean:
            offsets = np.array([criterion.offset(f, np.eye(len(f))) for criterion, f in zip(criteria, fishers, strict=True)])
        ratios = average.ratios(offsets, [one.added(f, own) for one, f, own in zip(criteria, fishers, columns, strict=True)])
        chosen.append(int(np.argmax(ratios)))
        fishers = [fisher + own[:, :, chosen[-1]] @ own[:, :, chosen[-1]].T for fisher, own in zip(fishers, columns, strict=True)]
    return np.array(chosen)
