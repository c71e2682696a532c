"""How far outputs and their derivatives may be off, from what is promised of states and of columns.

A state may be off by a share of its size, a column dx/dtheta_j by a share of its own. An output g(x) may then be off by |g_x| times
the state's room, and dy/dtheta_j = g_x dx/dtheta_j + g_theta by |g_x| times the column's room and by what g_x and g_theta change
within the state's: of 1/x next to zero, or of sin(exp(x)), all there is. What roundings do is the rest.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from arithmetic import Rough
from reading import Floats, Reading

FEW_ROUNDINGS = 1e-14  # relative
TRIES = 12  # with other roundings: of a condition that these decide about, each result shows up

Values = Sequence[float]
Function = Callable[[list[float], list[float], list[float]], list[float] | None]


def output_slopes(reading: Reading, x: Values, u: Values, p: Values) -> Floats:
    """dg/d(x, p), (n_y, n_x + p); NaN where there is none."""
    slopes = np.zeros((reading.n_y, len(x) + len(p)))
    for j in range(slopes.shape[1]):
        column = reading.output_slope(x, u, p, j)
        slopes[:, j] = math.nan if column is None else column
    return slopes


def largest_slopes(reading: Reading, x: Floats, u: Values, p: Values, room: Floats) -> tuple[Floats, Floats]:
    """The largest |dg/d(x, p)| where the states are off by `room` (n_x,), each by itself, and the largest change of it, both
    (n_y, n_x + p); infinite where g has no value there."""
    here = output_slopes(reading, x.tolist(), u, p)
    most, change = np.abs(here), np.zeros(here.shape)
    for move in np.diag(room):
        for share in (1.0, -1.0, 0.3, -0.3):  # of something that oscillates one alone may be as it was
            there = output_slopes(reading, (x + share * move).tolist(), u, p)
            most, change = np.maximum(most, np.abs(there)), np.maximum(change, np.abs(there - here))
    return tuple(np.where(np.isfinite(of), of, math.inf) for of in (most, change))  # type: ignore[return-value]


def output_room(reading: Reading, x: Floats, u: Values, p: Values, room: Floats) -> Floats:
    """How far the outputs (n_y,) may be off where the states are off by `room` (n_x,)."""
    return times(largest_slopes(reading, x, u, p, room)[0][:, : len(x)], room)


def slope_room(
    reading: Reading,
    x: Floats,
    u: Values,
    p: Values,
    room: Floats,
    columns: Floats,
    columns_room: Floats,
    of: Sequence[int] | None = None,
) -> Floats:
    """How far dy/dtheta (n_y, c) may be off where the states are off by `room` (n_x,) and `columns` = dx/dtheta by `columns_room`,
    both (n_x, c); `of` are the parameters that they belong to if not all, where a number that g does not read is none."""
    n = len(x)
    most, change = largest_slopes(reading, x, u, p, room)
    by_columns = times(most[:, :n], columns_room) + times(change[:, :n], np.abs(columns))
    by_themselves = np.hstack([change[:, n:], np.zeros((len(change), 1))])
    return by_columns + by_themselves[:, list(range(len(p))) if of is None else [min(j, len(p)) for j in of]]


def times(slopes: Floats, room: Floats) -> Floats:
    """A product of matrices, of numbers that are not negative, where nothing times infinity is nothing."""
    with np.errstate(invalid="ignore"):
        terms = slopes[(..., *(None,) * (room.ndim - 1))] * room[None]
    total: Floats = np.where(np.isnan(terms), 0.0, terms).sum(axis=1)
    return total


def by_rounding(function: Function, value: Values, x: Values, u: Values, p: Values) -> Floats:
    """What roundings of its arguments do to a function: much at a jump, and where a root is zero."""
    total = np.zeros(len(value))
    for part in range(3):
        for i in range(len((x, u, p)[part])):
            for sign in (1.0, -1.0):
                moved = [list(x), list(u), list(p)]
                moved[part][i] *= 1 + sign * FEW_ROUNDINGS
                other = function(*moved)
                if other is not None and np.isfinite(other).all():
                    total += np.abs(np.array(other) - value)
    return total


def by_own_rounding(function: Function, value: Values, x: Values, u: Values, p: Values) -> Floats:
    """What roundings of its operations do to a function of `Reading.rough`."""
    total = np.zeros(len(value))
    for _ in range(TRIES):
        other = function(*([Rough(number) for number in of] for of in (x, u, p)))  # type: ignore[misc]
        if other is not None and np.isfinite(other).all():
            total = np.maximum(total, np.abs(np.array(other) - value))
    return total


def undecided(reading: Reading, x: Values, u: Values, p: Values, unit: Floats) -> bool:
    """Whether rounding decides which rates a state has: both sides of a condition are the same but for it. `unit` (n_x,) are
    natural sizes of rates."""
    here = reading.held(x, u, p, reading.sides(x, u, p))
    for _ in range(TRIES):
        rough = [[Rough(number) for number in of] for of in (x, u, p)]
        there = reading.rough.held(*rough, reading.rough.sides(*rough))  # type: ignore[arg-type]
        if here is None or there is None:
            if here is not there:
                return True
        elif np.any(np.abs(np.array(here) - there) > 1e-6 * np.abs(here) + 1e-9 * unit):
            return True
    return False


def output_undecided(reading: Reading, x: Values, u: Values, p: Values) -> bool:
    """Whether rounding decides which branches the outputs take."""
    here = reading.output_branches(x, u, p)
    rough = ([[Rough(number) for number in of] for of in (x, u, p)] for _ in range(TRIES))
    return any(reading.rough.output_branches(*there) != here for there in rough)  # type: ignore[arg-type]
