"""Derivatives of a Python function along given directions, by complex step or central differences."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array

Rows = NDArray[Any]
Values = Callable[[Rows, NDArray[np.int64]], Rows]
"""A function's rows at steps along directions, by the directions' numbers."""

COMPLEX_STEP, LONGER_STEP = 1e-60, 1e-50
DIFFERENCE = float(np.finfo(np.float64).eps) ** (1 / 3)

SMALL = 1e-3
"""Size of a sensitivity, as a share of the state's natural size, below which what it loses is absolute."""

SMOOTH, STEEP = 1e-8, 1e-3
"""Shares of a function's size: a function whose second and first differences are below these is taken for smooth."""

SHORTER, GROWTH, ROUNDINGS = 8.0, 1.1, 100.0
"""By what a step is shortened where a function may not be smooth, and by what a chord and its rounding may grow with that."""

OTHERS = 32
"""States at random at which a function is tried with complex numbers."""


def tangents(
    function: Callable[[Rows, Rows, Rows], Rows],
    x: Array,
    directions: Array,
    u: Array,
    theta: Array,
    size: Array,
    scale: Array,
    by_complex_step: bool,
) -> tuple[Array, Array]:
    """Value (n,) and derivatives (n, p) of a function of rows x, u, theta: along the direction j of x, and size_j of parameter j.

    Parameters
    ----------
    function : callable
        Of rows (K, n_x), (K, n_u), (K, p); returns (K, n).
    x, u, theta : ndarray, (n_x,), (n_u,), (p,)
    directions : ndarray, (n_x, p)
    size : ndarray, (p,)
    scale : ndarray, (n_x,)
        Natural sizes of x. They, or x itself where it is larger, bound the steps of differences.
    by_complex_step : bool

    Notes
    -----
    Where a function that is differentiated by differences jumps, has an infinite slope, or has no value on one side, the derivative
    is that of the other side; at a corner it is the mean of both. Where neither side has one, or a complex step does not find the
    same twice, it is NaN.
    """

    def values(factors: Rows, columns: NDArray[np.int64]) -> Rows:
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is given a status
            at_x, at_theta = x + factors[:, None] * directions.T[columns], theta + factors[:, None] * np.diag(size)[columns]
        return function(at_x, np.broadcast_to(u, (len(columns), len(u))), at_theta)

    with np.errstate(over="ignore", invalid="ignore"):  # both values of a difference may be infinite
        if by_complex_step:
            return _complex_steps(values, len(theta))
        return _differences(values, steps(x, directions, scale))


def _complex_steps(values: Values, p: int) -> tuple[Array, Array]:
    """Derivatives by complex step; NaN where one that is large beside the value grows as the step gets shorter: it is infinite.

    NumPy orders complex numbers by their imaginary part where the real ones are equal, so a step may be on the other side of a jump
    than the value; the opposite step is not.
    """
    found = values(np.array([0.0, *[1j * COMPLEX_STEP] * p]), np.array([0, *range(p)]))
    value, slopes = np.real(found[0]), np.imag(found[1:]) / COMPLEX_STEP
    beside = np.abs(np.real(found[1:]) - value) > SMOOTH * np.abs(value) + LONGER_STEP * (1 + np.abs(slopes))
    doubtful = np.flatnonzero((beside | (np.abs(slopes) > np.abs(value) / STEEP)).any(axis=1))
    for k in doubtful.tolist():
        both = values(1j * np.array([LONGER_STEP, -LONGER_STEP]), np.array([k, k]))
        longer, opposite = np.imag(both) / [[LONGER_STEP], [-LONGER_STEP]]
        jumped = np.abs(np.real(both[1]) - value) > SMOOTH * np.abs(value) + LONGER_STEP * (1 + np.abs(opposite))
        infinite = np.abs(slopes[k]) > GROWTH * np.abs(longer)
        slopes[k] = np.where(beside[k], np.where(jumped, np.nan, opposite), np.where(infinite, np.nan, slopes[k]))
    return value, slopes.T


