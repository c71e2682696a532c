"""What moves several numbers at once, beside their own noise."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..basics.values import Array

NOTHING_LEFT = 1e-11
"""Share of a row's length, before free numbers were taken out, that counts as rounding."""


class CommonError(NamedTuple):
    """M numbers whose covariance, in units of their own noise, is I + B B^T = I + U diag(s^2) U^T.

    directions U (..., M, k), with columns of length 1, and sizes s (..., k).
    """

    directions: Array
    sizes: Array

    @classmethod
    def of(cls, moved: Array) -> CommonError:
        """From B (..., M, q): by how much the numbers move with a standard deviation of each cause."""
        u, s, _ = np.linalg.svd(moved, full_matrices=False)
        return cls(u, s)

    @property
    def variances(self) -> Array:
        """Variances of the numbers, (..., M)."""
        return np.asarray(1 + np.square(self.directions * self.sizes[..., None, :]).sum(axis=-1))

    def whitened(self, rows: Array) -> Array:
        """(I + B B^T)^-1/2 A of rows A (..., M, p)."""
        shrink = 1 / np.sqrt(1 + np.square(self.sizes)) - 1
        white: Array = rows + self.directions @ (shrink[..., None] * (self.directions.swapaxes(-1, -2) @ rows))
        return white


def beside_free(rows: Array, by: Array) -> Array:
    """White rows (K, N, n_y, p) of runs in which further unknowns are free: without what lies along `by` (K, N, n_y, q).

    This is the limit of an error along `by` whose size has no bound: rows (I - Q Q^T) A, with an orthonormal basis Q of `by`.
    """
    if not by.shape[3]:
        return rows
    flat, along = (array.reshape(len(array), -1, array.shape[3]) for array in (rows, by))
    length = np.linalg.norm(along, axis=1, keepdims=True)
    directions, sizes, _ = np.linalg.svd(along / np.where(length > 0, length, 1.0), full_matrices=False)
    directions = directions * (sizes > NOTHING_LEFT)[:, None, :]
    left = flat - directions @ (directions.swapaxes(1, 2) @ flat)
    left -= directions @ (directions.swapaxes(1, 2) @ left)  # twice is enough
    kept = np.linalg.norm(left, axis=1, keepdims=True) > NOTHING_LEFT * np.linalg.norm(flat, axis=1, keepdims=True)
    return np.where(kept, left, 0.0).reshape(rows.shape)
