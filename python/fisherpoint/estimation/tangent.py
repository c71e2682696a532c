"""The tangent space of many least-squares problems: how long the residuals' part along it is, and steps within it.

All by orthogonal factors of the Jacobians, never by J^T J, which has half the digits.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array

NOTHING = 1e-100
"""A derivative that is none, and so is that share of a column's largest: squares of less are below 1e-200, and soon no numbers."""

CLEAR = 1e-3
"""Part of a column that the columns before it do not have, from which on no direction can be negligible."""


class Tangent(NamedTuple):
    """J = Q R diag(size) of B Jacobians (B, M, P), K = min(M, P).

    Attributes
    ----------
    size : ndarray, (B, P)
        Lengths of the columns; 1 for one of zeros.
    triangle : ndarray, (B, K, P)
        R, with columns of length 1.
    basis : ndarray, (B, M, K)
        Q.
    along : ndarray, (B, K)
        Q^T r: the residuals' part along the tangent space.
    blank : ndarray of bool, (B, P)
        Columns of next to nothing: unknowns that no residual notices.
    """

    size: Array
    triangle: Array
    basis: Array
    along: Array
    blank: NDArray[np.bool_]

    @classmethod
    def of(cls, r: Array, jacobian: Array) -> Tangent:
        largest = np.abs(jacobian).max(axis=1, initial=0.0)  # squares of very small or large columns have no place in a double
        blank = largest < NOTHING
        size = np.where(blank, 1.0, largest)
        scaled = jacobian / size[:, None, :]
        scaled[np.abs(scaled) < NOTHING] = 0.0
        length = np.sqrt(np.einsum("bmp,bmp->bp", scaled, scaled))
        length = np.where(blank, 1.0, length)
        basis, triangle = np.linalg.qr(scaled / length[:, None, :])
        return cls(size * length, triangle, basis, (basis.transpose(0, 2, 1) @ r[:, :, None])[:, :, 0], blank)

    def some(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Tangent:
        """Tangents of these problems alone."""
        return Tangent(self.size[rows], self.triangle[rows], self.basis[rows], self.along[rows], self.blank[rows])

    def put(self, rows: NDArray[np.intp], other: Tangent) -> None:
        """Take these problems over from another one."""
        for part, new in zip(self, other, strict=True):
            part[rows] = new

    @property
    def gradient(self) -> Array:
        """Gradient (B, P) of half the sum of squares."""
        return self.size * (self.triangle.transpose(0, 2, 1) @ self.along[:, :, None])[:, :, 0]

    def length(self, free: NDArray[np.bool_], negligible: float) -> Array:
        """How much of the residuals lies in the tangent space of the coordinates that are free (B, P): (B,).

        That is the length of the Gauss-Newton step, measured by its effect: of residuals in units of the noise, in standard errors.
        Directions with less than a share `negligible` of the largest singular value, of columns of length 1, do not count.
        """
        length: Array = np.sqrt(np.einsum("bk,bk->b", self.along, self.along))
        pivots = np.abs(np.einsum("bkk->bk", self.triangle[:, :, : self.triangle.shape[1]]))
        short = self.triangle.shape[1] < self.size.shape[1]
        some = np.flatnonzero(~free.all(axis=1) | (pivots.min(axis=1, initial=1.0) < CLEAR) | short)
        if len(some):
            turned, values, _ = np.linalg.svd(self.triangle[some] * free[some, None, :], full_matrices=False)
            parts = (turned.transpose(0, 2, 1) @ self.along[some, :, None])[:, :, 0]
            nonzero = values > negligible * values[:, :1]
            length[some] = np.sqrt(np.square(np.where(nonzero, parts, 0.0)).sum(axis=1))
        return length

    def damped(self, free: NDArray[np.bool_], units: Array, damping: Array) -> Damped:
        """Steps s that minimise ||r + J s||^2 + damping ||units s||^2 over free coordinates; damping (B,) is positive."""
        scaled = self.triangle * np.where(free, self.size / units, 0.0)[:, None, :]
        below = np.sqrt(damping)[:, None, None] * np.eye(units.shape[1])
        basis, triangle = np.linalg.qr(np.concatenate([scaled, below], axis=1))
        return Damped(units, basis[:, : scaled.shape[1]], triangle)


class Damped(NamedTuple):
    """The damped least squares by their orthogonal factors, for several right-hand sides."""

    units: Array
    basis: Array
    triangle: Array

    def step(self, along: Array) -> Array:
        """Steps (B, P) that answer a part of the residuals along the tangent space (B, K)."""
        return np.linalg.solve(self.triangle, -(self.basis.transpose(0, 2, 1) @ along[:, :, None]))[:, :, 0] / self.units
