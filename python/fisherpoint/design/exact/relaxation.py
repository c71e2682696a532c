"""The best counts of candidates that need not be whole numbers, within bounds: what no whole ones in these bounds can exceed.

Maximised is log phi(sum_i x_i F_i) over l <= x <= u with sum x = n, and bounds of sums over groups of candidates, by a primal-dual
interior point method. What is proven does not depend on how far that has come: with G the derivative of log phi at any M,

    phi(X) <= phi(M) tr(G X)    for every X = sum_i x_i F_i,

which is linear in x, and multipliers y of the groups' bounds move these into the objective: of what is left the maximum over the
box is known at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ..goal.criteria import Criterion, Slope
from ..weights.interior_criteria import mean_of
from .tuning import ExactTuning

Counts = NDArray[np.int64]


class Group(NamedTuple):
    """How often the candidates from `first` to before `end` are measured in all."""

    first: int
    end: int
    least: int
    most: int


@dataclass(frozen=True, eq=False)
class Box:
    """Bounds of the counts of K candidates.

    Attributes
    ----------
    least, most : ndarray of int, (K,)
    groups : tuple of Group
    """

    least: Counts
    most: Counts
    groups: tuple[Group, ...] = ()

    def tightened(self, n: int) -> Box | None:
        """Without what the sums exclude; None where no counts are left."""
        least, most = self.least, self.most
        for group in (*self.groups, Group(0, len(least), n, n)):
            if group.least > group.most:
                return None
            part = slice(group.first, group.end)
            low, high = int(least[part].sum()), int(most[part].sum())
            if low > group.most or high < group.least:
                return None
            most = most.copy()
            most[part] = np.minimum(most[part], least[part] + group.most - low)
            least = least.copy()
            least[part] = np.maximum(least[part], most[part] - np.maximum(int(most[part].sum()) - group.least, 0))
        return None if (least > most).any() else Box(least, most, self.groups)


class Relaxed(NamedTuple):
    """Counts that need not be whole (K,), log phi there, and the bound: log phi(X) <= base + log(offset + sum_i prices_i x_i)."""

    counts: Array
    base: float
    prices: Array
    offset: float
    bound: float


class Relaxation:
    """The relaxed problem of some information matrices.

    Parameters
    ----------
    matrices : ndarray, (K, r, r)
    criterion : Criterion
        Of these.
    n : int
        What the counts sum to.
    tuning : ExactTuning, optional
    """

    def __init__(self, matrices: Array, criterion: Criterion, n: int, tuning: ExactTuning = ExactTuning()) -> None:
        self.tuning = tuning
        self.matrices, self.criterion, self.n = matrices, criterion, n
        self._flat = matrices.reshape(len(matrices), -1)

    def bounded(self, box: Box, start: Array | None, enough: float, tolerance: float) -> Relaxed | None:
        """Near the best counts within a box; None where all matrices there are zero.

        Ends early where the bound is below what is `enough`.
        """
        x = self._inside(box, start)
        slope = self._slope(x, self.tuning.smoothing[1])
        if slope is None:
            return None
        free = np.flatnonzero(box.most > box.least)
        best = self._at(box, x, slope, np.zeros(len(box.groups)))
        if not len(free):
            return best
        some = free
        if len(free) > 1.5 * self.tuning.working_candidates:
            some = self._promising(free, best, x - box.least)
            fewer = self._inside(box, x, some)
            if self._slope(fewer, self.tuning.smoothing[1]) is None:
                some = free
            else:
                x = fewer
        for _ in range(self.tuning.working_rounds):
            best, x = self._solved(box, some, x, enough, tolerance, best)
            if best.bound <= enough or len(some) == len(free):
                break
            wanted = free[best.prices[free] >= self._price(box, best)]
            more = np.setdiff1d(wanted, some)
            if not len(more):
                break
            some = np.union1d(some, more[np.argsort(-best.prices[more], kind="stable")[: self.tuning.working_candidates]])
            x = self._inside(box, x, some)
        return best

    def _promising(self, free: NDArray[np.intp], best: Relaxed, above: Array) -> NDArray[np.intp]:
        order = np.argsort(-best.prices[free], kind="stable")[: self.tuning.working_candidates]
        held = np.argsort(-above[free], kind="stable")[: self.tuning.working_candidates // 2]
        return np.union1d(free[order], free[held])

    def _price(self, box: Box, at: Relaxed) -> float:
        """What one measurement more would be worth."""
        return best_in_box(at.prices, box, self.n)[1]

    def _inside(self, box: Box, start: Array | None, some: NDArray[np.intp] | None = None) -> Array:
        """Counts that sum to n, within their bounds, and of others than some at the lower ones."""
        least, most = box.least.astype(float), box.most.astype(float)
        if some is not None:
            most = least.copy()
            most[some] = box.most[some]
        room = most - least
        middle = least + room * ((self.n - least.sum()) / max(room.sum(), 1.0))
        if start is None:
            return np.asarray(middle)
        share = self.tuning.middle_share
        x = (1 - share) * np.clip(start, least, most) + share * middle
        left = self.n - x.sum()
        room = most - x if left > 0 else x - least
        return np.asarray(x + left * room / max(room.sum(), 1e-300))

    def _slope(self, x: Array, share: float) -> Slope | None:
        """The derivative at the counts; where these determine too little, next to them, where the bound holds too."""
        matrix = mean_of(self.matrices, x)
        size = float(np.trace(matrix)) / len(matrix)
        for ridge in self.tuning.ridges:
            try:
                return self.criterion.slope(matrix + ridge * size * np.eye(len(matrix)), share)
            except np.linalg.LinAlgError:
                continue
        return None

    def _at(self, box: Box, x: Array, slope: Slope, y: Array) -> Relaxed:
        """The bound by the tangent at x and the multipliers y of the groups."""
        prices, offset = self._flat @ slope.gradient.ravel(), 0.0
        for group, one in zip(box.groups, y.tolist(), strict=True):
            prices[group.first : group.end] += one
            offset -= one * (group.least if one > 0 else group.most)
        total = offset + best_in_box(prices, box, self.n)[0]
        bound = slope.log_phi + float(np.log(total)) if total > 0 else -np.inf
        return Relaxed(x, slope.log_phi, prices, offset, bound)

    def _solved(
        self, box: Box, some: NDArray[np.intp], x: Array, enough: float, tolerance: float, best: Relaxed
    ) -> tuple[Relaxed, Array]:
        """Steps over some of the counts; the best bound, with the last counts."""
        low, high = box.least[some].astype(float), box.most[some].astype(float)
        of = np.array([(some >= group.first) & (some < group.end) for group in box.groups], dtype=float).reshape(-1, len(some))
        others = np.ones(len(x), dtype=bool)
        others[some] = False
        held = np.array([float(x[g.first : g.end][others[g.first : g.end]].sum()) for g in box.groups])
        lo = np.array([g.least for g in box.groups]) - held - self.tuning.group_widening
        hi = np.array([g.most for g in box.groups]) - held + self.tuning.group_widening
        t = np.clip(of @ x[some], lo + 0.1 * (hi - lo), hi - 0.1 * (hi - lo))
        matrices, total, now = self.matrices[some], float(x[some].sum()), x.copy()
        slope = self._slope(now, self.tuning.smoothing[1])
        mu = share = 0.0
        a = b = np.empty(0)
        c = d = np.zeros(len(t))
        for step in range(self.tuning.relaxed_steps):
            if slope is None:
                break
            at = self._at(box, now.copy(), slope, c - d)
            best = at if at.bound < best.bound else best._replace(counts=at.counts)
            if best.bound <= enough or at.bound - slope.log_phi < tolerance:
                break
            w = now[some]
            below, above, under, over = w - low, high - w, t - lo, hi - t
            if not step:
                mu = max(0.1 * (at.bound - slope.log_phi), 1e-9) / len(some)
                a, b, c, d = mu / below, mu / above, mu / under, mu / over
            else:
                pairs = 2 * (len(w) + len(t))
                mu = self.tuning.shrinking * float(a @ below + b @ above + c @ under + d @ over) / pairs
            moved = _step(slope, matrices, of, (w, t, low, high, lo, hi), (a, b, c, d), mu, total)
            if moved is None:
                break
            dw, dt, *changes = moved
            length = _longest((below, above, under, over), (dw, -dw, dt, -dt), self.tuning.boundary_share)
            of_duals = _longest((a, b, c, d), tuple(changes), self.tuning.boundary_share)
            share = float(np.clip(0.1 * (at.bound - slope.log_phi), *self.tuning.smoothing))
            for _ in range(8):
                tried = now.copy()
                tried[some] = w + length * dw
                new = self._slope(tried, share)
                if new is not None:
                    break
                length /= 2
            now, slope, t = tried, new, t + length * dt
            a, b, c, d = (one + of_duals * by for one, by in zip((a, b, c, d), changes, strict=True))
        return best, now


def best_in_box(prices: Array, box: Box, n: int) -> tuple[float, float]:
    """The largest sum_i prices_i x_i over counts that sum to n, and the price of the last one that is taken."""
    order = np.argsort(-prices, kind="stable")
    room = (box.most - box.least)[order]
    left = n - int(box.least.sum())
    taken = np.minimum(room, np.maximum(left - (np.cumsum(room) - room), 0))
    last = int(np.flatnonzero(taken)[-1]) if left > 0 and taken.any() else 0
    return float(prices @ box.least + prices[order] @ taken), float(prices[order[last]])


def _step(
    slope: Slope, matrices: Array, of: Array, at: tuple[Array, ...], duals: tuple[Array, ...], mu: float, total: float
) -> tuple[Array, ...] | None:
    """Newton's step of the counts, the sums over groups, and the multipliers of their bounds."""
    (w, t, low, high, lo, hi), (a, b, c, d) = at, duals
    below, above, under, over = w - low, high - w, t - lo, hi - t
    if min(float(np.min(one, initial=1.0)) for one in (below, above, under, over)) <= 0:  # by rounding
        return None
    of_counts, of_sums, missing = a / below + b / above, c / under + d / over, of @ w - t
    size = 1 / np.sqrt(of_counts)
    system = (-slope.curvature(matrices) + (of.T * of_sums) @ of) * np.outer(size, size)
    system[np.diag_indices_from(system)] += 1.0
    towards = slope.along(matrices) + mu / below - mu / above + of.T @ (mu / under - mu / over - of_sums * missing)
    sides = np.column_stack([towards, np.ones(len(w))]) * size[:, None]
    if not (np.isfinite(system).all() and np.isfinite(sides).all()):
        return None
    try:
        with_g, with_one = (np.linalg.solve(system, sides) * size[:, None]).T
    except np.linalg.LinAlgError:
        return None
    if not with_one.sum() > 0:
        return None
    nu = float(with_g.sum() - (total - w.sum())) / float(with_one.sum())
    dw = with_g - nu * with_one
    dt = of @ dw + missing
    return (
        dw,
        dt,
        mu / below - a - a / below * dw,
        mu / above - b + b / above * dw,
        mu / under - c - c / under * dt,
        mu / over - d + d / over * dt,
    )


def _longest(sizes: tuple[Array, ...], changes: tuple[Array, ...], boundary_share: float) -> float:
    """The length of a step on which all sizes stay positive."""
    falling = max(float(np.max(-change / size, initial=0.0)) for size, change in zip(sizes, changes, strict=True))
    return min(1.0, boundary_share / max(falling, 1e-300))
