"""Totals that a plant keeps while it settles, as the amount of a substance in a closed system does.

Where L^T f = 0 wherever the plant may go, f_z is singular, and L^T z stays what it was at first. So the plant rests where the rates
vanish and the totals are those of the guess. With S the natural sizes, D those of the rates and the columns of S^-1 L orthonormal,

    f - S D (S^-1 L) (S^-1 L)^T S^-1 (z - guess)

vanishes just there, and has a derivative that is regular: multiplied by L^T, it says that the totals are kept.

L is found from rates and Jacobians at some places about the guess: it is what all of them leave out. It may depend on the
parameters, as volumes of compartments do. The derivative of L^T f = 0 by a parameter, L'^T f + L^T f_theta = 0 at these places, has
that of L.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array

Evaluated = Callable[[Array, NDArray[np.intp]], tuple[Array, Array]]
"""Takes unknowns (N, r) and the rows that they belong to; returns rates (N, r) and their derivatives by theta and unknowns,
(N, r, p + r), not finite outside the model's domain."""

RANK = 1e-11
"""Smallest singular value over the largest, of rates in natural sizes, below which a direction has no rate."""

ROUNDING = 1e-10
"""Share of its terms that a sum leaves by rounding, where it is zero."""

NOTHING = 1e-13
"""Entry of a direction of length 1 that is rounding."""

BROKEN = 1e-6
"""Share of the derivative by a parameter above which the total is kept at one value of the parameter only."""

REACH = 0.3
"""How far from the guess the rates are looked at, in sizes of the unknowns."""

MOST_AT_ONCE = 200
"""Rows that are looked at together, which bounds the memory."""