def _differences(values: Values, step: Array) -> tuple[Array, Array]:
    """Derivatives by central differences; where these are not those of a smooth function, shorter steps show what it is."""
    p = len(step)
    found = np.real(values(np.concatenate([[0.0], step, -step]), np.array([0, *range(p), *range(p)])))
    value, above, below = found[0], found[1 : p + 1], found[p + 1 :]
    slopes = (above - below) / (2 * step)[:, None]
    large = np.abs(value) + np.abs(above) + np.abs(below)
    bent = np.abs(above - 2 * value + below) > SMOOTH * large
    steep = np.abs(above - below) > STEEP * large
    doubtful = np.flatnonzero((bent | steep | ~np.isfinite(slopes)).any(axis=1))
    if not len(doubtful):
        return value, slopes.T
    far, near = step[doubtful, None], step[doubtful, None] / SHORTER
    closer = np.real(values(np.concatenate([near, -near])[:, 0], np.tile(doubtful, 2)))
    room = ROUNDINGS * np.finfo(np.float64).eps * large[doubtful] / near
    sides = (above, closer[: len(doubtful)], 1.0), (below, closer[len(doubtful) :], -1.0)
    (smooth_above, from_above), (smooth_below, from_below) = (
        _one_sided(sign * (at_far[doubtful] - value) / far, sign * (at_near - value) / near, room)
        for at_far, at_near, sign in sides
    )
    one = np.where(smooth_above, from_above, np.where(smooth_below, from_below, np.nan))
    slopes[doubtful] = np.where(smooth_above & smooth_below, slopes[doubtful], one)
    return value, slopes.T


def _one_sided(chord: Array, shorter: Array, room: Array) -> tuple[NDArray[np.bool_], Array]:
    """Whether chords to one side do not grow as they get shorter, and the slope that they lead to."""
    return np.abs(shorter) <= GROWTH * np.abs(chord) + room, shorter + (shorter - chord) / (SHORTER - 1)


def steps(x: Array, directions: Array, scale: Array) -> Array:
    """Steps of differences (p,): no state moves further than a small share of its size."""
    with np.errstate(over="ignore"):
        moves = np.max(np.abs(directions) / sizes(x, scale)[:, None], axis=0, initial=1.0)
    return np.asarray(DIFFERENCE / moves)


def sizes(x: Array, scale: Array) -> Array:
    """Natural sizes of states, or what they have grown to."""
    return np.asarray(np.maximum(np.abs(x), scale))


def rounding(t: Array, x: Array, s: Array, rates: Array, scale: Array) -> float:
    """What differences lose along a trajectory by the rounding of f, as a share of a sensitivity: the largest of all.

    Parameters
    ----------
    t : ndarray, (N,)
    x, rates : ndarray, (N, n_x)
    s : ndarray, (N, n_x, p)
        Sensitivities; one that is zero has lost nothing.
    scale : ndarray, (n_x,)
    """
    step = np.array([steps(*row, scale) for row in zip(x, s, strict=True)])
    noise = np.finfo(np.float64).eps * np.abs(rates)[:, :, None] / step[:, None]
    shares = np.where(s != 0, noise / np.maximum(np.abs(s), SMALL * scale[:, None]), 0.0)
    between = (shares[1:] + shares[:-1]) / 2
    return float(np.max(np.einsum("n,nik->ik", np.diff(t), between), initial=0.0))


def complex_step_works(functions: Sequence[Callable[..., Any]], scale: Array, x: Array, u: Array, theta: Array) -> bool:
    """Whether functions take complex numbers, and give the derivatives that central differences give, at rows (K, ...).

    Others at random are tried too, as a branch may hide at the given ones what is taken later.
    """
    n_x, p = x.shape[1], theta.shape[1]
    random = np.random.default_rng(0)
    others = random.integers(len(x), size=OTHERS)
    x = np.vstack([x, x[others] + 3 * scale * random.standard_normal((OTHERS, n_x))])
    u, theta = np.vstack([u, u[others]]), np.vstack([theta, theta[others]])
    unit = np.eye(n_x + p)
    found = 0
    for k in range(len(x)):
        size = np.concatenate([scale, np.where(theta[k] != 0, np.abs(theta[k]), 1.0)])
        both = np.concatenate([x[k], theta[k]])
        for part in functions:

            def of_both(_: Rows, inputs: Rows, rows: Rows, part: Any = part) -> Rows:
                return part(rows[:, :n_x], inputs, rows[:, n_x:])  # type: ignore[no-any-return]

            arguments = (np.zeros(0), np.zeros((0, len(unit))), u[k], both, size, np.zeros(0))
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("error")  # the imaginary part is dropped
                    _, steps = tangents(of_both, *arguments, by_complex_step=True)
            except Exception:  # whatever the function raises on complex numbers
                return False
            value, differences = tangents(of_both, *arguments, by_complex_step=False)
            known = np.isfinite(differences) & np.isfinite(value)[:, None]
            found += int(known.sum())
            bound = 1e-4 * np.abs(differences).max(axis=1, initial=0.0, where=known) + 1e-8 * np.abs(value)
            if not (np.abs(steps - differences) <= bound[:, None])[known].all():
                return False
    return found > 0
