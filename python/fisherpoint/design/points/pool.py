"""Candidates with all that exchanges need."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ...information.point_information import PointInformation


class Pool:
    """Candidates, and their whitened rows in each scenario as columns (S, p, n, N).

    `valid` is 1 of those that are valid on all nodes of the rule, -1 of those that are not, and 0 where it is not known.
    """

    def __init__(self, information: PointInformation, columns: Array, valid: int = 0) -> None:
        self.information, self.columns = information, columns
        self.valid = np.full(len(information), valid, dtype=np.int8)

    def __len__(self) -> int:
        return len(self.valid)

    def __getitem__(self, rows: NDArray[np.intp]) -> Pool:
        some = Pool(self.information[rows], self.columns.take(rows, axis=3))
        some.valid = self.valid[rows]
        return some

    def with_more(self, other: Pool) -> Pool:
        """These candidates and then those of another pool."""
        if not len(other):
            return self
        both = Pool(
            PointInformation.join([self.information, other.information]), np.concatenate([self.columns, other.columns], axis=3)
        )
        both.valid = np.concatenate([self.valid, other.valid])
        return both


def far_apart(table: Array, width: Array, gains: Array, most: int, apart: float) -> NDArray[np.intp]:
    """Rows of a table (K, d), one after the other that with the largest gain that is far from those before it, `most` at most."""
    order = np.argsort(-gains, kind="stable")
    places = np.ascontiguousarray((table[order] / np.where(width > 0, width, 1.0)).T)
    free, chosen = np.ones(len(order), dtype=bool), list[int]()
    while len(chosen) < most and free.any():
        chosen.append(int(np.argmax(free)))
        free &= (np.abs(places - places[:, chosen[-1:]]) > apart).any(axis=0)
    return np.asarray(order[np.array(chosen, dtype=np.intp)])


def best_of_each(gains: Array, of: NDArray[np.intp], least: Array, most: int) -> NDArray[np.intp]:
    """Which candidates gain more than the least for what they are `of`, the `most` best for each."""
    rows = np.flatnonzero(gains > least[of])
    rows = rows[np.lexsort((-gains[rows], of[rows]))]
    rank = np.arange(len(rows)) - np.searchsorted(of[rows], of[rows])
    return np.asarray(rows[rank < most])
