"""Singular values and null directions of sensitivities, with columns scaled to unit length so that no unit counts."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..basics.values import Array, FrozenMapping

UNTOLD = 1e-8
"""Length of a whitened column, per prior standard deviation, up to which it is nothing but rounding.

An estimate from it alone would have a standard error of 1e8 of the prior's. Rank tests, which divide columns by their own length,
would take it for information.
"""

ROUNDING = 1e-7
"""Rounding errors of components of null directions, where there are several."""


def without_rounding(white: Array) -> Array:
    """Whitened sensitivities (..., m, p), per prior standard deviation, with zeros in columns that are nothing but rounding."""
    nothing = np.linalg.norm(white, axis=-2, keepdims=True) <= UNTOLD
    return np.where(nothing, 0.0, white) if nothing.any() else white


def information_without_rounding(information: Array) -> Array:
    """Information matrices F (..., p, p), in sum form and per prior standard deviation, with zeros where they are but rounding."""
    nothing = np.diagonal(information, axis1=-2, axis2=-1) <= UNTOLD**2
    return np.where(nothing[..., None] | nothing[..., None, :], 0.0, information) if nothing.any() else information


def column_scaled_svd(matrix: Array, length: Array | None = None) -> tuple[Array, Array, Array]:
    """Singular values, largest first (p,), right singular vectors as rows (p, p), and the columns' lengths (p,), of (m, p).

    Other lengths than the columns' own may be given to divide by.
    """
    rows, p = matrix.shape
    length = np.linalg.norm(matrix, axis=0) if length is None else length
    _, found, directions = np.linalg.svd(matrix / np.where(length > 0, length, 1.0), full_matrices=rows < p)
    singular_values = np.zeros(p)
    singular_values[: len(found)] = found
    return singular_values, directions, length


def unscaled(v: Array, length: Array) -> Array:
    """The direction (p,) of the matrix' own columns that is v in those of unit length."""
    if (length == 0).any() and np.abs(v[length == 0]).max() > 1e-6:
        return np.where(length == 0, v, 0.0)  # a parameter without any influence is a direction of its own
    return v / np.where(length > 0, length, 1.0)


def pivots(directions: Array) -> list[int]:
    """Columns, one for each of d independent rows (d, p), that determine the space of these rows best."""
    from scipy.linalg import qr

    chosen: list[int] = qr(directions, mode="r", pivoting=True)[1][: len(directions)].tolist()
    return chosen


def reduced_basis(directions: Array, columns: list[int]) -> Array:
    """The basis (d, p) of the same space in which each row has a one in its own of the given d columns and zeros in the others.

    A direction along a few axes is found as such, whatever mixture of directions was given.
    """
    return np.asarray(np.linalg.solve(directions[:, columns], directions), dtype=np.float64)


def null_directions(vectors: Array, length: Array, names: tuple[str, ...]) -> tuple[Mapping[str, float], ...]:
    """Directions that span the same space as right singular vectors (d, p) of column-scaled sensitivities, as combinations.

    Each of several has a parameter of its own that is not in the others, so that one along a few parameters is shown as such.
    """
    if len(vectors) > 1:
        vectors = reduced_basis(vectors, pivots(vectors))
        vectors = np.where(np.abs(vectors) > ROUNDING, vectors, 0.0)
    return tuple(null_direction(v, length, names) for v in vectors)


def null_direction(v: Array, length: Array, names: tuple[str, ...]) -> Mapping[str, float]:
    """A right singular vector of column-scaled sensitivities as a combination of standardised parameters."""
    direction = unscaled(v, length)
    direction = direction / np.abs(direction).max()
    direction *= np.sign(direction[np.argmax(np.abs(direction))])
    # What is small counts all the same where the outputs feel it.
    counts = (np.abs(direction) > 1e-6) | ((np.abs(v) > 1e-6) & (length > 0))
    return FrozenMapping({name: float(c) for name, c, kept in zip(names, direction, counts, strict=True) if kept})
