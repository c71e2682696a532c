"""Exchange of a design's points for those of a pool, of which all rows are at hand.

In each scenario, F is the sum of W W^T over the points, W (p, n) the whitened rows of a point as columns. With F = L L^T,
det(F + W W^T) / det F = det(I + G^T G), G = L^-1 W (the matrix determinant lemma). Columns of all candidates lie side by side,
(p, n, N), so that each operation is one over all of them, and no library starts threads for it. What is compared is the average of
log det F over the scenarios.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ..average import Average

LEAST_RATIO = 1 + 1e-6
"""By which an exchange must raise det F; less would go on for ever."""

FEW = 20_000
"""Numbers of columns up to which the linear algebra library divides them, without threads."""

SMALL = 1e-4
"""What is added to F where a design is singular; and the square root of the pivot, as a share, below which it is."""

MOST_PASSES = 30
"""Over all points of a design."""

TINY = 1e-10
"""What F keeps of itself where a point leaves it: with as few points as parameters it is singular then."""


def divided(factor: Array, columns: Array) -> Array:
    """L^-1 W of columns (p, ...), by substitution; L (p, p) is a lower triangle."""
    if columns.size < FEW:
        return np.asarray(np.linalg.solve(factor, columns.reshape(len(factor), -1)), dtype=np.float64).reshape(columns.shape)
    result = np.empty_like(columns)
    for i in range(len(factor)):
        rest = columns[i].copy()
        for j in range(i):
            rest -= factor[i, j] * result[j]
        result[i] = rest / factor[i, i]
    return result


def gains(fisher: Array, columns: Array) -> Array:
    """det(F + W W^T) / det F, (N,), of columns (p, n, N)."""
    factor = np.asarray(np.linalg.cholesky(fisher), dtype=np.float64)
    g = divided(factor, columns)
    p, n = g.shape[:2]
    if n > p:
        return _determinants(np.einsum("pnk,qnk->pqk", g, g) + np.eye(p)[:, :, None])
    return _determinants(np.einsum("pnk,pmk->nmk", g, g) + np.eye(n)[:, :, None])


def _determinants(matrices: Array) -> Array:
    """Of positive definite matrices (n, n, N), which are overwritten."""
    result: Array = matrices[0, 0].copy()
    for k in range(len(matrices) - 1):
        for i in range(k + 1, len(matrices)):
            matrices[i, k + 1 :] -= matrices[i, k] / matrices[k, k] * matrices[k, k + 1 :]
        result *= matrices[k + 1, k + 1]
    return result


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
    """

    def __init__(self, columns: Array, chosen: NDArray[np.intp], fixed: Array, average: Average) -> None:
        self.chosen, self._average = chosen.copy(), average
        self._parts = [_Part(columns[s], chosen, fixed[s]) for s in range(len(fixed))]

    def promising(self, among: NDArray[np.intp], most: int, place: NDArray[np.intp] | None = None) -> NDArray[np.intp]:
        """For every point the `most` best of some candidates that raise det F in its place, all together.

        Where the `place` of each candidate is given, it is looked at there alone.
        """
        found = [np.empty(0, dtype=np.intp)]
        for own in self._distinct():
            some = among if place is None else among[place == own]
            if len(some):
                ratios = self._ratios(own, self._taken(np.append(some, self.chosen[own])))
                ratios, least = ratios[:-1], LEAST_RATIO * ratios[-1]
                best = np.argpartition(-ratios, most)[:most] if len(ratios) > most else np.arange(len(ratios))
                found.append(some[best[ratios[best] > least]])
        return np.unique(np.concatenate(found))

    def run(self, among: NDArray[np.intp], late: Callable[[], bool]) -> None:
        """Replace points by the best of some candidates, its own ones with them, until none raises det F any more."""
        columns = [np.ascontiguousarray(taken) for taken in self._taken(among)]
        for _ in range(MOST_PASSES):
            changed = False
            for own in self._distinct():
                if late():
                    return
                ratios = self._ratios(own, columns)
                best = int(np.argmax(ratios))
                if ratios[best] > LEAST_RATIO * ratios[np.searchsorted(among, self.chosen[own])]:
                    self.chosen[own], changed = among[best], True
            if not changed:
                return

    def _distinct(self) -> NDArray[np.intp]:
        """Places of the points, one of those that are the same."""
        return np.sort(np.unique(self.chosen, return_index=True)[1])

    def _taken(self, among: NDArray[np.intp]) -> list[Array]:
        return [part.columns[:, :, among] for part in self._parts]

    def _ratios(self, place: int, columns: Sequence[Array]) -> Array:
        """By how much each of some columns raises det F without the point at a place."""
        rest = np.delete(self.chosen, place)
        without = [part.without(rest) for part in self._parts]
        log_dets = None
        if not self._average.is_mean:
            log_dets = np.array([part.log_det + np.linalg.slogdet(f)[1] for part, f in zip(self._parts, without, strict=True)])
        return self._average.ratios(log_dets, [gains(f, w) for f, w in zip(without, columns, strict=True)])


class _Part:
    """One scenario: its columns (p, n, N) in coordinates in which F is about I, and log det of the F that is I there."""

    def __init__(self, columns: Array, chosen: NDArray[np.intp], fixed: Array) -> None:
        own, least = columns[:, :, chosen], TINY
        # In such coordinates the scales of F do not matter, nor what is added to it.
        factor = _factor(np.einsum("pnk,qnk->pq", own, own) + fixed)
        if _singular(factor):  # then in those of the candidates, and with more of I, so that it can be told what is missing
            factor = _factor(np.einsum("pnk,qnk->pq", columns, columns) * len(chosen) / columns.shape[2] + fixed)
            least = SMALL
        self.columns = divided(factor, columns)
        half = np.linalg.solve(factor, fixed)
        self._fixed = np.linalg.solve(factor, half.T) + least * np.eye(len(fixed))
        self.log_det = 2 * float(np.log(np.diag(factor)).sum())

    def without(self, rest: NDArray[np.intp]) -> Array:
        """F of some points alone, to which next to nothing is added."""
        columns = self.columns[:, :, rest]
        fisher = np.einsum("pnk,qnk->pq", columns, columns) + self._fixed
        return np.asarray(fisher + TINY * np.diag(np.diag(fisher)))


def _factor(fisher: Array) -> Array:
    """A lower triangle of F, to which next to nothing is added: a parameter may be without influence."""
    scale = np.diag(fisher)
    kept = TINY * np.maximum(scale, TINY * scale.max() + np.finfo(float).tiny / TINY)
    return np.asarray(np.linalg.cholesky(fisher + np.diag(kept)), dtype=np.float64)


def _singular(factor: Array) -> bool:
    """Whether F is singular to working precision."""
    pivots: Array = np.diag(factor) ** 2 / np.square(factor).sum(axis=1)
    return bool((pivots < SMALL**2).any())


def greedy(columns: Array, count: int, fixed: Array, average: Average, first: NDArray[np.intp] | None = None) -> NDArray[np.intp]:
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
        log_dets = None if average.is_mean else np.array([np.linalg.slogdet(fisher)[1] for fisher in fishers])
        ratios = average.ratios(log_dets, [gains(fisher, own) for fisher, own in zip(fishers, columns, strict=True)])
        chosen.append(int(np.argmax(ratios)))
        fishers = [fisher + own[:, :, chosen[-1]] @ own[:, :, chosen[-1]].T for fisher, own in zip(fishers, columns, strict=True)]
    return np.array(chosen)
