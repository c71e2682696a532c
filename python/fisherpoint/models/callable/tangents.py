"""Derivatives of a Python function along given directions, by complex step or central differences."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array

Rows = NDArray[Any]

COMPLEX_STEP = 1e-60
DIFFERENCE = float(np.finfo(np.float64).eps) ** (1 / 3)

SMALL = 1e-3
"""Size of a sensitivity, as a share of the state's natural size, below which what it loses is absolute."""

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
    """
    p = len(theta)
    along_x, along_theta = directions.T, np.diag(size)
    if by_complex_step:
        factors: Rows = np.array([0.0, *[1j * COMPLEX_STEP] * p])
        rows = [0, *range(p)]
    else:
        step = steps(x, directions, scale)
        factors = np.concatenate([[0.0], step, -step])
        rows = [0, *range(p), *range(p)]
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is given a status
        at_x, at_theta = x + factors[:, None] * along_x[rows], theta + factors[:, None] * along_theta[rows]
    values = function(at_x, np.broadcast_to(u, (len(rows), len(u))), at_theta)
    with np.errstate(over="ignore", invalid="ignore"):  # both values of a difference may be infinite
        if by_complex_step:
            return np.real(values[0]), np.imag(values[1:]).T / COMPLEX_STEP
        values = np.real(values)
        return values[0], ((values[1 : p + 1] - values[p + 1 :]) / (2 * step)[:, None]).T


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
