"""What every program is asked for, and the form that the task takes for it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from itertools import pairwise

import numpy as np

import fisherpoint as fp

from ..accuracy import root_mean_square
from ..scipy_peer import K_U, pieces
from ..workload import MODEL, OUTPUT_ROWS, STATE_SCALES, Array, Pairs, random_pairs


@dataclass(frozen=True)
class Solution:
    """Outputs (K, n_y), dy/dtheta (K, n_y, p) where asked for, and attempted steps per pair where the program tells."""

    y: Array
    dy_dtheta: Array | None = None
    steps: float | None = None

    @staticmethod
    def of_states(x: Array, steps: float | None = None, dx_dtheta: Array | None = None) -> Solution:
        """Take the outputs from states (K, n_x) and dx/dtheta (K, n_x, p)."""
        return Solution(x[:, OUTPUT_ROWS], None if dx_dtheta is None else dx_dtheta[:, OUTPUT_ROWS], steps)


class Peer(ABC):
    """One program, at one way of using it.

    Attributes
    ----------
    name : str
    compiled : bool
        Whether it is fast enough for the large sample.
    has_sensitivities : bool
    """

    name: str
    compiled: bool = True
    has_sensitivities: bool = True

    @abstractmethod
    def outputs(self, pairs: Pairs, rtol: float) -> Solution:
        """Solve for the outputs. Equal experiment points follow each other in `pairs`, their nodes in the grid's order."""

    def sensitivities(self, pairs: Pairs, rtol: float) -> Solution:
        """Solve for outputs and dy/dtheta."""
        raise NotImplementedError(f"{self.name} has no sensitivities")

    def states_task(self, pairs: Pairs, rtol: float) -> tuple[int, Callable[[], object]]:
        """Return what is timed, and how many trajectories it makes."""
        return len(pairs), partial(self.outputs, pairs, rtol)

    def sensitivities_task(self, pairs: Pairs, rtol: float) -> tuple[int, Callable[[], object]]:
        return len(pairs), partial(self.sensitivities, pairs, rtol)


@dataclass(frozen=True)
class Span:
    """A time over which the spool stays on one side of its centre."""

    begin: float
    end: float
    opens_a: bool


@dataclass(frozen=True)
class Block:
    """One experiment point with many parameter sets (n, p)."""

    rows: slice
    x0: Array
    u: float
    dt: float
    theta: Array

    @property
    def motion(self) -> float:
        return 1.0 if self.x0[1] > 0 else -1.0

    @property
    def target(self) -> float:
        """Where the spool goes."""
        return K_U * self.u

    @property
    def spans(self) -> list[Span]:
        """Everything, or before and after x_v = 0: steps that end there keep their order, and the time is known."""
        parts = pieces(float(self.x0[4]), self.u, self.dt)
        sides = [bool(self.x0[4] > 0), self.target > 0]
        return [Span(begin, end, side) for (begin, end), side in zip(parts, sides, strict=False)]


def blocks(pairs: Pairs, most: int | None = None) -> Iterator[Block]:
    """Yield the runs of equal experiment points, in parts of at most `most` pairs."""
    points = table(pairs)
    starts = [0, *(np.flatnonzero((points[1:] != points[:-1]).any(axis=1)) + 1).tolist(), len(points)]
    for begin, end in pairwise(starts):
        row, step = points[begin], most or end - begin
        for first in range(begin, end, step):
            rows = slice(first, min(first + step, end))
            yield Block(rows, row[:5], float(row[5]), float(row[6]), pairs.theta[rows])


def table(pairs: Pairs) -> Array:
    """Return the experiment points as rows of x0, u and dt, (K, 7)."""
    return np.column_stack([pairs.points.x0, pairs.points.u, pairs.points.dt])


@cache
def sensitivity_scales() -> Array:
    """Return the size of each entry of dx/dtheta, (n_x, p): every entry is held to its own, and those that are zero to one."""
    pairs = random_pairs(8, seed=5)
    size = root_mean_square(fp.sensitivities(MODEL, pairs.points, pairs.theta).dx_dtheta)
    return np.where(size > 0, size, 1.0)


@cache
def column_scales() -> Array:
    """Return for each parameter the change that moves some state by about its scale, (p,).

    For programs that hold every entry of the scaled dx/dtheta to the same tolerance.
    """
    moving = sensitivity_scales() * (sensitivity_scales() != 1.0)
    return np.asarray(1 / np.max(moving / STATE_SCALES[:, None], axis=0))
