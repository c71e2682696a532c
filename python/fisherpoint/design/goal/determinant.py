"""Criteria of determinants: "D", and "Ds" of some parameters."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from ...basics.values import Array
from ...engine import _core
from ..candidates.rank_updates import gains
from .criteria import Criterion, Slope, across, half_solved, padded, solved
from .estimable_space import Estimable


class Determinant(Criterion):
    """log det (K^T M^-1 K)^-1: "D" where K is the identity, "Ds" where it picks parameters and the others are nuisance."""

    def __init__(self, name: str, k: Array, whole: bool, of_all: bool = False, basis: Array | None = None) -> None:
        self.name, self.k, self.level = name, k, k.shape[1]
        self.whole = whole  # K spans everything, or all that is estimable: D, in whatever coordinates
        self.of_all = whole or of_all  # all that is estimable of K, whose columns are orthonormal
        self.plain = whole and k.shape[0] == k.shape[1]
        # Where F is singular, but whole: any B (p, r) with B^T F B of the same determinant, in which numbers are of one size.
        self.basis = k if basis is None else basis
        if whole:
            self.least = 1e-10
        if self.plain:
            self.small = 1e-4

    def log_phi(self, information: Array) -> float:
        solved = half_solved(information, self.k)
        if solved is None:
            return -np.inf
        return -2.0 * float(np.log(np.abs(np.diag(np.linalg.qr(solved, mode="r")))).sum()) / self.level

    def log_phis(self, matrices: Array) -> Array:
        def of_solved(solved: Array) -> Array:
            pivots = np.diagonal(np.linalg.qr(solved, mode="r"), axis1=1, axis2=2)
            return np.asarray(-2.0 * np.log(np.abs(pivots)).sum(axis=1) / self.level)

        return self._of_regular(matrices, of_solved)

    def slope(self, information: Array, share: float = 0.0, size: float | None = None) -> Slope:
        factor = np.asarray(np.linalg.cholesky(information), dtype=np.float64)
        whitened = np.linalg.solve(factor, self.k)
        r = np.asarray(np.linalg.qr(whitened, mode="r"), dtype=np.float64)
        # Z (K^T M^-1 K)^-1/2 with Z = M^-1 K, over sqrt(s)
        half = np.linalg.solve(factor.T, np.linalg.solve(r.T, whitened.T).T)
        log_phi = -2.0 * float(np.log(np.abs(np.diag(r))).sum()) / self.level
        return Slope(self, half / np.sqrt(self.level), log_phi, factor, 0.0)

    def _curvature(self, slope: Slope, matrices: Array) -> Array:
        inner = (slope.half.T @ matrices @ slope.half).reshape(len(matrices), -1)
        if self.plain:  # K is the identity: both products are tr(M^-1 F_i M^-1 F_j) / s
            return np.asarray(-self.level * (inner @ inner.T))
        rows = across(slope, matrices)
        return np.asarray(self.level * (inner @ inner.T) - 2.0 * (rows @ rows.T))

    def within(self, estimable: Estimable) -> Criterion:
        if self.whole:
            return Determinant(self.name, np.eye(estimable.rank), True)
        k = self._estimable_part(estimable.span) if self.of_all and len(estimable.null) else self.k
        return Determinant(self.name, estimable.into.T @ k, False, self.of_all)

    def restricted(self, span: Array) -> Criterion:
        if self.whole:
            return Determinant(self.name, np.asarray(span), True)
        return Determinant(self.name, self._estimable_part(span), False, True) if self.of_all else self

    def beside_nuisance(self, nuisance: int) -> Criterion:
        return Determinant(self.name, padded(self.k, nuisance), False, self.whole) if nuisance else self

    def outside(self, estimable: Estimable) -> float:
        return 0.0 if self.of_all else estimable.outside(self.k)

    def _estimable_part(self, span: Array) -> Array:
        """An orthonormal basis of what of K is in the span: all of a column, or of a sum of columns, or nothing."""
        u, s, _ = np.linalg.svd(span @ (span.T @ self.k), full_matrices=False)
        return np.asarray(u[:, s > 0.5])

    # --- What searches maximise: of parts of the parameters a ratio of the determinants of all and of the others -----------

    def restricted_to(self, space: Estimable) -> Criterion:
        found = super().restricted_to(space)
        if found is self or not self.whole:
            return found
        # Q^T F Q = T^T B^T F B T with T = (Q^T B)^-1, as F = Q (Q^T F Q) Q^T
        size = np.linalg.slogdet(space.span.T @ space.into)[1] / space.rank
        return Determinant(self.name, np.asarray(space.span), True, basis=space.into * np.exp(-size))

    def objective(self, fisher: Array) -> float:
        if not self.whole:
            return super().objective(fisher)
        return _core.log_det(fisher if self.plain else self.basis.T @ fisher @ self.basis)

    def objectives(self, fishers: Array) -> Array:
        if not self.plain:
            return super().objectives(fishers)
        sign, value = np.linalg.slogdet(fishers)
        return np.where(sign > 0, value, -np.inf)

    def added(self, fisher: Array, columns: Array) -> Array:
        if self.plain:
            return gains(fisher, columns)
        if self.whole:
            return gains(self.basis.T @ fisher @ self.basis, np.einsum("pq,pnk->qnk", self.basis, columns))
        others = np.einsum("pq,pnk->qnk", self._others, columns)
        return gains(fisher, columns) / gains(self._others.T @ fisher @ self._others, others)

    @cached_property
    def _others(self) -> Array:
        """An orthonormal basis of what K does not span."""
        return np.asarray(np.linalg.qr(self.k, mode="complete")[0][:, self.k.shape[1] :])

    def offset(self, fisher: Array, factor: Array) -> float:
        if not self.plain:
            return self.objective(fisher)
        return 2 * float(np.log(np.diag(factor)).sum()) + float(np.linalg.slogdet(fisher)[1])

    def in_coordinates(self, factor: Array) -> Criterion:
        if self.plain:
            return self
        if not self.whole:
            return Determinant(self.name, solved(factor, self.k), False, self.of_all)
        q, r = np.linalg.qr(factor.T @ self.basis)
        return Determinant(self.name, self.k, True, basis=q * np.exp(np.log(np.abs(np.diag(r))).mean()))

    def objective_slope(self, fisher: Array, rows: Array) -> tuple[float, Array]:
        if not self.whole:
            return super().objective_slope(fisher, rows)
        if self.plain:
            return float(np.linalg.slogdet(fisher)[1]), np.asarray(np.linalg.solve(fisher, rows.T).T)
        inner = self.basis.T @ fisher @ self.basis
        sign, log_det = np.linalg.slogdet(inner)
        if not sign > 0:
            raise np.linalg.LinAlgError("not positive definite")
        return float(log_det), np.asarray(np.linalg.solve(inner, (rows @ self.basis).T).T @ self.basis.T)


def log_det_slopes(fishers: Array, rows: Array) -> tuple[Array, Array] | None:
    """log det F (S,) of matrices (S, p, p), and F^-1 J^T of rows (S, k, p), transposed; None where one is singular."""
    sign, log_det = np.linalg.slogdet(fishers)
    if not (sign > 0).all():
        return None
    return log_det, np.asarray(np.linalg.solve(fishers, rows.swapaxes(1, 2)).swapaxes(1, 2), dtype=np.float64)


def slopes_of(criteria: Sequence[Criterion], fishers: Array, rows: Array) -> tuple[Array, Array] | None:
    """Objectives (S,) of S scenarios, and their derivatives times rows (S, k, p); None where an F is singular."""
    if all(one.plain for one in criteria):
        return log_det_slopes(fishers, rows)
    try:
        found = [one.objective_slope(fisher, own) for one, fisher, own in zip(criteria, fishers, rows, strict=True)]
    except np.linalg.LinAlgError:
        return None
    return np.array([value for value, _ in found]), np.stack([slope for _, slope in found])
