"""Equilibria for many sets of parameters at once: a damped Newton method, and steps in time where that does not settle.

Everything is in natural sizes: the unknowns z of a row are divided by their scales, and the rows of the Jacobian by their largest
entries, so that neither units nor stiffness decide what counts as singular. The steps are damped by the natural test (P. Deuflhard,
2004): the Newton step at the new place, with the old Jacobian, must be shorter than the step to it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array

Flags = NDArray[np.bool_]

Rates = Callable[[Array, NDArray[np.intp]], tuple[Array, Array]]
"""Takes unknowns (n, r) and the rows that they belong to; returns rates (n, r) and their derivatives by the unknowns (n, r, r)."""

SETTLED = 1e-12
"""Length of a Newton step, in natural sizes, after which one more would be rounding."""

STALLED = 1e-9
"""Length of a step that counts as settled where rounding lets it get no shorter."""

FAR = 0.3
"""Share of a natural size, or of the guess: a Newton step this long may lead past another equilibrium."""

SINGULAR = 1e-11
"""Smallest singular value over the largest, of scaled Jacobians, below which the rates leave an unknown free."""

MOST_NEWTON, MOST_IN_TIME = 60, 200
SHORTEST = 2.0**-16
"""Share of a Newton step that is tried last."""

RISING = 1e-9
"""Real part of an eigenvalue over the largest eigenvalue, above which an equilibrium is unstable."""


class Equilibria(NamedTuple):
    """Equilibria of n rows: unknowns z (n, r), Jacobians (n, r, r), and flags (n,) of those found, singular and stable."""

    z: Array
    jacobian: Array
    found: Flags
    singular: Flags
    stable: Flags

    @property
    def good(self) -> Flags:
        """Found, isolated and stable."""
        good: Flags = self.found & ~self.singular & self.stable
        return good


def equilibria(rates: Rates, guess: Array, scale: Array, moving: bool = True) -> Equilibria:
    """Equilibria near guesses (n, r), of unknowns of natural sizes (r,).

    Where Newton's method does not settle, settles far off, or where the plant would not stay, the way of the plant is followed.
    With `moving` False, a controller keeps the plant there: there is no such way, and whether it would stay does not matter.
    """
    first = _judged(rates, *_newton(rates, guess, scale), scale, moving)
    if not moving:
        return first
    far = (np.abs(first.z - guess) > FAR * (scale + np.abs(guess))).any(axis=1)
    again = np.flatnonzero(~first.found | (~first.singular & (far | ~first.stable)))
    if not len(again):
        return first

    def some(z: Array, rows: NDArray[np.intp]) -> tuple[Array, Array]:
        return rates(z, again[rows])

    second = _judged(some, *_newton(some, _in_time(some, guess[again], scale), scale), scale, moving)
    better = second.found & (second.stable | ~first.found[again])
    for of_first, of_second in zip(first, second, strict=True):
        of_first[again[better]] = of_second[better]
    return first


def solved(jacobian: Array, right: Array, scale: Array) -> Array:
    """J^-1 right, (n, r, m), for Jacobians that are not singular."""
    scaled, rows = _scaled(jacobian, scale)
    found: Array = np.linalg.solve(scaled, right / rows) * scale[:, None]
    return found


def free_unknowns(jacobian: Array, scale: Array) -> NDArray[np.intp]:
    """Places of the unknowns that a singular Jacobian (r, r) leaves free, the freest first."""
    scaled, _ = _scaled(jacobian[None], scale)
    direction = np.abs(np.linalg.svd(scaled[0])[2][-1])
    order = np.argsort(-direction, kind="stable")
    return np.asarray(order[direction[order] > 0.1 * direction.max()], dtype=np.intp)


def _scaled(jacobian: Array, scale: Array) -> tuple[Array, Array]:
    """Jacobians (n, r, r) by natural sizes with rows of size 1, and what these were divided by, (n, r, 1)."""
    scaled = jacobian * scale
    size = np.abs(scaled).max(axis=2, keepdims=True)
    rows = np.where(size > 0, size, 1.0)
    return scaled / rows, rows


def _inverses(matrices: Array) -> Array:
    """Inverses (n, r, r), infinite where there is none; each is that of a matrix alone."""
    try:
        return np.asarray(np.linalg.inv(matrices))
    except np.linalg.LinAlgError:
        if len(matrices) == 1:
            return np.full_like(matrices, np.inf)
        return np.concatenate([_inverses(one[None]) for one in matrices])


class _Factors:
    """Jacobians of rows, for steps with several right-hand sides; where they are next to singular, the shortest step."""

    def __init__(self, jacobian: Array, scale: Array) -> None:
        scaled, self.rows = _scaled(jacobian, scale)
        self.inverse = _inverses(scaled)
        size = np.linalg.norm(self.inverse, axis=(1, 2))
        hard = np.flatnonzero(~(size < 1e8))
        self.left_over = np.zeros_like(scaled)  # onto what of the rates no step can make vanish
        if len(hard):
            u, s, v = np.linalg.svd(scaled[hard])
            cut = s > 1e-14 * s[:, :1]
            turned = u.transpose(0, 2, 1)
            self.inverse[hard] = v.transpose(0, 2, 1) @ (np.where(cut, 1.0 / np.where(cut, s, 1.0), 0.0)[:, :, None] * turned)
            self.left_over[hard] = np.where(cut, 0.0, 1.0)[:, :, None] * turned

    def step(self, rates: Array, at: NDArray[np.intp]) -> Array:
        """-J^-1 rates in natural sizes, (len(at), r), of some rows."""
        found: Array = -np.einsum("nij,nj->ni", self.inverse[at], rates / self.rows[at, :, 0])
        return found

    def solvable(self, rates: Array) -> Flags:
        """Whether a step can make the rates vanish, (n,)."""
        left = np.einsum("nij,nj->ni", self.left_over, rates / self.rows[:, :, 0])
        return np.asarray(np.abs(left).max(axis=1) <= STALLED)


def _finite(rates: Array, jacobian: Array) -> Flags:
    return np.asarray(np.isfinite(rates).all(axis=1) & np.isfinite(jacobian).all(axis=(1, 2)))


def _newton(rates: Rates, guess: Array, scale: Array) -> tuple[Array, Flags]:
    """Unknowns (n, r), and in which rows they settled."""
    z, settled = guess.copy(), np.zeros(len(guess), dtype=bool)
    active = np.arange(len(guess))
    f, j = rates(z, active)
    for _ in range(MOST_NEWTON):
        active = active[_finite(f[active], j[active])]
        if not len(active):
            break
        factors, every = _Factors(j[active], scale), np.arange(len(active))
        step, solvable = factors.step(f[active], every), factors.solvable(f[active])
        length = np.linalg.norm(step / (1 + np.abs(z[active] / scale)), axis=1)
        done = (length <= SETTLED) & solvable
        share, left, moved = np.ones(len(active)), every, np.zeros(len(active), dtype=bool)
        while len(left):
            rows = active[left]
            trial = z[rows] + share[left, None] * step[left] * scale
            f_there, j_there = rates(trial, rows)
            with np.errstate(invalid="ignore", over="ignore"):
                ahead = np.linalg.norm(factors.step(f_there, left), axis=1)
                shorter = ahead <= (1 - share[left] / 4) * np.linalg.norm(step[left], axis=1)
            taken = (shorter | done[left]) & np.isfinite(f_there).all(axis=1)
            z[rows[taken]], f[rows[taken]], j[rows[taken]] = trial[taken], f_there[taken], j_there[taken]
            moved[left[taken]] = True
            left = left[~taken]
            share[left] /= 2
            left = left[share[left] >= SHORTEST]
        settled[active[done | (~moved & solvable & (length <= STALLED))]] = True
        active = active[~done & moved & (solvable | (length > SETTLED))]
    return z, settled


def _in_time(rates: Rates, guess: Array, scale: Array) -> Array:
    """Follow implicit Euler steps that grow as the rates fall: at first they follow the plant, in the end Newton's method."""
    z, r = guess.copy(), len(scale)
    active = np.arange(len(guess))
    f, j = rates(z, active)
    size = np.linalg.norm(f / scale, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        h = np.where(size > 0, 0.01 / size, 1.0)
    good = _finite(f, j)
    for _ in range(MOST_IN_TIME):
        active = np.flatnonzero(good)
        if not len(active):
            break
        matrix = np.eye(r) / h[active, None, None] - j[active] * scale / scale[:, None]
        step = _solved_or_shortest(matrix, f[active] / scale)
        trial = z[active] + step * scale
        f_there, j_there = rates(trial, active)
        with np.errstate(invalid="ignore", over="ignore"):
            size_there = np.linalg.norm(f_there / scale, axis=1)
        taken = _finite(f_there, j_there) & (np.abs(step).max(axis=1) <= FAR * (1 + np.abs(z[active] / scale).max(axis=1)))
        rows = active[taken]
        growth = np.clip(size[rows] / np.maximum(size_there[taken], 1e-300), 0.5, 10.0)
        h[rows] *= np.maximum(growth, 1.2)
        z[rows], f[rows], j[rows], size[rows] = trial[taken], f_there[taken], j_there[taken], size_there[taken]
        h[active[~taken]] /= 4
        still = np.abs(step).max(axis=1) <= STALLED
        good[rows[still[taken]]] = False
        good[active[h[active] < 1e-300]] = False
    return z


def _solved_or_shortest(matrix: Array, right: Array) -> Array:
    try:
        return np.asarray(np.linalg.solve(matrix, right[:, :, None])[:, :, 0])
    except np.linalg.LinAlgError:
        if len(matrix) == 1:
            return np.asarray(np.linalg.lstsq(matrix[0], right[0], rcond=None)[0][None])
        return np.concatenate([_solved_or_shortest(matrix[[k]], right[[k]]) for k in range(len(matrix))])


def _judged(rates: Rates, z: Array, settled: Flags, scale: Array, moving: bool) -> Equilibria:
    """What was found; where nothing moves by itself, all of it counts as stable."""
    found, r = settled.copy(), len(scale)
    f, jacobian = rates(z, np.arange(len(z)))
    found &= _finite(f, jacobian)
    singular, stable = np.zeros(len(z), dtype=bool), found & (not moving)
    rows = np.flatnonzero(found)
    if len(rows):
        values = np.linalg.svd(_scaled(jacobian[rows], scale)[0], compute_uv=False)
        singular[rows] = values[:, -1] <= SINGULAR * values[:, 0]
    if len(rows) and moving:
        eigenvalues = np.linalg.eigvals(jacobian[rows] * scale / scale[:, None])
        largest = np.abs(eigenvalues).max(axis=1)
        stable[rows] = eigenvalues.real.max(axis=1) <= RISING * largest
    jacobian = np.where(found[:, None, None], jacobian, np.eye(r))
    return Equilibria(z, jacobian, found, singular, stable)
