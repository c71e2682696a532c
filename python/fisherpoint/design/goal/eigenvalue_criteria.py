"""Criteria of eigenvalues: the smallest one, "E", and the ratio of the largest to it, "ME"."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...basics.values import Array
from ..candidates.rank_updates import eigenvalues, largest_at_least, smallest_at_most
from .criteria import SINGULAR, Criterion, Slope, half_solved, padded
from .estimable_space import Estimable
from .scenario_average import SOFTNESS


@dataclass(frozen=True, eq=False)
class Scaled:
    """A = S F S with the scales S, whose eigenvalues are taken, as a function of information M.

    Either F is M, and A = K^T M K with K = S. Or M is about nuisance parameters too, and F is its Schur complement: then
    A = (K^T M^- K)^-1, with K = S^-1 and rows of zeros for the nuisance parameters.
    """

    k: Array
    marginal: bool = False

    def of(self, matrices: Array) -> Array:
        """A (..., r, r); zero where F is marginal, and M does not determine it."""
        if not self.marginal:
            return np.asarray(self.k.T @ matrices @ self.k)
        r = self.k.shape[1]
        found = [self._of_one(matrix) for matrix in matrices.reshape(-1, *matrices.shape[-2:])]
        return np.array(found).reshape(*matrices.shape[:-2], r, r)

    def _of_one(self, matrix: Array) -> Array:
        solved = half_solved(matrix, self.k)
        if solved is None:
            return np.zeros((self.k.shape[1], self.k.shape[1]))
        inverse = np.linalg.inv(np.linalg.qr(solved, mode="r"))  # of a triangle
        return np.asarray(inverse @ inverse.T)

    def tangent(self, matrix: Array) -> Array:
        """W (p, r): A changes by W^T dM W to first order. M is regular where F is marginal."""
        return np.asarray(np.linalg.solve(matrix, self.k) @ self.of(matrix)) if self.marginal else self.k

    def across(self, matrix: Array) -> Array:
        """B (p, p): the second derivative of A is -W^T dM B^T B dM W, twice; zero where A is linear in M."""
        if not self.marginal:
            return np.zeros((0, len(matrix)))
        factor = np.linalg.cholesky(matrix)
        basis = np.linalg.qr(np.linalg.solve(factor, self.k))[0]
        inverse = np.linalg.inv(factor)  # of a triangle
        return np.asarray(inverse - basis @ (basis.T @ inverse))

    def in_coordinates(self, factor: Array) -> Scaled:
        """Return A as a function of matrices L^-1 M L^-T."""
        return (
            Scaled(np.asarray(np.linalg.solve(factor, self.k), dtype=np.float64), True)
            if self.marginal
            else Scaled(factor.T @ self.k)
        )

    def within(self, estimable: Estimable) -> Scaled:
        """Return A as a function of matrices B^T M B, in the coordinates of what is estimable."""
        if self.marginal:
            k = self.restricted(estimable.span).k if len(estimable.null) else self.k
            return Scaled(estimable.into.T @ k, True)
        # M = Q M_q Q^T and M' = (Q^T B)^T M_q (Q^T B); the eigenvalues of S M S that are not 0 are those of R M_q R^T, (S Q) = U R
        r = np.asarray(np.linalg.qr(self.k.T @ estimable.span, mode="r"), dtype=np.float64)
        return Scaled(np.asarray(np.linalg.solve(estimable.span.T @ estimable.into, r.T), dtype=np.float64))

    def restricted(self, span: Array) -> Scaled:
        """Return A with only the eigenvalues that are not 0 for every M in the span (p, r)."""
        if not self.marginal:
            r = np.asarray(np.linalg.qr(self.k.T @ span, mode="r"), dtype=np.float64)
            return Scaled(np.asarray(span @ r.T))
        # F = Q C Q^T, S Q = U R: the eigenvalues are those of R C R^T, and C^-1 = Q^T M^- Q
        basis, of_basis = np.linalg.qr(self.k)
        u, s, _ = np.linalg.svd(span @ (span.T @ basis), full_matrices=False)
        q = u[:, s > 0.5]
        triangle = np.asarray(np.linalg.qr(np.linalg.solve(of_basis, basis.T @ q), mode="r"), dtype=np.float64)
        return Scaled(np.asarray(np.linalg.solve(triangle.T, q.T).T, dtype=np.float64), True)

    def beside_nuisance(self, nuisance: int) -> Scaled:
        """Return A as a function of information that has `nuisance` more rows, behind the parameters."""
        inverse = np.asarray(np.linalg.inv(self.k), dtype=np.float64)  # of the diagonal matrix S
        return Scaled(padded(inverse, nuisance), True)


class OfEigenvalues(Criterion):
    """A criterion of the eigenvalues of A."""

    relative = False  # to the largest one

    def __init__(self, scaled: Scaled) -> None:
        self.scaled, self.k, self.bounded = scaled, scaled.k, not scaled.marginal

    def within(self, estimable: Estimable) -> Criterion:
        return type(self)(self.scaled.within(estimable))

    def restricted(self, span: Array) -> Criterion:
        return type(self)(self.scaled.restricted(span))

    def beside_nuisance(self, nuisance: int) -> Criterion:
        return type(self)(self.scaled.beside_nuisance(nuisance)) if nuisance else self

    def in_coordinates(self, factor: Array) -> Criterion:
        return type(self)(self.scaled.in_coordinates(factor))

    def added(self, fisher: Array, columns: Array) -> Array:
        if self.scaled.marginal:
            return self.added_exactly(fisher, columns)
        seen = self._seen(fisher, columns)
        smallest = np.maximum(smallest_at_most(*seen), 0.0)
        return smallest / largest_at_least(*seen) if self.relative else smallest

    def added_exactly(self, fisher: Array, columns: Array) -> Array:
        if self.scaled.marginal:  # L^-1 K has the inverse roots of the eigenvalues as singular values
            w = columns.transpose(2, 0, 1)
            factor = np.linalg.cholesky(fisher + w @ w.swapaxes(1, 2))
            values = 1 / np.square(np.linalg.svd(np.linalg.solve(factor, self.k), compute_uv=False))
        else:
            values = eigenvalues(*self._seen(fisher, columns))
        smallest = np.maximum(values[:, 0], 0.0)
        return smallest / values[:, -1] if self.relative else smallest

    def _seen(self, fisher: Array, columns: Array) -> tuple[Array, Array]:
        return self.k.T @ fisher @ self.k, np.einsum("pq,pnk->qnk", self.k, columns)

    def objective_slope(self, fisher: Array, rows: Array) -> tuple[float, Array]:
        """The objective and its derivative, smoothed.

        The smallest eigenvalue becomes (sum_j lambda_j^-q)^(-1/q), which is concave as well, with q = 1 / softness; the largest
        one likewise.
        """
        values, vectors = np.linalg.eigh(self.scaled.of(fisher))
        if not values[0] > 0:
            raise np.linalg.LinAlgError("not positive definite")
        logs = np.log(values)
        value, by_value = _soft(logs, values, -1.0)
        if self.relative:
            largest, by_largest = _soft(logs, values, 1.0)
            value, by_value = value - largest, by_value - by_largest
        directions = self.scaled.tangent(fisher) @ vectors
        return value, np.asarray((rows @ directions * by_value) @ directions.T)


def _soft(logs: Array, values: Array, side: float) -> tuple[float, Array]:
    """A smooth form of the smallest (-1) or largest (1) of logarithms, and its derivatives by the values themselves."""
    far = side * logs / SOFTNESS
    shares = np.exp(far - far.max())
    value = side * SOFTNESS * float(far.max() + np.log(shares.sum()))
    return value, shares / shares.sum() / values


class SmallestEigenvalue(OfEigenvalues):
    """The smallest eigenvalue of A, "E".

    It has kinks where eigenvalues meet, as they mostly do at the optimum. Smoothed it is the largest t + a log det(A - t I)
    over t, of which the derivative is N = a (A - t I)^-1, with tr N = 1. Any such N bounds what mixtures can reach, by
    max_i tr(N W^T F_i W).
    """

    name = "E"
    kinked = True

    def value(self, information: Array) -> float:
        return float(np.linalg.eigvalsh(self.scaled.of(information))[0])

    def of_log_phi(self, log_phi: float) -> float:
        return float(np.exp(log_phi))

    def gradient(self, information: Array) -> Array:
        v = self.scaled.tangent(information) @ np.linalg.eigh(self.scaled.of(information))[1][:, 0]
        return np.outer(v, v)

    def log_phi(self, information: Array) -> float:
        values = np.linalg.eigvalsh(self.scaled.of(information))
        return float(np.log(values[0])) if values[0] > SINGULAR * values[-1] else -np.inf

    def log_phis(self, matrices: Array) -> Array:
        values = np.linalg.eigvalsh(self.scaled.of(matrices))
        able = values[:, 0] > SINGULAR * values[:, -1]
        return np.asarray(np.log(values[:, 0], where=able, out=np.full(len(values), -np.inf)))

    def slope(self, information: Array, share: float = 0.0, size: float | None = None) -> Slope:
        values, vectors = np.linalg.eigh(self.scaled.of(information))
        if not values[0] > 0:
            raise np.linalg.LinAlgError("not positive definite")
        unit = float(values[0]) if size is None else size
        amount = max(share, 1e-12) * unit
        low, high = values[0] - len(values) * amount, values[0] - amount  # where sum a / (lambda_j - t) passes 1
        for _ in range(60):
            t = (low + high) / 2
            low, high = (t, high) if (amount / (values - t)).sum() < 1 else (low, t)
        weights = amount / (values - low)
        smooth = (low + amount * np.log((values - low) / amount).sum()) / unit
        weights = weights / weights.sum()
        half = self.scaled.tangent(information) @ (vectors * np.sqrt(weights / unit))
        across = self.scaled.across(information)
        return Slope(self, half, float(np.log(values[0])), weights, amount / unit, float(smooth), unit, across)

    def _curvature(self, slope: Slope, matrices: Array) -> Array:
        # -tr(N F_i N F_j) / a + tr(N^2 F_i) tr(N^2 F_j) / (a tr N^2), as t follows M; here in units of phi, and N = phi G.
        inner = np.asarray(slope.half.T @ matrices @ slope.half).reshape(len(matrices), -1)
        n = slope.factor
        moved = inner[:, :: len(n) + 1] @ n
        rest = np.outer(moved, moved) / np.square(n).sum()
        curvature = np.asarray((rest - inner @ inner.T) / slope.share)
        if not self.scaled.marginal:
            return curvature
        bent = np.asarray(slope.across @ matrices @ slope.half).reshape(len(matrices), -1)
        return np.asarray(curvature - 2 * (bent @ bent.T))


class ConditionNumber(OfEigenvalues):
    """The largest over the smallest eigenvalue of A, "ME".

    It does not change with the amount of information, and is not a convex or concave function of M. So there is no information
    function, no equivalence theorem and no bound of this kind.
    """

    name = "ME"
    degree = 0
    relative = True

    def of_log_phi(self, log_phi: float) -> float:
        return float(np.exp(-log_phi))

    def gradient(self, information: Array) -> Array:
        values, vectors = np.linalg.eigh(self.scaled.of(information))
        directions = self.scaled.tangent(information) @ vectors
        low, high = directions[:, 0], directions[:, -1]
        return np.asarray(np.outer(high, high) / values[0] - values[-1] / values[0] ** 2 * np.outer(low, low))

    def log_phi(self, information: Array) -> float:
        values = np.linalg.eigvalsh(self.scaled.of(information))
        return float(np.log(values[0] / values[-1])) if values[0] > SINGULAR * values[-1] else -np.inf

    def log_phis(self, matrices: Array) -> Array:
        values = np.linalg.eigvalsh(self.scaled.of(matrices))
        able = values[:, 0] > SINGULAR * values[:, -1]
        shares = np.divide(values[:, 0], values[:, -1], where=able, out=np.ones(len(values)))
        return np.where(able, np.log(shares), -np.inf)
