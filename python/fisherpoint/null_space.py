"""Singular values and null directions of sensitivities, with columns scaled to unit length so that no unit counts."""

from __future__ import annotations

import numpy as np

from .quantity import Array


def column_scaled_svd(matrix: Array) -> tuple[Array, Array, Array]:
    """Singular values, largest first (p,), right singular vectors as rows (p, p), and the columns' lengths (p,), of (m, p)."""
    rows, p = matrix.shape
    length = np.linalg.norm(matrix, axis=0)
    _, found, directions = np.linalg.svd(matrix / np.where(length > 0, length, 1.0), full_matrices=rows < p)
    singular_values = np.zeros(p)
    singular_values[: len(found)] = found
    return singular_values, directions, length


def unscaled(v: Array, length: Array) -> Array:
    """The direction (p,) of the matrix' own columns that is v in those of unit length."""
    if (length == 0).any() and np.abs(v[length == 0]).max() > 1e-6:
        return np.where(length == 0, v, 0.0)  # a parameter without any influence is a direction of its own
    direction: Array = v / np.where(length > 0, length, 1.0)
    return direction


def reduced_basis(directions: Array) -> Array:
    """Another basis (d, p) of the space of d orthonormal rows, in which each has a one where the others have zeros.

    A direction along a few axes is found as such, whatever mixture of directions was given.
    """
    basis = directions.copy()
    for step in range(len(basis)):
        row, column = np.unravel_index(np.argmax(np.abs(basis[step:])), basis[step:].shape)
        basis[[step, step + row]] = basis[[step + row, step]]
        basis[step] /= basis[step, column]
        others = np.arange(len(basis)) != step
        basis[others] -= np.outer(basis[others, column], basis[step])
    return basis
