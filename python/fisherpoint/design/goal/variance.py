"""Criteria of variances: "A" of all parameters, "c" of a function of them, "I" of predictions."""

from __future__ import annotations

import numpy as np

from ...basics.values import Array
from ..candidates.rank_updates import variances
from .criteria import Criterion, Slope, across, half_solved, padded, solved
from .estimable_space import Estimable


class Variance(Criterion):
    """tr(K^T M^-1 K): "A" where K scales the parameters, "c" for one function of them, "I" for predictions."""

    def __init__(self, name: str, k: Array, whole: bool = False) -> None:
        self.name, self.k, self.level = name, k, 1
        self.whole = whole  # "A", for all that is estimable

    def of_log_phi(self, log_phi: float) -> float:
        return float(np.exp(-log_phi))

    def gradient(self, information: Array) -> Array:
        slope = self.slope(information)
        return np.asarray(-np.exp(-slope.log_phi) * slope.gradient)

    def log_phi(self, information: Array) -> float:
        solved = half_solved(information, self.k)
        return -np.inf if solved is None else -float(np.log(np.square(solved).sum()))

    def log_phis(self, matrices: Array) -> Array:
        return self._of_regular(matrices, lambda solved: np.asarray(-np.log(np.square(solved).sum(axis=(1, 2)))))

    def slope(self, information: Array, share: float = 0.0, size: float | None = None) -> Slope:
        factor = np.asarray(np.linalg.cholesky(information), dtype=np.float64)
        whitened = np.linalg.solve(factor, self.k)
        variance = float(np.square(whitened).sum())
        half = np.linalg.solve(factor.T, whitened) / np.sqrt(variance)
        return Slope(self, half, -float(np.log(variance)), factor, 0.0)

    def _curvature(self, slope: Slope, matrices: Array) -> Array:
        rows, along = across(slope, matrices), slope.along(matrices)
        return np.asarray(np.outer(along, along) - 2.0 * (rows @ rows.T))

    def within(self, estimable: Estimable) -> Criterion:
        return Variance(self.name, estimable.into.T @ estimable.projected(self.k), self.whole)

    def restricted(self, span: Array) -> Criterion:
        return Variance(self.name, span @ (span.T @ self.k)) if self.whole else self

    def beside_nuisance(self, nuisance: int) -> Criterion:
        return Variance(self.name, padded(self.k, nuisance), self.whole) if nuisance else self

    def outside(self, estimable: Estimable) -> float:
        return 0.0 if self.whole else estimable.outside(self.k)

    def added(self, fisher: Array, columns: Array) -> Array:
        return 1 / variances(fisher, columns, self.k)

    def in_coordinates(self, factor: Array) -> Criterion:
        return Variance(self.name, solved(factor, self.k))
