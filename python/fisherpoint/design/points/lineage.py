"""Where the points of a search came from, as what raised the criterion on the way mostly raises it further on."""

from __future__ import annotations

import numpy as np

from ...basics.values import Array

GENERATIONS = 6
"""Ancestors of a point that are remembered of it, the nearest."""


class Lineage:
    """The points near which others were drawn that took their places."""

    def __init__(self) -> None:
        self._ancestors: dict[bytes, Array] = {}  # of each point, (n, d), the nearest first

    def add(self, points: Array, parents: Array) -> None:
        """Take in points (K, d), and near which (K, d) they were drawn."""
        for point, parent in zip(points, parents, strict=True):
            before = self._ancestors.get(parent.tobytes())
            own = parent[None] if before is None else np.concatenate([parent[None], before[: GENERATIONS - 1]])
            self._ancestors[point.tobytes()] = own

    def steps(self, points: Array) -> Array:
        """From each of its ancestors to each point (K, d), the nearest first: (K, `GENERATIONS`, d), zero where there is none."""
        result = np.zeros((len(points), GENERATIONS, points.shape[1]))
        for steps, point in zip(result, points, strict=True):
            ancestors = self._ancestors.get(point.tobytes())
            if ancestors is not None:
                np.subtract(point, ancestors, out=steps[: len(ancestors)])
        return result
