"""Points that are nearly equal become copies of one, so that a rig is set once: where that costs nothing."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ...information.point_information import PointInformation

ROUNDING = 1e-9
"""Share of what is maximised that it may fall by."""

Evaluated = Callable[[Array], PointInformation]
"""Evaluates points given as rows (K, d), and returns those that are valid."""


def with_copies(
    design: PointInformation,
    lower: Array,
    upper: Array,
    evaluated: Evaluated,
    value: Callable[[PointInformation], float],
    near: float,
    most_points: int,
) -> PointInformation:
    """The design with as few distinct points as its value allows, the nearest ones first.

    One of two groups of copies replaces the other, or both move to their mean, whichever value is larger. Where an
    ascent has come near to a maximum, a mean of points that it left around it is nearer.

    Parameters
    ----------
    design : PointInformation
    lower, upper : ndarray, (d,)
        Bounds of the first d numbers of a point.
    evaluated : callable
    value : callable
        What is maximised.
    near : float
        Share of the region's width in every number within which points may become copies.
    most_points : int
        Number of distinct points above which the design stays as it is.
    """
    width = np.where(upper > lower, upper - lower, 1.0)
    least = value(design)
    least -= ROUNDING * max(1.0, abs(least))
    refused: set[tuple[bytes, bytes]] = set()
    while True:
        table = design.experiments.table[:, : len(width)]
        points, of = np.unique(table, axis=0, return_inverse=True)
        if not 1 < len(points) <= most_points:
            return design
        merged = None
        for i, j in _pairs(points / width, near):
            pair = points[i].tobytes(), points[j].tobytes()
            if pair not in refused:
                merged = _merged(design, points, of.ravel(), (i, j), evaluated, value, least)
                if merged is not None:
                    break
                refused.add(pair)
        if merged is None:
            return design
        design = merged


def _pairs(points: Array, near: float) -> list[tuple[int, int]]:
    """Pairs that are `near` to each other, the nearest first."""
    first, second = np.triu_indices(len(points), 1)
    distance = np.abs(points[first] - points[second]).max(axis=1)
    order = np.argsort(distance, kind="stable")
    order = order[distance[order] <= near]
    return list(zip(first[order].tolist(), second[order].tolist(), strict=True))


def _merged(
    design: PointInformation,
    points: Array,
    of: NDArray[np.intp],
    pair: tuple[int, int],
    evaluated: Evaluated,
    value: Callable[[PointInformation], float],
    least: float,
) -> PointInformation | None:
    """The design with copies of one point for two groups; None where its value is less than allowed."""
    copies = np.flatnonzero((of == pair[0]) | (of == pair[1]))
    share = float((of[copies] == pair[0]).mean())
    mean = evaluated((share * points[pair[0]] + (1 - share) * points[pair[1]])[None])
    candidates = PointInformation.join([design, mean])
    best, worth = None, least
    for place in (*(int(np.flatnonzero(of == one)[0]) for one in pair), *range(len(design), len(candidates))):
        source = np.arange(len(design))
        source[copies] = place
        tried = candidates[source]
        there = value(tried)
        if there >= worth:
            best, worth = tried, there
    return best
