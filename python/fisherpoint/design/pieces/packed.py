"""Many symmetric matrices, packed as their lower triangles row after row, and log det of them or of a Schur complement."""

from __future__ import annotations

import numpy as np

from ...basics.values import Array


class Packed:
    """Symmetric matrices of n = nuisance + p rows as vectors of n (n + 1) / 2 numbers.

    `log_dets` and `gradient` are those of the Schur complement of the first rows, which belong to nuisance parameters.
    """

    def __init__(self, p: int, nuisance: int = 0) -> None:
        self.p, self.nuisance, self.size = p, nuisance, p + nuisance
        self._places = np.tril_indices(self.size)
        self._weights = np.where(self._places[0] == self._places[1], 1.0, 2.0)

    def whole(self, packed: Array) -> Array:
        """The matrices (..., n, n)."""
        matrices = np.empty((*packed.shape[:-1], self.size, self.size))
        matrices[..., self._places[0], self._places[1]] = packed
        matrices[..., self._places[1], self._places[0]] = packed
        return matrices

    def of(self, matrices: Array) -> Array:
        """Matrices (..., n, n), packed."""
        return np.asarray(matrices[..., self._places[0], self._places[1]])

    def gradient(self, matrix: Array) -> Array:
        """Gradient of log det at a packed positive definite M: its product with a packed F is tr(G F), G = M^-1 - M_cc^-1."""
        from scipy.linalg import cho_factor, cho_solve

        whole, q = self.whole(matrix), self.nuisance
        solved = cho_solve(cho_factor(whole, lower=True), np.eye(self.size))
        if q:
            solved[:q, :q] -= cho_solve(cho_factor(whole[:q, :q], lower=True), np.eye(q))
        return np.asarray(self.of((solved + solved.T) / 2) * self._weights)

    def log_dets(self, packed: Array) -> Array:
        """log det by Cholesky of all matrices (..., m) at once; -inf where one is not positive definite."""
        matrices = np.moveaxis(self.whole(packed), (-2, -1), (0, 1))
        value = np.zeros(packed.shape[:-1])
        with np.errstate(divide="ignore", invalid="ignore"):
            for j in range(self.size):
                pivot = matrices[j, j]
                if j >= self.nuisance:
                    value += np.log(np.where(pivot > 0, pivot, 0.0))
                below = matrices[j + 1 :, j]
                matrices[j + 1 :, j + 1 :] -= below[:, None] * (below / pivot)[None]
        return np.where(np.isnan(value), -np.inf, value)

    def in_coordinates(self, packed: Array, factor: Array) -> None:
        """Make C^-T F C^-1 of every packed F (K, m), in place, with C upper triangular."""
        from scipy.linalg import solve_triangular

        units = self.whole(np.eye(packed.shape[1]))
        half = np.stack([solve_triangular(factor, unit, trans="T") for unit in units])
        moved = np.stack([solve_triangular(factor, one.T, trans="T").T for one in half])
        change = self.of((moved + moved.transpose(0, 2, 1)) / 2)
        for first in range(0, len(packed), 1 << 16):
            packed[first : first + (1 << 16)] = packed[first : first + (1 << 16)] @ change

    def rank(self, matrix: Array, smallest: float) -> int:
        """Eigenvalues of a packed matrix above a share of the largest."""
        values = np.linalg.eigvalsh(self.whole(matrix))
        return int((values > smallest * max(float(values[-1]), 0.0)).sum())
