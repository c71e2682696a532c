"""The values of a profile on both sides of the estimate, outward to where each side ends."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.stop_reason import StopReason
from ..basics.values import Array

STEPS = 6
"""Values between the estimate and an end, about."""

FAR = 1e4
"""Distance, in half linear intervals, up to which an end is looked for."""

PRECISE = 1e-7
"""Error of the root of the deviance at an end, as a share of the threshold's."""

FINEST = 1e-10
"""Width of the bracket of an end, in half linear intervals, at which its search stops."""

Minimum = Callable[[Array], tuple[Array, Array, NDArray[np.bool_]]]
"""From coordinates (B, P), of which the profiled one stays: where the minimum over the others is, its deviance, or inf, and whether
the search came to it; one that did not leaves the deviance too large."""


class Point(NamedTuple):
    """A value of the profile."""

    z: Array  # (P,)
    deviance: float
    converged: bool


class Side:
    """The values on one side of the estimate, outward, and where that side ends."""

    def __init__(self, z: Array, tangent: Array, j: int, sign: int, reach: float, limit: float, finest: float) -> None:
        self.points = [Point(z, 0.0, True)]
        self.how: StopReason | None = None
        self.tangent, self.j, self.limit = tangent, j, limit
        self.step, self.least, self.farthest = sign * reach / STEPS, 1e-6 * reach, FAR * reach
        self.finest = finest
        self.end = z

    @property
    def ended(self) -> StopReason:
        """Why this side ended: where nothing did, it was searched as far as is allowed."""
        return self.how or StopReason.not_bounded

    @property
    def last(self) -> Point:
        return self.points[-1]

    def guess(self) -> Array:
        """The next coordinates (P,): the profiled one a step further, the others as they went before."""
        z, before = self.last.z, self.points[-2].z if len(self.points) > 1 else None
        along = self.tangent if before is None else (z - before) / (z[self.j] - before[self.j])
        at = np.clip(z[self.j] + self.step, *sorted((z[self.j], self.limit)))
        guess: Array = z + along * (at - z[self.j])
        guess[self.j] = at
        return guess

    def take(self, point: Point, threshold: float) -> None:
        """Add the point, choose the next step from the rise of the deviance's root, and see whether this side has ended."""
        if not np.isfinite(point.deviance):
            self.step /= 2
            if abs(self.step) < self.least:
                self.how, self.end = StopReason.not_evaluable, self.last.z
            return
        rise = np.sqrt(max(point.deviance, 0.0)) - np.sqrt(max(self.last.deviance, 0.0))
        wanted = np.sqrt(threshold) / STEPS
        self.step *= 2.0 if rise < wanted / 2 else float(np.clip(wanted / rise, 0.25, 2.0))
        start = self.points[0].z[self.j]
        self.points.append(point)
        if point.deviance >= threshold:
            self.how = StopReason.converged
        elif point.z[self.j] == self.limit:
            self.how, self.end = StopReason.at_bound, point.z
        elif abs(point.z[self.j] - start) > self.farthest:
            self.how, self.end = StopReason.not_bounded, point.z


def walk(sides: list[Side], held: Minimum, threshold: float, most: int = 200) -> None:
    """Go outward on both sides together, each value from the one before."""
    for side in sides:
        if side.points[0].z[side.j] == side.limit:
            side.how = StopReason.at_bound
    for _ in range(most):
        going = [side for side in sides if not side.how]
        if not going:
            return
        for side, *found in zip(going, *held(np.array([side.guess() for side in going])), strict=True):
            side.take(Point(found[0], float(found[1]), bool(found[2])), threshold)
    for side in sides:
        side.how, side.end = side.how or StopReason.not_bounded, side.end if side.how else side.last.z


def refine(sides: list[Side], held: Minimum, threshold: float, most: int = 60) -> None:
    """Find where the root of the deviance meets that of the threshold, by Illinois' variant of the false position on both sides."""
    root = np.sqrt(threshold)
    open_ = [side for side in sides if side.how == StopReason.converged]
    inner = {side: (side.points[-2], np.sqrt(max(side.points[-2].deviance, 0.0)) - root) for side in open_}
    outer = {side: (side.points[-1], np.sqrt(side.points[-1].deviance) - root) for side in open_}
    for _ in range(most):
        if not open_:
            return
        guesses = []
        for side in open_:
            (a, low), (b, high) = inner[side], outer[side]
            guesses.append(a.z + (b.z - a.z) * (-low / (high - low)))
        for side, at, value, converged in zip(list(open_), *held(np.array(guesses)), strict=True):
            point = Point(at, float(value), bool(converged))
            miss = np.sqrt(max(point.deviance, 0.0)) - root if np.isfinite(value) else np.inf
            near, far = inner[side], outer[side]
            if abs(miss) <= PRECISE * root or abs(far[0].z[side.j] - near[0].z[side.j]) <= side.finest:
                side.end = at
                side.points.insert(-1, point)
                open_.remove(side)
            elif miss < 0:
                inner[side], outer[side] = (point, miss), (far[0], far[1] / 2)
            else:
                inner[side], outer[side] = (near[0], near[1] / 2), (point, miss)
    for side in open_:
        side.end = inner[side][0].z
