"""The search for the best whole numbers of measurements: exchange over the candidates, deletion, and branch and bound.

The best weights bound every design. Rounded weights and designs with a random half are exchanged over the best candidates; the
linear bound then deletes candidates that no better design can have, and the exchange is repeated over the others. Of copies one is
left. Branch and bound closes or parts boxes of counts until none can have a better design. `ExactTuning` has the numbers.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...basics.stop_reason import StopReason
from ...basics.values import Array
from ...show.progress import Progress
from ..candidates.candidate_rows import CandidateRows
from ..goal.criteria import Criterion
from ..goal.scenario_average import Average
from ..points.pool_exchange import PoolExchange, greedy
from ..weights.rounding import efficient_rounding
from ..weights.weights import Weights
from .branch_and_bound import BranchAndBound, similar_first
from .relaxation import Box, Counts, Relaxation
from .symmetries import symmetries
from .tuning import ExactTuning

COPIES = 1e-10
"""Relative difference of information matrices up to which candidates count as copies."""


@dataclass(frozen=True)
class Limits:
    """What ends a search: by how much of log phi a better design may stay unknown, nodes, and seconds since `started`."""

    gap: float
    max_nodes: int
    time_limit: float | None
    started: float

    def late(self) -> bool:
        return self.time_limit is not None and time.perf_counter() - self.started >= self.time_limit


class FoundCounts(NamedTuple):
    """Counts of the candidates (K,), the proven efficiency, why it ended, nodes, and candidates that were not deleted."""

    counts: Counts
    efficiency: float
    stop_reason: StopReason
    nodes: int
    left: int


class ExactSearch:
    """The state of one search.

    Parameters
    ----------
    pool : CandidateRows
        Of K candidates; a constant is one share of n of what is known before.
    criterion : Criterion
        In the coordinates of what is estimable.
    weights : Weights
        The best ones of all candidates.
    n : int
        Measurements.
    limits : Limits
    rng : numpy.random.Generator
    tuning : ExactTuning, optional
    """

    def __init__(
        self,
        pool: CandidateRows,
        criterion: Criterion,
        weights: Weights,
        n: int,
        limits: Limits,
        rng: np.random.Generator,
        tuning: ExactTuning = ExactTuning(),
    ) -> None:
        self.tuning = tuning
        self._pool, self._criterion, self._weights, self._n, self._limits = pool, criterion, weights, n, limits
        self._rng, self._into = rng, weights.estimable.into
        self._prices = pool.along(weights.half)
        self._base = weights.log_bound - float(np.log(weights.largest))
        self.counts: Counts | None = None
        self.value = -np.inf

    def run(self, progress: Callable[[Progress], None] | None) -> FoundCounts:
        """Search until the best design is known, or something ends it; where none determines enough, the efficiency is 0."""
        left, stop_reason, nodes, bound = np.arange(len(self._pool)), StopReason.interrupted, 0, self._bound()
        search: BranchAndBound | None = None
        limits = self._limits

        def report(nodes: int, still_open: int, efficiency: float) -> None:
            if progress is not None:
                message = f"efficiency at least {efficiency:.4f}, {still_open} open"
                progress(Progress(nodes, limits.max_nodes, efficiency, message, time.perf_counter() - limits.started))

        try:
            left = self._looked_at()
            report(0, 0, self._efficiency(bound))
            if not len(left):
                stop_reason, bound = StopReason.proven, min(bound, self.value + limits.gap)
            elif len(left) > self.tuning.most_left:
                stop_reason = StopReason.too_many_candidates
            elif np.isfinite(self.value):
                search, left = self._branch_and_bound(left)
                box = Box(np.zeros(len(left), dtype=np.int64), self._most(left))
                stop_reason = search.run(box, bound, limits.max_nodes, limits.late, report)
        except KeyboardInterrupt:
            if self.counts is None:
                raise
        assert self.counts is not None
        counts = self.counts
        if search is not None:
            nodes, bound = search.nodes, min(bound, search.bound)
            if search.value > self.value:
                self.value, counts = search.value, np.zeros(len(self._prices), dtype=np.int64)
                counts[left] = search.counts
        return FoundCounts(counts, self._efficiency(bound), stop_reason, nodes, len(left))

    def _efficiency(self, bound: float) -> float:
        """What is proven of the best design so far; 0 where it does not determine enough."""
        return float(np.exp(min(self.value - bound, 0.0))) if np.isfinite(self.value) else 0.0

    def _looked_at(self) -> NDArray[np.intp]:
        """Exchange over the best candidates, and those that are left of all after that."""
        best_first = np.argsort(-self._prices, kind="stable")
        self._exchange(best_first[: self.tuning.exchanged_candidates])
        left = best_first[self._most(best_first) > 0]
        if 1 < len(left) < len(best_first) and not self._limits.late():
            self._exchange(left[: self.tuning.exchanged_candidates])
            left = left[self._most(left) > 0]
        return self._without_copies(left)

    def _bound(self) -> float:
        """Upper bound of log phi of designs of n measurements, by the best weights."""
        return self._weights.log_bound + float(np.log(self._n))

    def _branch_and_bound(self, left: NDArray[np.intp]) -> tuple[BranchAndBound, NDArray[np.intp]]:
        """Branch and bound over the candidates that are left, and their order there."""
        matrices = self._pool.matrices(left, self._into)
        order, parts = similar_first(matrices, self.tuning)
        left, relaxation = left[order], Relaxation(matrices[order], self._criterion, self._n, self.tuning)
        permutations = np.arange(len(left))[None]
        if self._pool.constant is None and self._pool.rows.shape[1] == 1:
            permutations = symmetries(self._pool.rows[left, 0] @ self._into, self._criterion, self.tuning)
        assert self.counts is not None
        start = self.counts[left]
        search = BranchAndBound(relaxation, parts, permutations, start, self._limits.gap)
        # A start that has candidates that are not left, as they are copies of others, keeps its value.
        search.value = max(search.value, self.value) if start.sum() == self._n else self.value
        return search, left

    def _most(self, of: NDArray[np.intp]) -> Counts:
        """How often a better design may have candidates, by the linear bound phi(M) sum_i n_i tr(G F_i)."""
        highest = float(self._prices.max())
        slack = self._n * highest - float(np.exp(self.value + self._limits.gap - self._base))
        if slack <= 0:
            return np.zeros(len(of), dtype=np.int64)
        below = highest - self._prices[of]
        steps = np.full(len(of), float(self._n))
        np.divide(slack, below, out=steps, where=below * self._n > slack)
        most: Counts = np.floor(np.minimum(steps, self._n) * (1 + 1e-9)).astype(np.int64)
        return most

    def _without_copies(self, left: NDArray[np.intp]) -> NDArray[np.intp]:
        """One of those with the same information matrix, that of the best design if there is one."""
        if not len(left) or len(left) > self.tuning.most_left:
            return left
        matrices = self._pool.matrices(left, self._into).reshape(len(left), -1)
        size = np.maximum(np.linalg.norm(matrices, axis=1), 1e-300)[:, None]
        keys = np.round(np.concatenate([matrices / size, np.log(size)], axis=1) / COPIES)
        counts = np.zeros(len(self._prices)) if self.counts is None else self.counts
        order = np.argsort(-counts[left], kind="stable")
        first = np.unique(keys[order], axis=0, return_index=True)[1]
        return np.sort(left[order[first]])

    def _exchange(self, among: NDArray[np.intp]) -> None:
        """Points of designs give way to the best of some candidates until none raises the criterion."""
        among = np.sort(np.union1d(among, self._weights.chosen))
        rows = self._pool.rows[among] @ self._into
        columns = np.ascontiguousarray(np.moveaxis(rows, 0, 2).swapaxes(0, 1))[None]
        known = np.zeros((columns.shape[1],) * 2)
        if self._pool.constant is not None:
            known = self._n * self._into.T @ self._pool.constant @ self._into
        average, criteria = Average.of_all(1), [self._criterion]
        for chosen in self._starts(among, columns, known):
            exchange = PoolExchange(columns, chosen, known[None], average, criteria)
            exchange.run(np.arange(len(among)), lambda: False)
            counts = np.bincount(among[exchange.chosen], minlength=len(self._prices))
            for one in (counts, np.bincount(among[chosen], minlength=len(self._prices))):
                value = self._worth(one)
                if self.counts is None or value > self.value:
                    self.counts, self.value = one, value
            if self._limits.late():
                return

    def _starts(self, among: NDArray[np.intp], columns: Array, known: Array) -> list[NDArray[np.intp]]:
        """The rounded weights, the best so far, and designs with a random half and the best rest beside it."""
        weights, n = self._weights, self._n
        places = np.searchsorted(among, weights.chosen)
        held = np.argsort(-weights.weights, kind="stable")[:n]
        rounded = efficient_rounding(weights.weights[held] / weights.weights[held].sum(), n)
        starts = [np.repeat(places[held], rounded)]
        if self.counts is not None:
            own = np.flatnonzero(self.counts)
            if np.isin(own, among).all():
                starts.append(np.repeat(np.searchsorted(among, own), self.counts[own]))
        average, criteria = Average.of_all(1), [self._criterion]
        for k in range(self.tuning.starts):
            first = self._rng.integers(len(among), size=0 if k == 0 else n // 2)
            starts.append(greedy(columns, n, known[None], average, criteria, first))
        return starts

    def _worth(self, counts: Counts) -> float:
        some = np.flatnonzero(counts)
        information = self._pool.information(some, counts[some].astype(float))
        return self._criterion.log_phi(self._into.T @ information @ self._into)
