"""Places in a region as points of a unit box, and which of them are close to each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ...points.experiments import Experiments
from .point_rows import PointRows


class UnitBox:
    """The region's coordinates that are free, as a unit box."""

    def __init__(self, source: PointRows) -> None:
        region, self.model = source.problem.point_region, source.problem.model
        self.source = source
        self.lower, self.upper = region.box(self.model)
        self.free = np.flatnonzero(self.upper > self.lower)

    def points(self, z: Array) -> Experiments:
        table = np.tile(self.lower, (len(z), 1))
        table[:, self.free] += z * (self.upper - self.lower)[self.free]
        return Experiments.of_table(self.model, np.clip(table, self.lower, self.upper))

    def places(self, points: Experiments) -> Array:
        table = points.table[:, : len(self.lower)]
        return np.asarray(np.clip((table - self.lower)[:, self.free] / (self.upper - self.lower)[self.free], 0.0, 1.0))

    @property
    def difference(self) -> float:
        """Half the distance of central differences: trajectories are known to the tolerance only."""
        return 1e-5 if not self.model.states else float(np.clip(0.3 * np.cbrt(self.source.problem.rtol), 1e-4, 3e-3))


def distinct(z: Array, value: Array, radius: float) -> Array:
    """Places without those closer than a radius to one with a larger value."""
    kept: list[int] = []
    for k in np.argsort(-value):
        if all(np.abs(z[k] - z[other]).max() > radius for other in kept):
            kept.append(int(k))
    return np.asarray(z[np.array(kept, dtype=np.intp)])


def groups_within(z: Array, radius: float) -> NDArray[np.intp]:
    """Numbers (m,) of groups of places that hang together within a radius."""
    group = np.arange(len(z))
    near = np.abs(z[:, None] - z[None]).max(axis=2) <= radius
    for _ in range(len(z)):
        smallest = np.where(near, group[None], len(z)).min(axis=1)
        if (smallest == group).all():
            break
        group = smallest
    return np.unique(group, return_inverse=True)[1]
