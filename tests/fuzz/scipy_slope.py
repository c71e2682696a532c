"""Derivatives by parameters: differences of SciPy's trajectories (scipy_route.py), extrapolated to a step of zero."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from reading import Floats, Reading
from scipy_route import FINE, Course, End, course

NOISE = 30.0  # times FINE, by which the end of a trajectory may be off
DIFFERENCE = 4e-3  # of a parameter, the longest of the three steps that are extrapolated


@dataclass
class Slope:
    """A derivative by one parameter: of x (n_x,) and y (n_y,), with an estimate of their errors; None where there is none."""

    x: Floats
    y: Floats
    x_error: Floats
    y_error: Floats


def slope(
    reading: Reading,
    nominal: Course,
    x0: Floats,
    u: Floats,
    p: list[float],
    dt: float,
    size: Floats,
    j: int,
) -> Slope | None:
    """Derivative by parameter j of the end of a trajectory; None where trajectories beside it meet other surfaces."""
    u = u.tolist()
    h = DIFFERENCE * (abs(p[j]) or 1.0)
    taken = reading.output_branches(nominal.x.tolist(), u, p)
    middle = np.concatenate([nominal.x, reading.output(nominal.x.tolist(), u, p) or np.full(reading.n_y, np.nan)])
    central, bends = [], []
    for step in (h, h / 2, h / 4, h / 64):
        ends = []
        for sign in (1.0, -1.0):
            moved = [*p[:j], p[j] + sign * step, *p[j + 1 :]]
            beside = course(reading, x0, u, moved, dt, size, careful=False)
            y = reading.output(beside.x.tolist(), u, moved)
            if beside.end is not End.ok or beside.crossed != nominal.crossed or beside.stiff or y is None:
                return None
            if reading.output_branches(beside.x.tolist(), u, moved) != taken:
                return None
            ends.append(np.concatenate([beside.x, y]))
        central.append((ends[0] - ends[1]) / (2 * step))
        bends.append(np.abs(ends[0] + ends[1] - 2 * middle) / (2 * step))
    narrow = central.pop()
    once = [(4 * b - a) / 3 for a, b in itertools.pairwise(central)]
    twice = (16 * once[1] - once[0]) / 15
    # The ends themselves are as good as SciPy's tolerance.
    noise = NOISE * FINE * np.maximum(np.abs(ends[0]), 1e-3 * np.abs(ends[0]).max())
    error = np.abs(twice - once[1]) + noise / (h / 4)
    # Where ends oscillate with the parameter, wide differences may agree with each other and be wrong.
    error = np.where(np.abs(narrow - twice) > 3 * error + noise / (h / 64), np.inf, error)
    first, second = (np.abs(b - a) for a, b in itertools.pairwise(central))
    stuck = second > 0.6 * first  # by noise, or a jump or kink of a parameter between the trajectories
    error = np.where(stuck, np.where(second > 1e-6 * np.abs(central[2]), np.inf, np.maximum(error, second)), error)
    # A bend that is the same on all steps is a kink at the parameter's value itself, with a derivative on each side.
    error = np.where((bends[2] > 0.75 * bends[0]) & (bends[2] > 0.01 * np.abs(central[2])), np.inf, error)
    n = reading.n_x
    return Slope(twice[:n], twice[n:], error[:n], error[n:])
