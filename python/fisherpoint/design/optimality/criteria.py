"""Criteria of optimality as functions of an information matrix, with what their optima are recognised by.

Every criterion but "ME" is given by an information function phi: positively homogeneous, concave and increasing in the information
matrix (Pukelsheim, Optimal Design of Experiments, 1993, ch. 5). With G the derivative of log phi at any M, tr(G M) = 1, and

    phi(N) <= phi(M) tr(G N)    for every N,

so that of all mixtures of matrices F_i none has more than phi(M) max_i tr(G F_i). M itself is optimal if and only if that maximum
is 1: the equivalence theorem. It holds for matrices of any rank.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ...basics.values import Array
from ...show.section import Report, Section
from ...show.table_preview import InNotebooks
from .estimable import Estimable


@dataclass(frozen=True, eq=False)
class Slope:
    """The derivatives of log phi at M, along information matrices F (m, p, p).

    Attributes
    ----------
    half : ndarray, (p, q)
        Y of the gradient G = Y Y^T.
    log_phi : float
    """

    criterion: Criterion
    half: Array
    log_phi: float
    factor: Array  # Cholesky factor L of M; for "E" the eigenvalues of N
    share: float  # for "E", the smoothing
    smooth: float = 0.0  # for "E", the smoothed value in units of `size`
    size: float = 1.0
    across: Array = field(default_factory=lambda: np.zeros((0, 0)))  # for "E", what bends A beside nuisance parameters

    @property
    def gradient(self) -> Array:
        """G (p, p)."""
        return self.half @ self.half.T

    def along(self, matrices: Array) -> Array:
        """tr(G F_i), (m,)."""
        return np.asarray(np.einsum("ijk,jk->i", matrices, self.gradient))

    def curvature(self, matrices: Array) -> Array:
        """The second derivatives (m, m) of log phi by the weights of F_i."""
        return self.criterion._curvature(self, matrices)


MEANINGS = {
    "D": "log det of the information: the volume of the confidence ellipsoid",
    "A": "the sum of the variances of the parameters",
    "E": "the least eigenvalue of the information: the worst combination of the parameters",
    "ME": "the condition number of the information",
    "c": "the variance of one function of the parameters",
    "Ds": "log det of the information of some parameters",
    "I": "the mean variance of predictions",
}


class Criterion(InNotebooks):
    """One number that says how good an information matrix is.

    Attributes
    ----------
    name : str
    level : int
        What the sensitivity function is multiplied by, so that it is tr(M^-1 F_i) <= p for "D"; 1 where that is not the custom.
    """

    name: str
    k: Array
    level: int = 1
    kinked: bool = False
    degree: int = 1  # of phi: 0 where it does not matter how much is measured

    @abstractmethod
    def value(self, information: Array) -> float:
        """The criterion at a matrix (p, p), in its own units: infinitely bad where the matrix does not determine it."""

    @abstractmethod
    def of_log_phi(self, log_phi: float) -> float:
        """The criterion in the units of `value`, from log phi."""

    @abstractmethod
    def gradient(self, information: Array) -> Array:
        """Derivative (p, p) of `value` by the information matrix, which must be regular."""

    @abstractmethod
    def log_phi(self, information: Array) -> float:
        """log phi; -inf where the matrix does not determine the criterion."""

    def log_phis(self, matrices: Array) -> Array:
        """log phi of many matrices (m, p, p), (m,)."""
        return np.array([self.log_phi(matrix) for matrix in matrices])

    def __repr__(self) -> str:
        return f"<Criterion {self.name}: {MEANINGS[self.name]}>"

    def _in_notebook(self) -> Report:
        facts = [("what is maximised or minimised", MEANINGS[self.name]), ("level of the sensitivity function", str(self.level))]
        return Report(f"Criterion {self.name}", [Section("", (), facts)])

    def efficiency(self, information: Array, reference: Array) -> float:
        """phi of a matrix as a share of that of another: so many times fewer measurements would do with the other."""
        value, other = self.log_phi(information), self.log_phi(reference)
        if not np.isfinite(other):
            raise ValueError(f"reference: expected information that determines criterion {self.name!r}, given none")
        return float(np.exp(value - other))

    def _of_regular(self, matrices: Array, of_solved: Callable[[Array], Array]) -> Array:
        """log phi of many matrices from L^-1 K (m, p, s), side by side where these are regular; of the others one by one."""
        scale = np.sqrt(np.maximum(np.diagonal(matrices, axis1=1, axis2=2), 0.0))
        scale = np.where(scale > 0, scale, 1.0)
        scaled = matrices / (scale[:, :, None] * scale[:, None, :])
        values = np.linalg.eigvalsh(scaled)
        regular = values[:, 0] > SINGULAR * values.shape[1] * values[:, -1]
        result = np.full(len(matrices), -np.inf)
        if regular.any():
            rows = self.k / scale[regular][:, :, None]
            result[regular] = of_solved(np.linalg.solve(np.linalg.cholesky(scaled[regular]), rows))
        result[~regular] = [self.log_phi(matrix) for matrix in matrices[~regular]]
        return result

    def slope(self, information: Array, share: float = 0.0, size: float | None = None) -> Slope:
        """Derivatives of log phi at a regular matrix; `share` of `size` smooths what has kinks ("E")."""
        raise NotImplementedError

    def _curvature(self, slope: Slope, matrices: Array) -> Array:
        raise NotImplementedError

    def within(self, estimable: Estimable) -> Criterion:
        """Return the criterion as a function of matrices in the coordinates of what is estimable."""
        raise NotImplementedError

    def restricted(self, span: Array) -> Criterion:
        """Return the criterion of what is estimable, with an orthonormal basis (p, r); itself where it is of certain functions."""
        return self

    def outside(self, estimable: Estimable) -> float:
        """The share of the criterion's functions that is not estimable; 0 for criteria of all that is."""
        return 0.0

    def beside_nuisance(self, nuisance: int) -> Criterion:
        """Return the criterion of the parameters as a function of information that has `nuisance` more rows, behind them."""
        raise NotImplementedError


