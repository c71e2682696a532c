"""Candidates as rows: the information matrix of each is F_i = J_i^T J_i, to which a constant may be added.

tr(G F_i) = |J_i Y|^2 with G = Y Y^T, which is needed of all candidates, is a product of matrices; F_i itself is formed for the few
that are examined more closely.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array

Places = NDArray[np.intp]

ROUNDING = 1e-15
"""Eigenvalues of a matrix of information, of unit diagonal, that are none, as a share of the largest and for each parameter."""

AT_ONCE = 1 << 15
"""Rows that are squared at once, so that memory stays bounded."""

PRODUCT = 1 << 17
"""Multiplications of a product of matrices at once: it stays in the cache, and no library thinks it worth several threads."""


class CandidateRows:
    """Whitened sensitivities of K candidates.

    Parameters
    ----------
    rows : ndarray, (K, n, p), or (K, S, n, p) of S scenarios
        dy/dtheta in units of the noise and of the parameters' scale. With scenarios F_i has the matrices there as blocks on its
        diagonal.
    constant : ndarray, (p, p), or (S, p, p), optional
        What is added to each F_i, the same in every scenario or not: a share of information that is there already.
    """

    def __init__(self, rows: Array, constant: Array | None = None) -> None:
        self.rows, self.constant = rows, constant

    @property
    def parts(self) -> list[CandidateRows]:
        """The candidates in each scenario; themselves where there are none."""
        if self.rows.ndim == 3:
            return [self]
        constant, rows = self.constant, np.moveaxis(self.rows, 1, 0)
        varies = constant is not None and constant.ndim == 3
        return [CandidateRows(own, constant[s] if constant is not None and varies else constant) for s, own in enumerate(rows)]

    def _places(self, into: Array) -> list[tuple[CandidateRows, Array, NDArray[np.intp]]]:
        """The candidates in each scenario, what of columns (S p, q) belongs to it, and which of these are not zero there."""
        parts, p, found = self.parts, self.rows.shape[-1], []
        for s, part in enumerate(parts):
            own = into[s * p : (s + 1) * p]
            there = np.flatnonzero(own.any(axis=0))
            found.append((part, own[:, there], there))
        return found

    def __len__(self) -> int:
        return len(self.rows)

    def along(self, half: Array) -> Array:
        """tr(Y Y^T F_i) for every candidate, (K,)."""
        if self.rows.ndim == 4:
            return np.asarray(sum(part.along(own) for part, own, _ in self._places(half)))
        count, _, p = self.rows.shape
        result = np.empty(count)
        step = max(1, PRODUCT // max(1, self.rows[:1].size * half.shape[1]))
        for first in range(0, count, step):
            part = self.rows[first : first + step]
            product = part.reshape(-1, p) @ half
            np.einsum("ij,ij->i", *(2 * [product.reshape(len(part), -1)]), out=result[first : first + len(part)])
        if self.constant is not None:
            result += np.einsum("jq,jk,kq->", half, self.constant, half)
        return result

    def matrices(self, chosen: Places, into: Array) -> Array:
        """B^T F_i B (m, r, r) of those that are chosen."""
        if self.rows.ndim == 4:
            blocks = np.zeros((len(chosen), into.shape[1], into.shape[1]))
            for part, own, there in self._places(into):
                blocks[:, there[:, None], there] = part.matrices(chosen, own)
            return blocks
        rows = self.rows[chosen] @ into
        matrices = np.swapaxes(rows, 1, 2) @ rows
        return np.asarray(matrices if self.constant is None else matrices + into.T @ self.constant @ into)

    def information(self, chosen: Places, weights: Array) -> Array:
        """sum_i w_i F_i, (p, p), or (S p, S p)."""
        if self.rows.ndim == 4:
            p, count = self.rows.shape[3], self.rows.shape[1]
            total = np.zeros((count * p, count * p))
            for s, part in enumerate(self.parts):
                total[s * p : (s + 1) * p, s * p : (s + 1) * p] = part.information(chosen, weights)
            return total
        rows = (self.rows[chosen] * np.sqrt(weights)[:, None, None]).reshape(-1, self.rows.shape[2])
        return np.asarray(rows.T @ rows if self.constant is None else rows.T @ rows + weights.sum() * self.constant)

    def triangle(self) -> Array:
        """R (p, p) with R^T R the mean of all F_i, without squares of small numbers where these would lose digits."""
        count, _, p = self.rows.shape
        flat = self.rows.reshape(-1, p)
        gram = np.zeros((p, p))
        for first in range(0, len(flat), AT_ONCE):
            part = flat[first : first + AT_ONCE]
            gram += part.T @ part
        gram = gram / count if self.constant is None else gram / count + self.constant
        scale = np.sqrt(np.diag(gram))
        if (scale > 0).all() and np.linalg.eigvalsh(gram / np.outer(scale, scale))[0] > 1e-8:
            return np.asarray(np.linalg.cholesky(gram).T)
        r = np.zeros((0, p)) if self.constant is None else symmetric_root(self.constant) * np.sqrt(count)
        for first in range(0, len(flat), AT_ONCE):
            r = np.linalg.qr(np.concatenate([r, flat[first : first + AT_ONCE]]), mode="r")
        return np.asarray(np.concatenate([r, np.zeros((max(0, p - len(r)), p))]) / np.sqrt(count))


def symmetric_root(matrix: Array) -> Array:
    """H (p, p) with H^T H the positive semidefinite matrix; what is rounding is zero, as its root would be far from that."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    size = np.where(scale > 0, scale, 1.0)
    values, vectors = np.linalg.eigh(matrix / np.outer(size, size))
    kept = np.where(values > ROUNDING * len(values) * values[-1], values, 0.0)
    return np.asarray((vectors * np.sqrt(kept)).T * size)
