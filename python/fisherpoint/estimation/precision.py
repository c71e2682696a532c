"""Precision of an estimate from the residuals' derivatives: covariance, correlation, and directions that stay open."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array
from ..information.combinations import changes_of
from ..information.null_space import column_scaled_svd, pivots, reduced_basis, without_rounding
from .bordered import BorderedTangent

NULL, WEAK = 1e-8, 1e-4
"""Shares of the largest singular value, of columns scaled to length 1, below which a direction is null, and weak."""


POWERS = 30
"""Steps of a power iteration, after which it is within a few per cent."""


@dataclass(frozen=True, eq=False)
class Precision:
    """The inverse of F = J^T J for whitened residuals with the Jacobian J (M, P) in coordinates z, without columns of rounding.

    Attributes
    ----------
    information : ndarray, (P, P)
        F in its sum form, for parameters in units of z.
    covariance : ndarray, (P, P)
        Its pseudo-inverse over what is determined; see `determined`. Zero for unknowns that are held; the others'
        is with these there.
    determined : ndarray of bool, (P,)
        Whether an unknown is free, and takes part in no null direction.
    null, weak : ndarray, (k, P)
        Directions in z.
    """

    information: Array
    covariance: Array
    determined: np.ndarray
    null: Array
    weak: Array

    @classmethod
    def of(cls, jacobian: Array, held: NDArray[np.bool_] | None = None) -> Precision:
        if held is not None and held.any():
            return cls.of(jacobian[:, ~held])._among(jacobian, ~held)
        jacobian = without_rounding(jacobian)
        values, vectors, length = column_scaled_svd(jacobian)
        size = np.where(length > 0, length, 1.0)
        nonzero = values > NULL * max(values.max(initial=0.0), 1e-300)
        half = vectors[nonzero].T / values[nonzero] / size[:, None]
        null = vectors[~nonzero] / size
        if len(null):
            null = reduced_basis(null, pivots(null))
            null = null / np.abs(null).max(axis=1, keepdims=True)
        share = values / max(values.max(initial=0.0), 1e-300)
        weak = vectors[nonzero & (share < WEAK)] / size
        determined = ~(np.abs(null) > 1e-6).any(axis=0) if len(null) else np.ones(len(length), dtype=bool)
        return cls(jacobian.T @ jacobian, half @ half.T, determined, null, weak)

    @classmethod
    def of_blocks(cls, tangent: BorderedTangent) -> Precision:
        """The precision of a Jacobian that `is_clear`, from its factors: R^-1 R^-T, and no directions."""
        triangle = tangent.layout.triangle(tangent.factor)[0] * tangent.size[0]
        inverse = tangent.layout.inverse(tangent.factor)[0] / tangent.size[0][:, None]
        p = len(triangle)
        return cls(triangle.T @ triangle, inverse @ inverse.T, np.ones(p, dtype=bool), np.zeros((0, p)), np.zeros((0, p)))

    def _among(self, jacobian: Array, free: NDArray[np.bool_]) -> Precision:
        """This one of the free unknowns alone, as that of all."""
        p = len(free)
        covariance, determined = np.zeros((p, p)), np.zeros(p, dtype=bool)
        covariance[np.ix_(free, free)], determined[free] = self.covariance, self.determined
        null, weak = np.zeros((len(self.null), p)), np.zeros((len(self.weak), p))
        null[:, free], weak[:, free] = self.null, self.weak
        return Precision(jacobian.T @ jacobian, covariance, determined, null, weak)


def is_clear(tangent: BorderedTangent) -> bool:
    """Whether a Jacobian with columns of length 1 has no weak direction, by far."""
    if tangent.blank.any() or not tangent.factor.pivots().min(initial=1.0) > WEAK:
        return False
    triangle, inverse = tangent.layout.triangle(tangent.factor)[0], tangent.layout.inverse(tangent.factor)[0]
    return _largest(triangle) * _largest(inverse) < 0.5 / WEAK


def _largest(matrix: Array) -> float:
    """The largest singular value, by power iteration."""
    vector, length = np.cos(np.arange(len(matrix), dtype=np.float64)), 0.0
    for _ in range(POWERS):
        vector = matrix.T @ (matrix @ (vector / np.linalg.norm(vector)))
        length = float(np.sqrt(np.linalg.norm(vector)))
    return length


def covariances(jacobian: Array, held: NDArray[np.bool_] | None = None) -> tuple[Array, NDArray[np.bool_]]:
    """`Precision.covariance` (B, P, P) and `Precision.determined` (B, P) of B problems with Jacobians (B, M, P)."""
    count, rows, p = jacobian.shape
    jacobian = without_rounding(jacobian)
    if held is not None:
        jacobian = np.where(held[:, None, :], 0.0, jacobian)
    if rows < p:  # else the null space would not be complete
        jacobian = np.concatenate([jacobian, np.zeros((count, p - rows, p))], axis=1)
    length = np.linalg.norm(jacobian, axis=1)
    size = np.where(length > 0, length, 1.0)
    _, values, vectors = np.linalg.svd(jacobian / size[:, None, :], full_matrices=False)
    nonzero = values > NULL * np.maximum(values[:, :1], 1e-300)
    half = vectors * np.divide(1.0, values, out=np.zeros_like(values), where=nonzero)[:, :, None] / size[:, None, :]
    null = np.where(nonzero[:, :, None], 0.0, vectors)
    return half.transpose(0, 2, 1) @ half, np.square(null).sum(axis=1) < 1e-12


def quantile(level: float, degrees_of_freedom: Array) -> Array:
    """Half-width of two-sided intervals in standard errors: of Student's t, which for inf is the normal distribution."""
    from scipy.special import ndtri, stdtrit  # not scipy.stats, whose import takes a second

    bounded = np.isfinite(degrees_of_freedom)
    normal = np.full(degrees_of_freedom.shape, ndtri(0.5 + level / 2))
    return np.where(bounded, stdtrit(np.where(bounded, degrees_of_freedom, 1.0), 0.5 + level / 2), normal)


def in_words(directions: Array, slopes: Array, values: Array, names: tuple[str, ...]) -> tuple[str, ...]:
    """Directions (k, P) in z as relative changes of the unknowns, such as "k1 up 1 %, k2 down 1 %"."""
    relative = directions * slopes / np.where(values != 0, values, 1.0)
    return tuple(changes_of(direction, names) for direction in relative)