class ConservedTotals:
    """The totals of n rows of r unknowns; none is known at first.

    Parameters
    ----------
    evaluate : callable
    guess : ndarray, (n, r)
        Where rates are looked at.
    held : ndarray, (n, r)
        Unknowns that have the totals which are kept.
    scale : ndarray, (r,)
        Natural sizes.

    Attributes
    ----------
    pull : ndarray, (n, r, r)
        What the distance from `held` is multiplied by and taken from the rates; zero where nothing is kept.
    shared : ndarray of bool, (n, r)
        Which unknowns are part of a total.
    """

    def __init__(self, evaluate: Evaluated, guess: Array, held: Array, scale: Array) -> None:
        self._evaluate, self._guess, self.held, self._scale = evaluate, guess, held, scale
        n, r = guess.shape
        self.pull, self.shared = np.zeros((n, r, r)), np.zeros((n, r), dtype=bool)
        self._turning: dict[int, tuple[Array, Array]] = {}

    def find(self, rows: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Look for totals of some rows; whether there are any, (len(rows),)."""
        found = np.zeros(len(rows), dtype=bool)
        for first in range(0, len(rows), MOST_AT_ONCE):
            some = rows[first : first + MOST_AT_ONCE]
            there, *parts = self._samples(some)
            for k in np.flatnonzero(there.sum(axis=1) > self._guess.shape[1]).tolist():
                found[first + k] = self._found(int(some[k]), *(part[k] for part in parts))
        return found

    def pulled(self, rates: Array, jacobian: Array, z: Array, rows: NDArray[np.intp]) -> tuple[Array, Array]:
        """Rates (m, r) and Jacobians (m, r, r) of rows at z (m, r), less the distance from the totals."""
        if not self.shared.any():
            return rates, jacobian
        pull = self.pull[rows]
        return rates - np.einsum("nij,nj->ni", pull, z - self.held[rows]), jacobian - pull

    def turned(self, by_theta: Array, z: Array, rows: NDArray[np.intp]) -> Array:
        """Derivatives by theta (m, r, p) of the rates of rows at z (m, r), less that of the distance from the totals."""
        result = by_theta.copy()
        for k, row in enumerate(rows.tolist()):
            if row in self._turning:
                left, slopes = self._turning[row]
                result[k] -= left @ (slopes @ (z[k] - self.held[row])).T
        return result

    def _samples(self, rows: NDArray[np.intp]) -> tuple[NDArray[np.bool_], Array, Array, Array]:
        """Return for each row whether there are rates at m places (k, m), else they are zero; the others in natural sizes.

        Rates (k, r, m), their derivatives by theta (k, r, m, p), and by the unknowns (k, r, m, r).
        """
        directions = _directions(self._guess.shape[1])
        m, r = directions.shape
        guess = self._guess[rows]
        nearest = np.abs(guess).max(axis=1, keepdims=True)
        size = np.where(guess != 0, np.abs(guess), np.where(nearest > 0, np.minimum(self._scale, nearest), self._scale))
        z = (guess[:, None] + REACH * size[:, None] * directions).reshape(-1, r)
        rates, slopes = self._evaluate(z, np.repeat(rows, m))
        p = slopes.shape[2] - r
        lost = ~(np.isfinite(rates).all(axis=1) & np.isfinite(slopes).all(axis=(1, 2)))
        rates, slopes = rates / self._scale, slopes / self._scale[:, None]
        slopes[:, :, p:] *= self._scale
        rates[lost], slopes[lost] = 0.0, 0.0
        slopes = slopes.reshape(len(rows), m, r, p + r).transpose(0, 2, 1, 3)
        rates = rates.reshape(len(rows), m, r).transpose(0, 2, 1)
        return ~lost.reshape(len(rows), m), rates, slopes[..., :p], slopes[..., p:]

    def _found(self, row: int, rates: Array, by_theta: Array, by_unknowns: Array) -> bool:
        r = len(rates)
        columns = np.concatenate([rates, by_unknowns.reshape(r, -1)], axis=1)
        totals = _left_out(columns)
        if not totals.shape[1] or not _vanish(totals, columns):
            return False
        turning = np.einsum("rc,rmp->cmp", totals, by_theta)
        terms = np.einsum("rc,rmp->cmp", np.abs(totals), np.abs(by_theta))
        size = np.abs(by_unknowns).max(axis=(1, 2))
        size = np.where(size > 0, size, size.max() or 1.0)
        if (np.abs(turning) > ROUNDING * terms).any():
            slopes = _slopes_of(turning, rates, size)
            left = np.abs(np.einsum("pcr,rm->cmp", slopes, rates) - turning).max(axis=1)
            if (left > BROKEN * terms.max(axis=1)).any():
                return False
            self._turning[row] = (self._scale * size)[:, None] * totals, -slopes / self._scale
        shares = totals @ totals.T
        self.shared[row] = totals.any(axis=1)
        self.pull[row] = (self._scale * size)[:, None] * shares / self._scale
        return True


@lru_cache(maxsize=64)
def _directions(r: int) -> Array:
    """Places (m, r) at which rates are evaluated: half are above the guess in all unknowns, as many must not be negative."""
    directions: Array = np.random.default_rng(0).random((3 * r + 8, r))
    directions[::2] = 2 * directions[::2] - 1
    directions.flags.writeable = False
    return directions


def _left_out(columns: Array) -> Array:
    """Orthonormal directions (r, c) that have no share in any column (r, m)."""
    totals = _null(columns)
    totals[np.abs(totals) < NOTHING] = 0.0  # next to such an entry no sum would be zero but for rounding
    if totals.shape[1] == 1:  # again where all of its entries count alike, so that small ones are as exact as large ones
        part = np.flatnonzero(totals[:, 0])
        finer = _null(totals[part] * columns[part])
        if finer.shape[1] == 1:  # all of them are about 1 there
            totals[part] *= finer
            totals /= np.linalg.norm(totals)
    return totals


def _null(columns: Array) -> Array:
    length = np.linalg.norm(columns, axis=0)
    scaled = np.divide(columns, length, out=np.zeros_like(columns), where=length > 0)
    left, values, _ = np.linalg.svd(scaled, full_matrices=False)  # there are more columns than rows
    return np.asarray(left[:, int((values > RANK * values[0]).sum()) :])


def _vanish(totals: Array, columns: Array) -> bool:
    """Whether the totals of the columns are zero but for rounding."""
    return bool((np.abs(totals.T @ columns) <= ROUNDING * (np.abs(totals).T @ np.abs(columns))).all())


def _slopes_of(turning: Array, rates: Array, size: Array) -> Array:
    """For each parameter the slopes (p, c, r) whose products with the rates (r, m) are `turning` (c, m, p)."""
    scaled = rates / size[:, None]
    inverse = np.linalg.pinv(scaled, rcond=RANK)
    return np.asarray(np.einsum("cmp,mr->pcr", turning, inverse) / size)
