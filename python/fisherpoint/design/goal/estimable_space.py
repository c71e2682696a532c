"""Estimable space of candidates: directions of the parameters that designs of them can determine, and those that none can."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...basics.field_checks import Extents
from ...basics.values import Array
from ...information.null_space import column_scaled_svd, without_rounding

RANK_TOLERANCE = 1e-9
"""Singular values of the column-scaled sensitivities below this share of the largest count as zero."""

RIDGE = 1e-9
"""Share of the prior's information, or of that of all candidates, that is added to F while a design is singular.

So singular designs can be compared; reports say where it was.
"""

SINGULAR = 1e-13
"""Eigenvalue of the information of all candidates, scaled to order one, below which a combination is not estimable."""


@dataclass(frozen=True, eq=False)
class Estimable:
    """Coordinates of what is estimable, in which the mean of all information matrices is the identity.

    Attributes
    ----------
    into : ndarray, (p, r)
        B: a matrix M becomes B^T M B.
    span : ndarray, (p, r)
        Q: an orthonormal basis of the range of all information matrices.
    null : ndarray, (p - r, p)
        Right singular vectors of the column-scaled sensitivities that belong to no information.
    length : ndarray, (p,)
        Lengths by which the columns were divided before.
    """

    into: Array
    span: Array
    null: Array
    length: Array

    _EXTENTS: ClassVar[Extents] = {"into": ("p", "r"), "span": ("p", "r"), "null": ("*", "p"), "length": ("p",)}

    @property
    def rank(self) -> int:
        return int(self.into.shape[1])

    @property
    def orthonormal(self) -> Estimable:
        """The estimable space in orthonormal coordinates, where lengths are those of the parameters."""
        return Estimable(self.span, self.span, self.null, self.length)

    def projected(self, k: Array) -> Array:
        """The part of the columns of K (p, s) that is estimable."""
        return np.asarray(self.span @ (self.span.T @ k)) if len(self.null) else k

    def outside(self, k: Array) -> float:
        """The largest share of a column of K that is not estimable."""
        size = np.linalg.norm(k, axis=0)
        rest = np.linalg.norm(k - self.projected(k), axis=0)
        return float((rest / np.where(size > 0, size, 1.0)).max())


def estimable(triangle: Array) -> Estimable:
    """Return the estimable space of R (p, p), with R^T R the mean of all information matrices, per prior standard deviation."""
    values, directions, length = column_scaled_svd(without_rounding(triangle))
    rank = int((values > RANK_TOLERANCE * max(float(values.max()), 1e-300)).sum())
    size = np.where(length > 0, length, 1.0)[:, None]
    into = directions[:rank].T / values[:rank] / size
    span = np.eye(len(length)) if rank == len(length) else np.linalg.qr(directions[:rank].T * size)[0]
    return Estimable(into, span, directions[rank:], length)
