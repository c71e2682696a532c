"""Windows of a record that share no sample: as many as there are, and those of the largest gains together."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array

Places = NDArray[np.intp]

ROUNDS = 60
"""Halvings of the price of a window, after which it is known to the last digits."""


class Windows(NamedTuple):
    """Windows by their first samples (K,), which increase, all of one length."""

    first: Places
    length: int

    @property
    def overlap(self) -> bool:
        """Whether any two share a sample."""
        return bool((np.diff(self.first) < self.length).any())

    def near(self, window: int) -> slice:
        """The windows that share a sample with this one, itself among them."""
        at = self.first[window]
        low, high = np.searchsorted(self.first, [at - self.length + 1, at + self.length])
        return slice(int(low), int(high))

    def most(self) -> Places:
        """As many disjoint windows as there can be: always the next one that begins behind the last."""
        following = np.searchsorted(self.first, self.first + self.length).tolist()
        chosen, window = [], 0
        while window < len(following):
            chosen.append(window)
            window = following[window]
        return np.array(chosen, dtype=np.intp)

    def best(self, gains: Array, count: int) -> tuple[Places, float]:
        """Disjoint windows, `count` of them, of large gains (K,) >= 0, and what no `count` disjoint ones exceed together.

        Each window has a price, which is set so that the best windows at that price are as many as required: for equal lengths
        there is such a price, and what they gain is the bound, but for windows of equal gains.
        """
        if not self.overlap:
            chosen = np.sort(np.argsort(-gains, kind="stable")[:count])
            return chosen, float(gains[chosen].sum())
        ordered = np.sort(gains)[::-1]
        high, low = float(ordered[0]), float(ordered[count - 1])
        bound, few = np.inf, count
        chosen, value = self._at_price(gains, low)
        while len(chosen) < count:  # windows that overlap need a lower price
            bound, high = min(bound, value + count * low), low
            few *= 2
            low = float(ordered[few - 1]) if few <= len(ordered) else -float(ordered.sum()) - 1.0
            chosen, value = self._at_price(gains, low)
        bound = min(bound, value + count * low)
        for _ in range(ROUNDS):
            price = (low + high) / 2
            if len(chosen) == count or not low < price < high:
                break
            some, value = self._at_price(gains, price)
            bound = min(bound, value + count * price)
            if len(some) < count:
                high = price
            else:
                low, chosen = price, some
        least = np.argsort(-gains[chosen], kind="stable")[:count]
        return chosen[np.sort(least)], bound

    def _at_price(self, gains: Array, price: float) -> tuple[Places, float]:
        """Disjoint windows of the largest sum of gains less prices, and that sum."""
        rows = np.flatnonzero(gains > price)
        first = self.first[rows]
        before = np.searchsorted(first, first - self.length, side="right").tolist()  # windows that end before each begins
        worth, taken = [0.0], []
        for gain, others in zip((gains[rows] - price).tolist(), before, strict=True):
            with_it = worth[others] + gain
            taken.append(with_it > worth[-1])
            worth.append(max(with_it, worth[-1]))
        chosen, window = [], len(rows) - 1
        while window >= 0:
            if taken[window]:
                chosen.append(window)
                window = before[window] - 1
            else:
                window -= 1
        return rows[chosen[::-1]], worth[-1]
