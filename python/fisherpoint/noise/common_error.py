"""What moves several numbers at once, beside their own noise."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..basics.values import Array


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
