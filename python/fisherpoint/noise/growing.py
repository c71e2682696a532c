"""Information of normal readings whose covariance depends on the noise-free outputs y too: J^T M J.

M = Q + (G Q) o (G Q)^T + Q o (G Q G^T) with Q = R^-1, where dR / dy_k = e_k g_k^T + g_k e_k^T and G has the rows g_k. Where G is
diagonal, with half the slopes of the variances, that is Q + 2 c c^T o Q o Q.
"""

from __future__ import annotations

import numpy as np

from ..basics.values import Array


def dense_rows(j: Array, r: Array, g: Array) -> Array:
    """M^1/2 J (M, p) of derivatives J (M, p), by a whole covariance R and G (M, M)."""
    q = np.linalg.inv(r)
    q = (q + q.T) / 2
    turned = g @ q
    m = q + turned * turned.T + q * (turned @ g.T)
    return np.asarray(np.linalg.cholesky((m + m.T) / 2).T @ j)


def rows_beside_common(j: Array, moved: Array, variance: Array, slope: Array) -> Array:
    """M^1/2 J (K, M, p) where R = diag(variance) + H H^T, in a time that grows as the number of readings.

    Parameters
    ----------
    j : ndarray, (K, M, p)
    moved : ndarray, (K, M, q)
        H: by how much readings move with a standard deviation of what they have in common.
    variance, slope : ndarray, (K, M)
        Of the readings' own noise, and half its derivative by y.

    M is a diagonal A and products of few columns, as R^-1 = D^-1 - V V^T: A^1/2 (I + U diag(e) U^T) A^1/2, whose root has
    sqrt(1 + e) - 1 for e.
    """
    own = 1 / variance
    h = moved * np.sqrt(own)[..., None]
    u, s, _ = np.linalg.svd(h, full_matrices=False)
    v = u * (s / np.sqrt(1 + np.square(s)))[..., None, :] * np.sqrt(own)[..., None]
    lost = np.square(v).sum(axis=-1)
    a = own + 2 * np.square(slope) * (np.square(own) - 2 * own * lost)
    pairs = (v[..., :, None] * v[..., None, :]).reshape(*v.shape[:2], -1)
    low = np.concatenate([v, np.sqrt(2) * slope[..., None] * pairs], axis=2) / np.sqrt(a)[..., None]
    signs = np.concatenate([-np.ones(v.shape[2]), np.ones(pairs.shape[2])])
    basis, t = np.linalg.qr(low)
    e, turn = np.linalg.eigh((t * signs) @ t.swapaxes(-1, -2))
    directions = basis @ turn
    rows = j * np.sqrt(a)[..., None]
    grown = np.sqrt(np.maximum(1 + e, 0.0)) - 1
    return np.asarray(rows + directions @ (grown[..., None] * (directions.swapaxes(-1, -2) @ rows)))