class Determinant(Criterion):
    """log det (K^T M^-1 K)^-1: "D" where K is the identity, "Ds" where it picks parameters and the others are nuisance."""

    def __init__(self, name: str, k: Array, whole: bool, of_all: bool = False) -> None:
        self.name, self.k, self.level = name, k, k.shape[1]
        self.whole = whole  # K spans everything, or all that is estimable: D, in whatever coordinates
        self.of_all = whole or of_all  # it asks for all that is estimable of K, whose columns are orthonormal

    def value(self, information: Array) -> float:
        return self.of_log_phi(self.log_phi(information))

    def of_log_phi(self, log_phi: float) -> float:
        return self.level * log_phi

    def gradient(self, information: Array) -> Array:
        return self.level * self.slope(information).gradient

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
        across = _across(slope, matrices)
        inner = slope.half.T @ matrices @ slope.half
        inner = inner.reshape(len(matrices), -1)
        return np.asarray(self.level * (inner @ inner.T) - 2.0 * (across @ across.T))

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


class Variance(Criterion):
    """tr(K^T M^-1 K): "A" where K scales the parameters, "c" for one function of them, "I" for predictions."""

    def __init__(self, name: str, k: Array, whole: bool = False) -> None:
        self.name, self.k, self.level = name, k, 1
        self.whole = whole  # "A", which asks for what is estimable

    def value(self, information: Array) -> float:
        return self.of_log_phi(self.log_phi(information))

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
        across, along = _across(slope, matrices), slope.along(matrices)
        return np.asarray(np.outer(along, along) - 2.0 * (across @ across.T))

    def within(self, estimable: Estimable) -> Criterion:
        return Variance(self.name, estimable.into.T @ estimable.projected(self.k), self.whole)

    def restricted(self, span: Array) -> Criterion:
        return Variance(self.name, span @ (span.T @ self.k)) if self.whole else self

    def beside_nuisance(self, nuisance: int) -> Criterion:
        return Variance(self.name, padded(self.k, nuisance), self.whole) if nuisance else self

    def outside(self, estimable: Estimable) -> float:
        return 0.0 if self.whole else estimable.outside(self.k)


SINGULAR = 1e-14
"""Share of the largest eigenvalue below which the smallest is rounding."""


def half_solved(information: Array, k: Array) -> Array | None:
    """Some H with H^T H = K^T M^- K; None where K is not in the range of M."""
    scale = np.sqrt(np.maximum(np.diag(information), 0.0))
    scale = np.where(scale > 0, scale, 1.0)
    scaled = information / np.outer(scale, scale)
    rows = k / scale[:, None]
    values, vectors = np.linalg.eigh(scaled)
    kept = values > SINGULAR * len(values) * values[-1]
    if kept.all():
        return np.asarray(np.linalg.solve(np.linalg.cholesky(scaled), rows))
    inside = vectors[:, kept]
    if np.linalg.norm(rows - inside @ (inside.T @ rows)) > 1e-7 * np.linalg.norm(rows):
        return None
    return np.asarray((inside.T @ rows) / np.sqrt(values[kept])[:, None])


def _across(slope: Slope, matrices: Array) -> Array:
    """L^-1 F_i Y as rows (m, p q): products of two are tr(G F_i M^-1 F_j)."""
    p, q = slope.half.shape
    columns = np.moveaxis(matrices @ slope.half, 0, 1).reshape(p, -1)
    solved = np.linalg.solve(slope.factor, columns)
    return np.asarray(np.moveaxis(solved.reshape(p, len(matrices), q), 1, 0).reshape(len(matrices), -1))


def padded(k: Array, nuisance: int) -> Array:
    """K with rows of zeros for the nuisance parameters."""
    return np.concatenate([k, np.zeros((nuisance, k.shape[1]))])
