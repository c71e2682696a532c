"""Where the points of a search came from, as what raised the criterion on the way mostly raises it further on."""

from __future__ import annotations

import numpy as np

from ...basics.values import Array


class Lineage:
    """The points near which others were drawn that took their places; so many `generations` are looked back."""

    def __init__(self, generations: int) -> None:
        self._generations = generations
        self._parents: dict[bytes, Array] = {}

    def add(self, points: Array, parents: Array) -> None:
        """Take in points (K, d), and near which (K, d) they were drawn."""
        self._parents.update((point.tobytes(), parent) for point, parent in zip(points, parents, strict=True))

    def steps(self, points: Array) -> Array:
        """From each of its ancestors to each point (K, d), the nearest first: (K, generations, d), zero where there is none.

        Of an ancestor that was drawn near several points one after the other, the last of these is the next.
        """
        result = np.zeros((len(points), self._generations, points.shape[1]))
        for steps, point in zip(result, points, strict=True):
            ancestor = point
            for step in steps:
                parent = self._parents.get(ancestor.tobytes())
                if parent is None:
                    break
                step[:] = point - parent
                ancestor = parent
        return result
