"""Rank updates of an information matrix F: criteria of F + W_i W_i^T for many candidates, all side by side.

W_i (p, n) are the whitened rows of a candidate as columns. With F = L L^T and G_i = L^-1 W_i,

    det(F + W W^T) / det F          = det(I + G^T G)                                   (the matrix determinant lemma)
    K^T (F + W W^T)^-1 K            = H^T H - H^T G (I + G^T G)^-1 G^T H,  H = L^-1 K  (Woodbury).

Columns of all candidates lie side by side, (p, n, N), so that each operation is one over all of them.
"""

from __future__ import annotations

import numpy as np

from ...basics.values import Array
from ...engine.levels import kernels


def gains(fisher: Array, columns: Array) -> Array:
    """det(F + W W^T) / det F, (N,), of columns (p, n, N)."""
    return kernels.determinant_gains(np.linalg.cholesky(fisher), columns)


def variances(fisher: Array, columns: Array, k: Array) -> Array:
    """tr(K^T (F + W W^T)^-1 K), (N,), of columns (p, n, N) and K (p, q)."""
    factor = np.asarray(np.linalg.cholesky(fisher), dtype=np.float64)
    g, h = kernels.divided(factor, columns), np.linalg.solve(factor, k)
    p, n, count = g.shape
    if n > p:
        lower = _factored(np.einsum("pnk,qnk->pqk", g, g) + np.eye(p)[:, :, None])
        return _squares(lower, np.broadcast_to(h.T[:, :, None], (*h.T.shape, count)))
    lower = _factored(np.einsum("pnk,pmk->nmk", g, g) + np.eye(n)[:, :, None])
    before = float(np.square(h).sum())
    reduction = _squares(lower, np.einsum("pq,pnk->qnk", h, g))
    return np.maximum(before - reduction, np.finfo(float).eps * before)


def smallest_at_most(fisher: Array, columns: Array) -> Array:
    """Upper bound of the smallest eigenvalue of F + W W^T, (N,): that in the plane of the two smallest of F."""
    values, vectors = np.linalg.eigh(fisher)
    return _of_a_plane(values[:2], vectors[:, :2], columns, -1.0)


def largest_at_least(fisher: Array, columns: Array) -> Array:
    """Lower bound of the largest eigenvalue of F + W W^T, (N,): that in the plane of the two largest of F."""
    values, vectors = np.linalg.eigh(fisher)
    return _of_a_plane(values[-2:], vectors[:, -2:], columns, 1.0)


def eigenvalues(fisher: Array, columns: Array) -> Array:
    """The eigenvalues of F + W W^T, (N, p), ascending."""
    w = columns.transpose(2, 0, 1)
    return np.asarray(np.linalg.eigvalsh(fisher + w @ w.swapaxes(1, 2)), dtype=np.float64)


def _of_a_plane(values: Array, vectors: Array, columns: Array, side: float) -> Array:
    """The smaller (-1) or larger (1) eigenvalue of F + W W^T as seen in the plane, or on the line, of some eigenvectors of F."""
    across = np.einsum("pq,pnk->qnk", vectors, columns)
    square = np.einsum("qnk,qnk->qk", across, across) + values[:, None]
    if len(values) == 1:
        return np.asarray(square[0])
    mixed = np.einsum("nk,nk->k", across[0], across[1])
    half = (square[0] - square[1]) / 2
    return np.asarray((square[0] + square[1]) / 2 + side * np.sqrt(half * half + mixed * mixed))


def _factored(matrices: Array) -> Array:
    """Lower triangles L of positive definite matrices (n, n, N), which are overwritten; what is above them is not zeroed."""
    for k in range(len(matrices)):
        matrices[k, k] = np.sqrt(matrices[k, k])
        matrices[k + 1 :, k] /= matrices[k, k]
        for i in range(k + 1, len(matrices)):
            matrices[i, k + 1 : i + 1] -= matrices[i, k] * matrices[k + 1 : i + 1, k]
    return matrices


def _squares(lower: Array, sides: Array) -> Array:
    """|L^-1 B|^2, (N,), of triangles (n, n, N) and B as rows (q, n, N)."""
    solved = np.empty(sides.shape)
    for i in range(len(lower)):
        rest = sides[:, i].copy()
        for j in range(i):
            rest -= lower[i, j] * solved[:, j]
        solved[:, i] = rest / lower[i, i]
    return np.asarray(np.einsum("qnk,qnk->k", solved, solved))
