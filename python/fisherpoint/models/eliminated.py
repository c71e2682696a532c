"""Which unknowns of linear equations are determined, and which of them depend on each other, by elimination at many points.

The groups are the connected components of the matroid of the columns: the finest partition of the unknowns for which the row space
is the direct sum of row spaces of the groups. In reduced row echelon form, the column of a pivot is connected with those that have
an entry in its row [J. Oxley, Matroid Theory, chapter 4]. An unknown is determined where its column has a pivot, and is connected
with no other: its unit vector is in the row space.

That is the decomposition of Dulmage and Mendelsohn with the rank by numbers in place of the size of a matching: equations that are
the same twice have a matching, and no rank.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array

ZERO, NUMBER = 0.01, 100.0
"""A number is zero up to the first many times what operations that are off by 1e-12 change in it: rounding is ten thousand times
less. It is none from the second many times on. A point does not count at which a number is between them."""

FLOOR, DOUBTFUL = 1e-14, 1e-10
"""The same as shares of an equation, after scaling: what is off may cancel where numbers do."""

BLURRED = 1e-8
"""A point does not count at which that is more than this of an equation, after scaling, in what is taken for zero."""

SMALLEST, LARGEST = 1e-150, 1e150
"""A point does not count at which a number is out of this range, and not zero: it is about to underflow or overflow."""

LEAST_SHARE = 0.5
"""Share of the points at which there must be an answer."""


class Eliminated(NamedTuple):
    """Unknowns (m,) that are determined at every point, and pairs (m, m) that are connected at any."""

    determined: NDArray[np.bool_]
    connected: NDArray[np.bool_]


def eliminated(exact: Array, off: Array) -> Eliminated | None:
    """Reduce the matrices (K, n, m) of K points; None where fewer than half of them have an answer.

    Parameters
    ----------
    exact, off : ndarray, (K, n, m), n and m not zero
        The same matrices twice, the second one with every number off by what is far more than rounding.
    """
    points, rows, columns = exact.shape
    pair = np.stack([exact, off])
    size = np.abs(pair)
    clear = (((size > SMALLEST) & (size < LARGEST)) | (size == 0)).all(axis=(0, 2, 3))
    pair[:, ~clear] = 0.0
    rounding = pair[0] != pair[1]
    clear &= ~_drop_zeros(pair, 0.0, 0.0)  # sizes are not known yet
    nonzero = pair[0] != 0
    # What is zero everywhere is so by an identity. What is rounding at some points only has saturated there, as a tanh far out.
    clear &= ~(rounding & ~nonzero & nonzero[clear].any(axis=0)).any(axis=(1, 2))
    _scale(pair)
    at, free = np.arange(points), np.ones((points, rows), dtype=bool)
    row_of = np.full((points, columns), -1)
    for _ in range(min(rows, columns)):
        size = np.abs(pair[0]) * free[:, :, None]
        row, column = np.unravel_index(size.reshape(points, -1).argmax(axis=1), (rows, columns))
        on = size[at, row, column] > 0
        if not on.any():
            break
        k, i, j = at[on], row[on], column[on]
        pivot_row = pair[:, k, i] / pair[:, k, i, j][..., None]
        pair[:, k] -= pair[:, k, :, j].transpose(1, 0, 2)[..., None] * pivot_row[:, :, None, :]
        pair[:, k, i] = pivot_row
        pair[:, k, :, j] = 0.0
        pair[:, k, i, j] = 1.0
        free[k, i], row_of[k, j] = False, i
        clear &= ~_drop_zeros(pair, FLOOR, DOUBTFUL)
    if np.count_nonzero(clear) < LEAST_SHARE * points:
        return None
    determined, connected = np.ones(columns, dtype=bool), np.zeros((columns, columns), dtype=bool)
    for k in at[clear]:
        pivots = np.flatnonzero(row_of[k] >= 0)
        entries = pair[0, k, row_of[k, pivots]] != 0
        connected[pivots] |= entries
        alone = np.zeros(columns, dtype=bool)
        alone[pivots] = entries.sum(axis=1) == 1  # its own
        determined &= alone
    return Eliminated(determined, connected | connected.T)


def _drop_zeros(pair: Array, floor: float, doubtful: float) -> NDArray[np.bool_]:
    """Set to zero what is rounding, and return the points (K,) at which that is in doubt."""
    size, change = np.abs(pair[0]), np.abs(pair[0] - pair[1])
    zero = size <= np.maximum(ZERO * change, floor)
    open_ones = ~zero & (size < np.maximum(NUMBER * change, doubtful))
    pair[:, zero] = 0.0
    if doubtful:
        open_ones |= zero & (change > BLURRED)
    doubts: NDArray[np.bool_] = open_ones.any(axis=(1, 2))
    return doubts


def _scale(pair: Array) -> None:
    """Bring the geometric means of all rows and columns to about one, then the largest of each column, then of each row."""
    nonzero = pair[0] != 0
    sizes = np.log(np.abs(pair[0]), out=np.zeros(nonzero.shape), where=nonzero)
    shift = np.zeros(nonzero.shape)
    for axis in (1, 2) * 4:
        count = np.maximum(nonzero.sum(axis=axis, keepdims=True), 1)
        shift -= ((sizes + shift) * nonzero).sum(axis=axis, keepdims=True) / count
    for axis in (1, 2):
        largest = np.where(nonzero, sizes + shift, -np.inf).max(axis=axis, keepdims=True)
        shift -= np.where(np.isfinite(largest), largest, 0.0)
    pair /= np.where(nonzero, np.abs(pair[0]), 1.0)
    pair *= np.where(nonzero, np.exp(np.where(nonzero, sizes + shift, 0.0)), 1.0)
