"""The best whole numbers of measurements of candidates, by branch and bound on the counts.

A node is a box of counts. What its counts can reach is bounded by the relaxed problem; where that is no better than the best design
so far, none of them is. The linear bound also says how far each count may be from where it is best, which closes most of the box.
Else the box is parted: by the count of a candidate, or by how often a group of similar ones is measured in all. Neighbours on a
fine grid are as good as each other, so that the counts of single ones say little.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...basics.stop_reason import StopReason
from ...basics.values import Array
from .relaxation import Box, Counts, Group, Relaxation, Relaxed, best_in_box
from .symmetries import Permutations
from .tuning import ExactTuning

WHOLE = 1e-6
"""Largest distance of a count from the whole number that it is taken for."""


class _Group(NamedTuple):
    """A group of similar candidates, and how far it is from the next one."""

    first: int
    end: int
    distance: float


@dataclass
class BranchAndBound:
    """The state of one search.

    Parameters
    ----------
    relaxation : Relaxation
        Of K candidates, similar ones beside each other as `similar_first` orders them.
    parts : list of _Group
        Groups that may be parted by how often they are measured.
    permutations : ndarray of int, (G, K)
    counts : ndarray of int, (K,)
        The best design so far.
    gap : float
        By how much of log phi a better design may stay unknown.
    """

    relaxation: Relaxation
    parts: list[_Group]
    permutations: Permutations
    counts: Counts
    gap: float
    nodes: int = 0
    _open: list[tuple[float, int, Box, Array | None]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.value = self._log_phi(self.counts)
        self._pushed, self._doing = 0, -np.inf
        self._limits = np.array([(part.first, part.end) for part in self.parts], dtype=np.intp).reshape(-1, 2)
        self._places = {(part.first, part.end): k for k, part in enumerate(self.parts)}
        self._distances = np.array([part.distance for part in self.parts])

    @property
    def bound(self) -> float:
        """Upper bound of log phi of all designs."""
        return max(self.value + self.gap, self._doing, -self._open[0][0] if self._open else -np.inf)

    @property
    def efficiency(self) -> float:
        return float(np.exp(self.value - self.bound))

    def run(
        self,
        box: Box,
        bound: float,
        max_nodes: int,
        late: Callable[[], bool],
        report: Callable[[int, int, float], None],
    ) -> StopReason:
        """Search a box with a known bound until nothing is open, or something ends it, and return the reason.

        `report` is called with nodes that are done, nodes that are open, and the proven efficiency.
        """
        self._doing = bound
        try:
            inside = box.tightened(self.relaxation.n)
            if inside is not None:
                self._push(bound, inside, None)
            while self._open and -self._open[0][0] > self.value + self.gap:
                if self.nodes >= max_nodes:
                    self._doing = -np.inf
                    return StopReason.max_nodes
                if late():
                    self._doing = -np.inf
                    return StopReason.time_limit
                self._doing = -self._open[0][0]
                _, _, of, start = heapq.heappop(self._open)
                self.nodes += 1
                self._node(self._doing, of, start)
                if self.nodes % self.relaxation.tuning.nodes_per_report == 1:
                    report(self.nodes, len(self._open), self.efficiency)
        except KeyboardInterrupt:
            return StopReason.interrupted
        self._doing = -np.inf
        self._open.clear()
        return StopReason.proven

    def _node(self, known: float, box: Box, start: Array | None) -> None:
        n = self.relaxation.n
        enough = self.value + self.gap
        tolerance = max(self.relaxation.tuning.relaxed_tolerance * (known - self.value), 0.1 * self.gap)
        found = self.relaxation.bounded(box, start, enough, tolerance)
        if found is None or found.bound <= enough:
            return
        self._try(found.counts, box)
        enough = self.value + self.gap
        if found.bound <= enough:
            return
        closer = self._closed_in(found, box, enough)
        if closer is None:
            return
        if (closer.least == closer.most).all():
            self._take(closer.least)
            return
        bound = min(known, found.bound)
        for child in self._parted(closer, np.clip(found.counts, closer.least, closer.most)):
            inside = child.tightened(n)
            if inside is not None:
                own = min(bound, bound_of(found, inside, n))
                if own > enough:
                    self._push(own, inside, found.counts)

    def _push(self, bound: float, box: Box, start: Array | None) -> None:
        self._pushed += 1
        heapq.heappush(self._open, (-bound, self._pushed, box, start))

    def _closed_in(self, found: Relaxed, box: Box, enough: float) -> Box | None:
        """Without counts whose linear bound is below what is known; None where that is all of them."""
        total, price = best_in_box(found.prices, box, self.relaxation.n)
        slack = total + found.offset - float(np.exp(enough - found.base))
        apart = np.abs(found.prices - price)
        steps = np.full(len(apart), 1e9)
        np.divide(slack, apart, out=steps, where=apart > slack * 1e-9)
        steps = np.floor(np.minimum(steps, 1e9) + 1e-9).astype(np.int64)
        most = np.where(found.prices < price, np.minimum(box.most, box.least + steps), box.most)
        least = np.where(found.prices > price, np.maximum(box.least, box.most - steps), box.least)
        return Box(least, most, box.groups).tightened(self.relaxation.n)

    def _parted(self, box: Box, x: Array) -> list[Box]:
        """The box as two, parted where a sum is far from a whole number and its candidates are far from others."""
        totals = self._totals(x)
        least, most = self._totals(box.least), self._totals(box.most)
        for group in box.groups:
            own = self._places[group.first, group.end]
            least[own], most[own] = max(least[own], group.least), min(most[own], group.most)
        broken = np.abs(totals - np.round(totals))
        score = np.where((most > least) & (totals > least) & (totals < most), broken * self._distances, -1.0)
        best = int(np.argmax(score))
        if broken[best] < WHOLE or score[best] <= 0:  # all are whole: any count that is not settled
            first = int(np.argmax(box.most - box.least))
            value = int(np.clip(np.floor(x[first] + WHOLE), box.least[first], box.most[first] - 1))
            return self._by_count(box, first, value)
        first, end, value = self.parts[best].first, self.parts[best].end, int(np.floor(totals[best]))
        if end == first + 1:
            return self._by_count(box, first, value)
        below, above = Group(first, end, int(least[best]), value), Group(first, end, value + 1, int(most[best]))
        return [Box(box.least, box.most, _with(box.groups, group)) for group in (below, above)]

    def _totals(self, counts: Array | Counts) -> Array:
        """Sums over all groups."""
        sums = np.concatenate([[0.0], np.cumsum(counts)])
        return np.asarray(sums[self._limits[:, 1]] - sums[self._limits[:, 0]])

    def _by_count(self, box: Box, one: int, value: int) -> list[Box]:
        """Parted by the count of a candidate, or of any that a symmetry of the box makes as good as it.

        Where any of these is measured more often, a symmetry leads to a design in which this one is.
        """
        alike = np.array([one])
        if len(self.permutations) > 1 and not box.groups:
            of = self.permutations
            kept = (box.least[of] == box.least).all(axis=1) & (box.most[of] == box.most).all(axis=1)
            alike = np.unique(of[kept, one])
        least, most = box.least.copy(), box.most.copy()
        most[alike], least[one] = np.minimum(most[alike], value), value + 1
        return [Box(box.least, most, box.groups), Box(least, box.most, box.groups)]

    def _try(self, x: Array, box: Box) -> None:
        """Whole numbers near the counts: the largest remainders are rounded up."""
        counts = np.floor(x + WHOLE).astype(np.int64)
        left = self.relaxation.n - int(counts.sum())
        if left >= 0:
            counts[np.argsort(counts - x, kind="stable")[:left]] += 1
        if counts.sum() == self.relaxation.n:
            self._take(counts)

    def _take(self, counts: Counts) -> None:
        value = self._log_phi(counts)
        if value > self.value:
            self.counts, self.value = counts.copy(), value

    def _log_phi(self, counts: Counts) -> float:
        some = np.flatnonzero(counts)
        return self.relaxation.criterion.log_phi(np.tensordot(counts[some].astype(float), self.relaxation.matrices[some], 1))


def bound_of(found: Relaxed, box: Box, n: int) -> float:
    """The linear bound of another box with the same or closer bounds of groups."""
    total = found.offset + best_in_box(found.prices, box, n)[0]
    return found.base + float(np.log(total)) if total > 0 else -np.inf


def _with(groups: tuple[Group, ...], new: Group) -> tuple[Group, ...]:
    """The groups with other bounds of one of them."""
    return (*(group for group in groups if (group.first, group.end) != (new.first, new.end)), new)


def similar_first(matrices: Array, tuning: ExactTuning = ExactTuning()) -> tuple[NDArray[np.intp], list[_Group]]:
    """An order (K,) in which similar candidates lie beside each other, and their groups in this order, single ones too."""
    from scipy.cluster.hierarchy import linkage

    count = len(matrices)
    if count < 3:
        return np.arange(count), [_Group(k, k + 1, 1.0) for k in range(count)]
    flat = matrices.reshape(count, -1)
    tree = linkage(flat, method="average") if count <= tuning.most_grouped else _halved(flat)
    size = np.concatenate([np.ones(count, dtype=int), tree[:, 3].astype(int)])
    first = np.zeros(2 * count - 1, dtype=int)
    distance = np.zeros(2 * count - 1)
    for k in range(count - 2, -1, -1):  # from the root down: where each half begins, and how far they are apart
        left, right = int(tree[k, 0]), int(tree[k, 1])
        first[left], first[right] = first[count + k], first[count + k] + size[left]
        distance[left] = distance[right] = max(float(tree[k, 2]), 1e-300)
    within = np.concatenate([np.zeros(count), tree[:, 2]])
    close = np.flatnonzero(within[: 2 * count - 2] <= tuning.tight_share * distance[: 2 * count - 2])
    parts = [_Group(int(first[c]), int(first[c] + size[c]), float(distance[c])) for c in close]
    return np.argsort(first[:count]), parts


def _halved(flat: Array) -> Array:
    """A tree (K - 1, 4) as of `linkage`, by halving from all candidates down along the coordinate in which they differ most."""
    count, splits = len(flat), list[tuple[int, int, float, int]]()
    waiting, parent = [(np.arange(count), -1, 0)], dict[tuple[int, int], int]()
    while waiting:
        some, above, side = waiting.pop()
        if len(some) == 1:
            parent[above, side] = int(some[0])
            continue
        parent[above, side] = count + len(splits)
        along = flat[some, int(np.argmax(np.ptp(flat[some], axis=0)))]
        lower = along <= (along.min() + along.max()) / 2
        if lower.all():  # to rounding they are the same
            lower = np.arange(len(some)) < len(some) // 2
        halves = some[lower], some[~lower]
        apart = float(np.linalg.norm(flat[halves[0]].mean(axis=0) - flat[halves[1]].mean(axis=0)))
        waiting += [(half, len(splits), k) for k, half in enumerate(halves)]
        splits.append((len(splits), 0, apart, len(some)))
    last = len(splits) - 1  # the root comes first here, and last there
    number = {count + k: count + last - k for k in range(len(splits))}
    rows = [(*(number.get(parent[k, side], parent[k, side]) for side in (0, 1)), apart, size) for k, _, apart, size in splits]
    return np.array(rows[::-1], dtype=float)
