"""What a search for points maximises: log det F, or another criterion in the same form.

With the information function phi of a criterion the search maximises `level` log phi(F), which is log det F for "D", with the level
p. So what a search gains means the same for all of them: log phi by 1e-4 is one measurement in ten thousand.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np

from ...basics.values import Array
from ...engine import _core
from .criteria import Criterion, Determinant, Variance
from .eigenvalue_criteria import ConditionNumber, OfEigenvalues, SmallestEigenvalue
from .estimable import Estimable
from .rank_updates import eigenvalues, gains, largest_at_least, smallest_at_most, variances

SOFTNESS = 0.02
"""Relative distance of eigenvalues over which their minimum is smoothed, so that ascents have a derivative."""

TINY = 1e-12
"""Relative addition of ascents to the diagonal of F, which may be singular where a criterion is not of all parameters."""


class Aim(ABC):
    """A criterion in the form that searches maximise, at one place of the parameters.

    Attributes
    ----------
    level : int
    least, small : float
        Multiples of the identity that are added to an F of about the identity where a point leaves it, and where it is singular.
    bounded : bool
        Whether `added` are upper bounds; `added_exactly` has the values.
    """

    bounded = False
    least, small = 1e-8, 1e-8  # so that neither they nor rounding matter in differences of variances

    def __init__(self, criterion: Criterion) -> None:
        self.criterion, self.level = criterion, criterion.level

    @property
    def of_all(self) -> bool:
        """Whether it is log det of the information about all parameters, or about all of them that are estimable."""
        return isinstance(self.criterion, Determinant) and self.criterion.of_all

    def value(self, fisher: Array) -> float:
        """`level` log phi(F); -inf where F does not determine the criterion."""
        return self.level * self.criterion.log_phi(fisher)

    def values(self, fishers: Array) -> Array:
        """`value` of many F (..., p, p), (...)."""
        flat = fishers.reshape(-1, *fishers.shape[-2:])
        return np.asarray(self.level * self.criterion.log_phis(flat).reshape(fishers.shape[:-2]))

    @abstractmethod
    def added(self, fisher: Array, columns: Array) -> Array:
        """exp of the value at F + W W^T (N,) less `offset`, of columns (p, n, N)."""

    def added_exactly(self, fisher: Array, columns: Array) -> Array:
        """Exact values where those of `added` are bounds."""
        return self.added(fisher, columns)

    def offset(self, fisher: Array, factor: Array) -> float:
        """Value less the logarithm of `added`; `factor` is L of the coordinates."""
        return 0.0

    @abstractmethod
    def within(self, factor: Array) -> Aim:
        """Return the aim as a function of matrices L^-1 F L^-T."""

    @abstractmethod
    def slope(self, fisher: Array, rows: Array) -> tuple[float, Array]:
        """The value, or what is near to it and smooth, and its derivative by F times rows (k, p)."""


class LogDet(Aim):
    """log det F."""

    least, small = 1e-10, 1e-4

    def value(self, fisher: Array) -> float:
        return _core.log_det(fisher)

    def values(self, fishers: Array) -> Array:
        sign, value = np.linalg.slogdet(fishers)
        return np.where(sign > 0, value, -np.inf)

    def added(self, fisher: Array, columns: Array) -> Array:
        return gains(fisher, columns)

    def offset(self, fisher: Array, factor: Array) -> float:
        return 2 * float(np.log(np.diag(factor)).sum()) + float(np.linalg.slogdet(fisher)[1])

    def within(self, factor: Array) -> Aim:
        return self

    def slope(self, fisher: Array, rows: Array) -> tuple[float, Array]:
        return float(np.linalg.slogdet(fisher)[1]), np.asarray(np.linalg.solve(fisher, rows.T).T)


class LogDetWithin(Aim):
    """log det Q^T F Q, with an orthonormal basis Q of what candidates determine, where that is not everything: F is singular then.

    `k` (p, r) may be any K instead of Q, with K^T F K of the same determinant, in which the numbers are of one size.
    """

    least = 1e-10

    def __init__(self, criterion: Determinant, k: Array | None = None) -> None:
        super().__init__(criterion)
        self.k = criterion.k if k is None else k

    def value(self, fisher: Array) -> float:
        return _core.log_det(self.k.T @ fisher @ self.k)

    def added(self, fisher: Array, columns: Array) -> Array:
        return gains(self.k.T @ fisher @ self.k, np.einsum("pq,pnk->qnk", self.k, columns))

    def offset(self, fisher: Array, factor: Array) -> float:
        return self.value(fisher)

    def within(self, factor: Array) -> Aim:
        assert isinstance(self.criterion, Determinant)
        q, r = np.linalg.qr(factor.T @ self.k)
        return LogDetWithin(self.criterion, q * np.exp(np.log(np.abs(np.diag(r))).mean()))

    def slope(self, fisher: Array, rows: Array) -> tuple[float, Array]:
        inner = self.k.T @ fisher @ self.k
        sign, log_det = np.linalg.slogdet(inner)
        if not sign > 0:
            raise np.linalg.LinAlgError("not positive definite")
        return float(log_det), np.asarray(np.linalg.solve(inner, (rows @ self.k).T).T @ self.k.T)


class _Sloped(Aim):
    """An aim whose slope is that of its criterion."""

    def slope(self, fisher: Array, rows: Array) -> tuple[float, Array]:
        diagonal = np.diag(fisher)
        slope = self.criterion.slope(fisher + TINY * np.diag(np.maximum(diagonal, TINY * diagonal.max())))
        return self.level * slope.log_phi, self.level * (rows @ slope.half) @ slope.half.T


class LogSubsetDet(_Sloped):
    """log det of the information about some parameters: a ratio of the determinants of all and of the others."""

    def __init__(self, criterion: Determinant) -> None:
        super().__init__(criterion)
        self._k = criterion.k
        self._others = np.linalg.qr(self._k, mode="complete")[0][:, self._k.shape[1] :]

    def added(self, fisher: Array, columns: Array) -> Array:
        others = np.einsum("pq,pnk->qnk", self._others, columns)
        return gains(fisher, columns) / gains(self._others.T @ fisher @ self._others, others)

    def offset(self, fisher: Array, factor: Array) -> float:
        return self.value(fisher)

    def within(self, factor: Array) -> Aim:
        return LogSubsetDet(Determinant(self.criterion.name, _solved(factor, self._k), False, self.of_all))


class LogVariance(_Sloped):
    """-log tr(K^T F^-1 K)."""

    def __init__(self, criterion: Variance) -> None:
        super().__init__(criterion)
        self._k = criterion.k

    def added(self, fisher: Array, columns: Array) -> Array:
        return 1 / variances(fisher, columns, self._k)

    def within(self, factor: Array) -> Aim:
        return LogVariance(Variance(self.criterion.name, _solved(factor, self._k)))


class LogEigenvalue(Aim):
    """log of the smallest eigenvalue of S F S, "E", or of its ratio to the largest, "ME"."""

    def __init__(self, criterion: OfEigenvalues) -> None:
        super().__init__(criterion)
        self._scaled, self._relative = criterion.scaled, isinstance(criterion, ConditionNumber)
        self.bounded = not self._scaled.marginal

    def added(self, fisher: Array, columns: Array) -> Array:
        if self._scaled.marginal:
            return self.added_exactly(fisher, columns)
        seen = self._seen(fisher, columns)
        smallest = np.maximum(smallest_at_most(*seen), 0.0)
        return smallest / largest_at_least(*seen) if self._relative else smallest

    def added_exactly(self, fisher: Array, columns: Array) -> Array:
        if self._scaled.marginal:  # L^-1 K has the inverse roots of the eigenvalues as singular values
            w = columns.transpose(2, 0, 1)
            factor = np.linalg.cholesky(fisher + w @ w.swapaxes(1, 2))
            values = 1 / np.square(np.linalg.svd(np.linalg.solve(factor, self._scaled.k), compute_uv=False))
        else:
            values = eigenvalues(*self._seen(fisher, columns))
        smallest = np.maximum(values[:, 0], 0.0)
        return smallest / values[:, -1] if self._relative else smallest

    def _seen(self, fisher: Array, columns: Array) -> tuple[Array, Array]:
        k = self._scaled.k
        return k.T @ fisher @ k, np.einsum("pq,pnk->qnk", k, columns)

    def within(self, factor: Array) -> Aim:
        kind = ConditionNumber if self._relative else SmallestEigenvalue
        return LogEigenvalue(kind(self._scaled.in_coordinates(factor)))

    def slope(self, fisher: Array, rows: Array) -> tuple[float, Array]:
        """The value and its derivative, smoothed.

        The smallest eigenvalue becomes (sum_j lambda_j^-q)^(-1/q), which is concave as well, with q = 1 / softness; the largest
        one likewise.
        """
        values, vectors = np.linalg.eigh(self._scaled.of(fisher))
        if not values[0] > 0:
            raise np.linalg.LinAlgError("not positive definite")
        logs = np.log(values)
        value, by_value = _soft(logs, values, -1.0)
        if self._relative:
            largest, by_largest = _soft(logs, values, 1.0)
            value, by_value = value - largest, by_value - by_largest
        directions = self._scaled.tangent(fisher) @ vectors
        return value, np.asarray((rows @ directions * by_value) @ directions.T)


def _solved(factor: Array, k: Array) -> Array:
    return np.asarray(np.linalg.solve(factor, k), dtype=np.float64)


def _soft(logs: Array, values: Array, side: float) -> tuple[float, Array]:
    """A smooth form of the smallest (-1) or largest (1) of logarithms, and its derivatives by the values themselves."""
    far = side * logs / SOFTNESS
    shares = np.exp(far - far.max())
    value = side * SOFTNESS * float(far.max() + np.log(shares.sum()))
    return value, shares / shares.sum() / values


def aim_of(criterion: Criterion) -> Aim:
    """The criterion as an aim of a search."""
    if isinstance(criterion, Determinant):
        if not criterion.whole:
            return LogSubsetDet(criterion)
        return LogDet(criterion) if criterion.k.shape[0] == criterion.k.shape[1] else LogDetWithin(criterion)
    if isinstance(criterion, Variance):
        return LogVariance(criterion)
    assert isinstance(criterion, OfEigenvalues)
    return LogEigenvalue(criterion)


def restricted(aim: Aim, space: Estimable) -> Aim:
    """Return the aim restricted to what is estimable; itself where that is everything, or the criterion is of certain functions."""
    criterion = aim.criterion.restricted(space.span)
    if not len(space.null) or criterion is aim.criterion:
        return aim
    if not isinstance(criterion, Determinant) or not criterion.whole:
        return aim_of(criterion)
    # Q^T F Q = T^T B^T F B T with T = (Q^T B)^-1, as F = Q (Q^T F Q) Q^T
    size = np.linalg.slogdet(space.span.T @ space.into)[1] / space.rank
    return LogDetWithin(criterion, space.into * np.exp(-size))


def log_det_slopes(fishers: Array, rows: Array) -> tuple[Array, Array] | None:
    """log det F (S,) of matrices (S, p, p), and F^-1 J^T of rows (S, k, p), transposed; None where one is singular."""
    sign, log_det = np.linalg.slogdet(fishers)
    if not (sign > 0).all():
        return None
    return log_det, np.asarray(np.linalg.solve(fishers, rows.swapaxes(1, 2)).swapaxes(1, 2), dtype=np.float64)


def slopes_of(aims: Sequence[Aim], fishers: Array, rows: Array) -> tuple[Array, Array] | None:
    """Values (S,) of the aims of S scenarios, and their derivatives times rows (S, k, p); None where an F is singular."""
    if all(isinstance(aim, LogDet) for aim in aims):
        return log_det_slopes(fishers, rows)
    try:
        found = [aim.slope(fisher, own) for aim, fisher, own in zip(aims, fishers, rows, strict=True)]
    except np.linalg.LinAlgError:
        return None
    return np.array([value for value, _ in found]), np.stack([slope for _, slope in found])
