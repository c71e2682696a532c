"""Which windows of a record to take: weights on all of them first, then windows, then exchanges of one for another.

log det of M = sum of w_k F_k is concave in the weights, so that for any M it is at most log det M + tr(G M') - p of any M' that may
be chosen, with G = M^-1 its derivative. The largest sum of tr(G F_k) over disjoint windows thus bounds what any choice reaches. The
same holds for log det of a Schur complement, where there are nuisance parameters. M moves towards these windows as far as log det
grows; the best of them on the way are exchanged, one for another, until none gains; and the weights are improved once more from
there, until that finds no better windows. `PieceSearchTuning` has the numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from ...basics.stop_reason import StopReason
from ...basics.values import Array
from ...show.numbers import computed, counted
from ...show.progress import Progress
from ..goal.estimable_space import RIDGE, SINGULAR
from .disjoint import Places, Windows
from .tuning import PieceSearchTuning


class Packed:
    """Symmetric matrices of n = nuisance + p rows as vectors of n (n + 1) / 2 numbers.

    `log_dets` and `gradient` are those of the Schur complement of the first rows, which belong to nuisance parameters.
    """

    def __init__(self, p: int, nuisance: int = 0) -> None:
        self.p, self.nuisance, self.size = p, nuisance, p + nuisance
        self._places = np.tril_indices(self.size)
        self._weights = np.where(self._places[0] == self._places[1], 1.0, 2.0)

    def whole(self, packed: Array) -> Array:
        """The matrices (..., n, n)."""
        matrices = np.empty((*packed.shape[:-1], self.size, self.size))
        matrices[..., self._places[0], self._places[1]] = packed
        matrices[..., self._places[1], self._places[0]] = packed
        return matrices

    def of(self, matrices: Array) -> Array:
        """Matrices (..., n, n), packed."""
        return np.asarray(matrices[..., self._places[0], self._places[1]])

    def gradient(self, matrix: Array) -> Array:
        """Gradient of log det at a packed positive definite M: its product with a packed F is tr(G F), G = M^-1 - M_cc^-1."""
        from scipy.linalg import cho_factor, cho_solve

        whole, q = self.whole(matrix), self.nuisance
        solved = cho_solve(cho_factor(whole, lower=True), np.eye(self.size))
        if q:
            solved[:q, :q] -= cho_solve(cho_factor(whole[:q, :q], lower=True), np.eye(q))
        return np.asarray(self.of((solved + solved.T) / 2) * self._weights)

    def log_dets(self, packed: Array) -> Array:
        """log det by Cholesky of all matrices (..., m) at once; -inf where one is not positive definite."""
        matrices = np.moveaxis(self.whole(packed), (-2, -1), (0, 1))
        value = np.zeros(packed.shape[:-1])
        with np.errstate(divide="ignore", invalid="ignore"):
            for j in range(self.size):
                pivot = matrices[j, j]
                if j >= self.nuisance:
                    value += np.log(np.where(pivot > 0, pivot, 0.0))
                below = matrices[j + 1 :, j]
                matrices[j + 1 :, j + 1 :] -= below[:, None] * (below / pivot)[None]
        return np.where(np.isnan(value), -np.inf, value)

    def in_coordinates(self, packed: Array, factor: Array) -> None:
        """Make C^-T F C^-1 of every packed F (K, m), in place, with C upper triangular."""
        from scipy.linalg import solve_triangular

        units = self.whole(np.eye(packed.shape[1]))
        half = np.stack([solve_triangular(factor, unit, trans="T") for unit in units])
        moved = np.stack([solve_triangular(factor, one.T, trans="T").T for one in half])
        change = self.of((moved + moved.transpose(0, 2, 1)) / 2)
        for first in range(0, len(packed), 1 << 16):
            packed[first : first + (1 << 16)] = packed[first : first + (1 << 16)] @ change

    def rank(self, matrix: Array, smallest: float) -> int:
        """Eigenvalues of a packed matrix above a share of the largest."""
        values = np.linalg.eigvalsh(self.whole(matrix))
        return int((values > smallest * max(float(values[-1]), 0.0)).sum())


class PieceSearch:
    """The search for `count` disjoint windows with the largest log det.

    Parameters
    ----------
    f : ndarray, (K, m)
        F of all windows, packed, in coordinates in which their sum is the identity.
    packing : Packed
    windows : Windows
    count : int
        At most as many as there are disjoint windows.
    known : ndarray, (m,), optional
        What is known beside the windows that are chosen, packed; default: nothing.
    tuning : PieceSearchTuning, optional

    Attributes
    ----------
    windows : Windows
    chosen : ndarray of int, (count,)
        The best windows so far, increasing.
    bound : float
        What log det of no `count` disjoint windows exceeds.
    exchanges : int
    ridge : float
        What was added to M, as a share of all windows, while the chosen ones left it singular.
    """

    def __init__(
        self,
        f: Array,
        packing: Packed,
        windows: Windows,
        count: int,
        known: Array | None = None,
        tuning: PieceSearchTuning = PieceSearchTuning(),
    ) -> None:
        self.tuning = tuning
        self._f, self._packing, self.windows, self.count = f, packing, windows, count
        self._known = np.zeros(f.shape[1]) if known is None else known
        self.chosen = windows.most()[:count]
        self.bound, self.exchanges = np.inf, 0
        self._value, self._regular = self.log_det(self.chosen), False
        self.ridge = 0.0

    def log_det(self, chosen: Places) -> float:
        return float(self._packing.log_dets(self._total(chosen)))

    @property
    def singular(self) -> bool:
        """Whether the chosen windows do not determine all parameters."""
        return self._packing.rank(self._total(self.chosen), SINGULAR) < self._packing.size

    @property
    def shares(self) -> Array:
        """tr(G F_k) / p of the chosen windows, G the derivative of log det; where M is not singular.

        They sum up to 1, less the share of what is known of nuisance parameters beforehand.
        """
        gradient = self._packing.gradient(self._total(self.chosen))
        return np.asarray(self._f[self.chosen] @ gradient / self._packing.p)

    def run(self, progress: Callable[[Progress], None] | None = None, started: float = 0.0) -> StopReason:
        """Search until something ends it, and return why."""

        def report() -> None:
            if progress is not None:
                gap = max(0.0, self.bound - self._value)
                below = f", {computed(gap, 3)} below the bound" if np.isfinite(gap) else ""
                message = f"{counted(self.exchanges, 'exchange')}{below}"
                progress(Progress(self.exchanges, None, -gap, message, perf_counter() - started))

        try:
            self._weigh(self._f.sum(axis=0) * (self.count / len(self._f)) + self._known)
            report()
            while True:
                while self._exchange():
                    self.exchanges += 1
                    report()
                    if self.exchanges >= self.tuning.most_exchanges:
                        return StopReason.max_iterations
                before = self._value
                if not self.singular:
                    self._weigh(self._total(self.chosen))
                if not self._value > before:
                    return StopReason.converged
        except KeyboardInterrupt:
            return StopReason.interrupted

    def _total(self, chosen: Places) -> Array:
        return np.asarray(self._f[chosen].sum(axis=0) + self._known)

    def _ridge(self) -> Array:
        """Nothing from when on the chosen windows do not leave M singular."""
        self._regular = self._regular or not self.singular
        if not self._regular:
            self.ridge = RIDGE
        return (0.0 if self._regular else RIDGE) * self._packing.of(np.eye(self._packing.size))

    def _weigh(self, m: Array) -> None:
        """Improve weights on all windows from M = sum of w_k F_k on (Frank and Wolfe 1956); lower the bound, keep the best windows.

        The best windows for the gradient at M are a vertex of what may be chosen, towards which M moves as far as that gains.
        """
        p = self._packing.p
        for _ in range(self.tuning.weight_rounds):
            gradient = self._packing.gradient(m)
            chosen, most = self.windows.best(np.maximum(self._f @ gradient, 0.0), self.count)
            most += float(self._known @ gradient)
            self.bound = min(self.bound, float(self._packing.log_dets(m)) + most - p)
            vertex = self._total(chosen)
            value = float(self._packing.log_dets(vertex))
            if value > self._value or self._value == -np.inf:
                self.chosen, self._value = chosen, value
            if self.bound - self._value < self.tuning.least_gain * p or most - p < self.tuning.least_gain * p:
                return
            m = m + self._step(m, vertex) * (vertex - m)

    def _step(self, m: Array, vertex: Array) -> float:
        """The share of the way from M to another matrix at which log det is largest."""
        low, high = 0.0, 1.0
        for _ in range(self.tuning.line_halvings):
            middle = (low + high) / 2
            slope = self._packing.gradient(m + middle * (vertex - m)) @ (vertex - m)
            low, high = (middle, high) if slope > 0 else (low, middle)
        return low

    def _exchange(self) -> bool:
        """Make the exchange of one window for another that gains most; False where none does.

        As log det is concave, taking j for i gains at most tr(M^-1 (F_j - F_i)); and, with t = tr((M - F_i)^-1 F_j), at most
        p log(1 + t / p) less what i is worth. Pairs are tried in the order of these bounds until the next cannot be the best.
        """
        ridge = self._ridge()
        m = self._total(self.chosen) + ridge
        value = float(self._packing.log_dets(m))
        entering, leaving, most = self._pairs(m, value)
        order = np.argsort(-most, kind="stable")
        best, found = self.tuning.least_gain, -1
        for first in range(0, len(order), self.tuning.pairs_at_once):
            some = order[first : first + self.tuning.pairs_at_once]
            if not most[some[0]] > best:
                break
            totals = m - self._f[self.chosen[leaving[some]]] + self._f[entering[some]]
            gained = self._packing.log_dets(totals) - value
            if gained.max() > best:
                best, found = float(gained.max()), int(some[np.argmax(gained)])
        if found < 0:
            return False
        chosen = self.chosen.copy()
        chosen[leaving[found]] = entering[found]
        chosen.sort()
        self.chosen, self._value = chosen, self.log_det(chosen)
        return True

    def _pairs(self, m: Array, value: float) -> tuple[Places, Places, Array]:
        """Windows that may enter, places of those that would leave for them, and bounds of what that gains, where above zero."""
        packing, p = self._packing, self._packing.p
        gradient = packing.gradient(m)
        gains, own = self._f @ gradient, self._f[self.chosen] @ gradient
        partner = self._partners()
        without = m - self._f[self.chosen]
        worth = value - packing.log_dets(without)
        regular = np.array([packing.rank(one, SINGULAR) == packing.size for one in without]) & np.isfinite(worth)
        slopes = np.stack([packing.gradient(one) if ok else gradient for one, ok in zip(without, regular, strict=True)])
        lost = np.where(partner >= 0, own[np.maximum(partner, 0)], own.min())
        candidates = np.flatnonzero((partner > -2) & (gains - lost > self.tuning.least_gain))
        entering, leaving, bounds = list[Places](), list[Places](), list[Array]()
        each = max(1, self.tuning.numbers_at_once // self.count)
        for first in range(0, len(candidates), each):
            some = candidates[first : first + each]
            most = gains[some][:, None] - own
            closer = p * np.log1p(np.maximum(self._f[some] @ slopes.T, 0.0) / p) - worth
            most = np.where(regular, np.minimum(most, closer), most)
            allowed: NDArray[np.bool_] = (partner[some] == -1)[:, None] | (partner[some][:, None] == np.arange(self.count))
            j, i = np.nonzero(allowed & (most > self.tuning.least_gain))
            entering.append(some[j])
            leaving.append(i)
            bounds.append(most[j, i])
        none = np.empty(0, dtype=np.intp)
        return np.concatenate([none, *entering]), np.concatenate([none, *leaving]), np.concatenate([np.empty(0), *bounds])

    def _partners(self) -> Places:
        """For each window the place of the only chosen one that it shares a sample with; -1 for none, -2 for two or itself."""
        partner = np.full(len(self._f), -1, dtype=np.intp)
        for place, window in enumerate(self.chosen.tolist()):
            near = self.windows.near(window)
            partner[near] = np.where(partner[near] == -1, place, -2)
        partner[self.chosen] = -2
        return partner
