"""The tangent space of residuals: their Jacobian as orthogonal and triangular factors, and the damped steps by these.

Jacobians are stored whole, or by a `Layout` of their own, which knows where they are zero.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array

NOTHING = 1e-100
"""A derivative that is none, and so is that share of a column's largest: squares of less are below 1e-200, and soon no numbers."""

CLEAR = 1e-3
"""Part of a column that the columns before it do not have, from which on no direction can be negligible."""


@dataclass(frozen=True, eq=False)
class TangentSpace(ABC):
    """J of B problems as a product of orthogonal and triangular factors, in whatever form.

    Attributes
    ----------
    size : ndarray, (B, P)
        Lengths of the columns; 1 for one of zeros.
    along : ndarray, (B, K)
        The residuals' part along the tangent space.
    blank : ndarray of bool, (B, P)
        Columns of next to nothing: unknowns that no residual notices.
    """

    size: Array
    along: Array
    blank: NDArray[np.bool_]

    def some(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Self:
        """Tangents of these problems alone."""
        return type(self)(*(getattr(self, one.name)[rows] for one in fields(self)))

    def put(self, rows: NDArray[np.intp], other: Self) -> None:
        """Take these problems over from another one."""
        for one in fields(self):
            getattr(self, one.name)[rows] = getattr(other, one.name)

    @property
    @abstractmethod
    def gradient(self) -> Array:
        """Gradient (B, P) of half the sum of squares."""

    @abstractmethod
    def projected(self, r: Array) -> Array:
        """The part of rows (B, M) along the tangent space, (B, K)."""

    @abstractmethod
    def length(self, free: NDArray[np.bool_], negligible: float) -> Array:
        """How much of the residuals lies in the tangent space of the coordinates that are free (B, P): (B,).

        That is the length of the Gauss-Newton step, measured by its effect: of residuals in units of the noise, in standard errors.
        Directions with less than a share `negligible` of the largest singular value, of columns of length 1, do not count.
        """

    @abstractmethod
    def damped(self, free: NDArray[np.bool_], units: Array, damping: Array) -> DampedSteps:
        """Steps s that minimise ||r + J s||^2 + damping ||units s||^2 over free coordinates; damping (B,) is positive."""


class DampedSteps(ABC):
    """The damped least squares by their orthogonal factors, for several right-hand sides."""

    units: Array

    @abstractmethod
    def step(self, along: Array) -> Array:
        """Steps (B, P) that answer a part of the residuals along the tangent space (B, K)."""


class Layout:
    """How the entries of Jacobians (B, M, P) are stored: all of them."""

    def tangent(self, r: Array, jacobian: Array) -> TangentSpace:
        """The tangent space at residuals (B, M)."""
        return Tangent.of(r, jacobian)

    def effect(self, jacobian: Array, step: Array) -> Array:
        """J s of steps (B, P), (B, M)."""
        return np.asarray((jacobian @ step[:, :, None])[:, :, 0])

    def dense(self, jacobian: Array) -> Array:
        """All entries (B, M, P)."""
        return jacobian


DENSE = Layout()


@dataclass(frozen=True, eq=False)
class Tangent(TangentSpace):
    """J = Q R diag(size) of B Jacobians (B, M, P), K = min(M, P).

    Attributes
    ----------
    triangle : ndarray, (B, K, P)
        R, with columns of length 1.
    basis : ndarray, (B, M, K)
        Q.
    """

    triangle: Array
    basis: Array

    @classmethod
    def of(cls, r: Array, jacobian: Array) -> Tangent:
        scaled, size, blank = unit_columns(jacobian)
        basis, triangle = np.linalg.qr(scaled)
        return cls(size, (basis.transpose(0, 2, 1) @ r[:, :, None])[:, :, 0], blank, triangle, basis)

    @property
    def gradient(self) -> Array:
        return self.size * (self.triangle.transpose(0, 2, 1) @ self.along[:, :, None])[:, :, 0]

    def projected(self, r: Array) -> Array:
        return np.asarray((self.basis.transpose(0, 2, 1) @ r[:, :, None])[:, :, 0])

    def length(self, free: NDArray[np.bool_], negligible: float) -> Array:
        pivots = np.abs(np.einsum("bkk->bk", self.triangle[:, :, : self.triangle.shape[1]]))
        short = self.triangle.shape[1] < self.size.shape[1]
        some = np.flatnonzero(~free.all(axis=1) | (pivots.min(axis=1, initial=1.0) < CLEAR) | short)
        return length_along(self.along, some, self.triangle[some], free, negligible)

    def damped(self, free: NDArray[np.bool_], units: Array, damping: Array) -> Damped:
        scaled = self.triangle * np.where(free, self.size / units, 0.0)[:, None, :]
        below = np.sqrt(damping)[:, None, None] * np.eye(units.shape[1])
        basis, triangle = np.linalg.qr(np.concatenate([scaled, below], axis=1))
        return Damped(units, basis[:, : scaled.shape[1]], triangle)


@dataclass(frozen=True, eq=False)
class Damped(DampedSteps):
    """Damped steps of `Tangent`."""

    units: Array
    basis: Array
    triangle: Array

    def step(self, along: Array) -> Array:
        return np.linalg.solve(self.triangle, -(self.basis.transpose(0, 2, 1) @ along[:, :, None]))[:, :, 0] / self.units


def unit_columns(jacobian: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Columns (B, M, P) as columns of length 1, their lengths (B, P), and which of them (B, P) are next to nothing."""
    largest = np.abs(jacobian).max(axis=1, initial=0.0)  # squares of very small or large columns have no place in a double
    blank = largest < NOTHING
    size = np.where(blank, 1.0, largest)
    scaled = jacobian / size[:, None, :]
    scaled[np.abs(scaled) < NOTHING] = 0.0
    length = np.sqrt(np.einsum("bmp,bmp->bp", scaled, scaled))
    length = np.where(blank, 1.0, length)
    return scaled / length[:, None, :], size * length, blank


def length_along(along: Array, some: NDArray[np.intp], triangle: Array, free: NDArray[np.bool_], negligible: float) -> Array:
    """`TangentSpace.length` where `some` problems (S,), with triangles (S, K, P), may have directions that do not count."""
    length: Array = np.sqrt(np.einsum("bk,bk->b", along, along))
    if len(some):
        turned, values, _ = np.linalg.svd(triangle * free[some, None, :], full_matrices=False)
        parts = (turned.transpose(0, 2, 1) @ along[some, :, None])[:, :, 0]
        nonzero = values > negligible * values[:, :1]
        length[some] = np.sqrt(np.square(np.where(nonzero, parts, 0.0)).sum(axis=1))
    return length
