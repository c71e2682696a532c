"""What the interior point method for weights needs of a criterion, and what it moves beside the weights where that has kinks.

A criterion without kinks gives its derivatives. One with kinks is the least of many: phi(M) = min_y phi(M, y), over weights y = q
of scenarios or over matrices y = N of unit trace, and its optimum is a saddle point. Its y is found along with the weights, by
Newton steps on the conditions of both (the primal-dual method), so that nothing has to be smoothed: a smoothed minimum has
curvatures that grow as the smoothing falls, and in double precision its value does not decide which of two close points is better.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from copy import copy
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...basics.values import Array
from ..goal.averaged_criterion import Averaged, AveragedSlope, joined
from ..goal.criteria import Criterion, Slope
from ..goal.eigenvalue_criteria import SmallestEigenvalue

BETWEEN = 0.5
"""Start of the method: share of the way from the scenarios' own weights to their weights in the smoothed average."""


def mean_of(matrices: Array, weights: Array) -> Array:
    """sum_i w_i F_i, (p, p)."""
    return np.asarray(np.tensordot(weights, matrices, axes=1))


class Newton(NamedTuple):
    """Newton's equations (B + diag(s/w)) dw - v dt + nu 1 = b + mu/w and v dw - k dt = c; without v, dt = 0."""

    system: Array
    towards: Array
    level: tuple[Array, float, float] | None = None


class Inner(ABC):
    """The criterion at some weights.

    Attributes
    ----------
    pairs : int
        Products that are to become mu, beside those of the weights.
    sensitivity : ndarray, (m,)
        tr(G F_i) of all matrices, with the y that is reached.
    """

    pairs: int = 0
    sensitivity: Array

    @property
    @abstractmethod
    def slope(self) -> Slope:
        """Whose largest sensitivity bounds what any weights reach."""

    @property
    @abstractmethod
    def gap(self) -> float:
        """max_i tr(G F_i) - 1 of `slope`."""

    def begin(self, mu: float) -> None:  # noqa: B027
        """Set what is free at first."""

    @property
    def products(self) -> float:
        """The sum of what is to become mu."""
        return 0.0

    @abstractmethod
    def newton(self, mu: float) -> Newton: ...

    def direction(self, dw: Array, dt: float, mu: float) -> tuple[Array | float, ...]:
        """Changes of what is moved beside the weights."""
        return ()

    def falling(self, direction: tuple[Array | float, ...]) -> float:
        """The largest relative fall on a whole step of a quantity that must stay positive."""
        return -np.inf

    @abstractmethod
    def moved(self, w: Array, direction: tuple[Array | float, ...], length: float) -> Inner:
        """The criterion at other weights; LinAlgError where M, or what must stay positive, is not."""

    def residuals(self, mu: float) -> Array:
        return np.empty(0)


def inner_of(criterion: Criterion, matrices: Array, w: Array) -> Inner:
    """The criterion at weights; the mean matrix must be regular."""
    if isinstance(criterion, SmallestEigenvalue):
        return OfEigenvalue(criterion, matrices, w)
    if isinstance(criterion, Averaged) and criterion.kinked:
        return OfScenarios(criterion, matrices, w)
    return Smooth(criterion, matrices, w)


class Smooth(Inner):
    def __init__(self, criterion: Criterion, matrices: Array, w: Array) -> None:
        self._matrices = matrices
        self._slope = criterion.slope(mean_of(matrices, w))
        self.sensitivity = self._slope.along(matrices)

    @property
    def slope(self) -> Slope:
        return self._slope

    @property
    def gap(self) -> float:
        return float(self.sensitivity.max()) - 1.0

    def newton(self, mu: float) -> Newton:
        return Newton(-self._slope.curvature(self._matrices), self.sensitivity)

    def moved(self, w: Array, direction: tuple[Array | float, ...], length: float) -> Inner:
        return Smooth(self._slope.criterion, self._matrices, w)


@dataclass
class _Bounds:
    """Multipliers of 0 <= q <= most, and where q is."""

    q: Array
    low: Array
    high: Array
    most: Array

    @property
    def room(self) -> Array:
        return self.most - self.q


class OfScenarios(Inner):
    """min_q sum_s q_s h_s over weights q <= most that sum to 1, with h_s = log phi_s of the scenarios.

    With multipliers of the bounds, h_s - t = low_s - high_s. The q are feasible on the way, so that they bound what is averaged.
    """

    def __init__(self, criterion: Averaged, matrices: Array, w: Array) -> None:
        self._criterion, self._matrices, self._blocks = criterion, matrices, criterion.blocks(matrices)
        self._evaluate(w)
        average = criterion.average
        own = average.weights / len(average.weights)
        q = own + BETWEEN * (average.softened(self._h, 1.0 / matrices.shape[1])[1] / len(own) - own)
        self._at, self.pairs, self._t = _Bounds(q, own, own, average.most), 2 * len(q), 0.0

    def _evaluate(self, w: Array) -> None:
        information, criterion = mean_of(self._matrices, w), self._criterion
        parts = zip(criterion.criteria, criterion.blocks(information), strict=True)
        self._slopes = tuple(one.slope(block) for one, block in parts)
        self._h = criterion.offsets + [slope.log_phi for slope in self._slopes]
        along = zip(self._slopes, self._blocks, strict=True)
        self._along = np.stack([slope.along(block) for slope, block in along])  # d h_s / d w_i

    def begin(self, mu: float) -> None:
        at = self._at
        self._t = float(at.q @ self._h)
        at.low, at.high = mu / at.q, mu / at.room

    @property
    def sensitivity(self) -> Array:  # type: ignore[override]
        return np.asarray(self._at.q @ self._along)

    @property
    def products(self) -> float:
        at = self._at
        return float(at.low @ at.q + at.high @ at.room)

    def _value(self) -> tuple[Array, float, float]:
        """q that sum to 1, the average, and by what factor sum_s q_s h_s exceeds it."""
        q, value = self._at.q / self._at.q.sum(), float(self._criterion.average.value(self._h))
        return q, value, float(np.exp(q @ self._h - value))

    @property
    def slope(self) -> AveragedSlope:
        q, value, factor = self._value()
        counted = factor * q
        half = joined([np.sqrt(one) * slope.half for one, slope in zip(counted, self._slopes, strict=True)])
        return AveragedSlope(
            self._criterion, half, value, np.zeros(0), 0.0, factor, parts=self._slopes, counted=tuple(counted.tolist())
        )

    @property
    def gap(self) -> float:
        q, _, factor = self._value()
        return factor * float((q @ self._along).max()) - 1.0

    def _reduced(self, mu: float) -> tuple[Array, Array]:
        """dq = d (r - d h + dt): what is left when the multipliers are eliminated."""
        at = self._at
        d = 1.0 / (at.low / at.q + at.high / at.room)
        return d, self._t - self._h + mu / at.q - mu / at.room

    def newton(self, mu: float) -> Newton:
        (d, r), q, along = self._reduced(mu), self._at.q, self._along
        each = zip(q, self._slopes, self._blocks, strict=True)
        system = (along.T * d) @ along - sum(one * slope.curvature(block) for one, slope, block in each)
        return Newton(system, (q + d * r) @ along, (d @ along, float(d.sum()), float(d @ r + q.sum()) - 1.0))

    def direction(self, dw: Array, dt: float, mu: float) -> tuple[Array | float, ...]:
        (d, r), at = self._reduced(mu), self._at
        dq = d * (r - self._along @ dw + dt)
        low, high = mu / at.q - at.low - at.low / at.q * dq, mu / at.room - at.high + at.high / at.room * dq
        return dq, low, high, dt

    def falling(self, direction: tuple[Array | float, ...]) -> float:
        at, (dq, low, high, _) = self._at, direction
        return float(np.max([-dq / at.q, dq / at.room, -low / at.low, -high / at.high]))

    def moved(self, w: Array, direction: tuple[Array | float, ...], length: float) -> OfScenarios:
        (dq, low, high, dt), at, new = direction, self._at, copy(self)
        new._at = _Bounds(at.q + length * dq, at.low + length * low, at.high + length * high, at.most)
        new._t = self._t + length * float(dt)
        new._evaluate(w)
        return new

    def residuals(self, mu: float) -> Array:
        at = self._at
        return np.concatenate(
            [self._h - self._t - at.low + at.high, at.low * at.q - mu, at.high * at.room - mu, [1.0 - at.q.sum()]]
        )


class OfEigenvalue(Inner):
    """min_N tr(N A) over matrices N >= 0 with tr(B N) = 1, and A = sum_i w_i A_i; in units of the smallest eigenvalue at first.

    At the saddle point X N = 0, with X = A - t B >= 0. The directions are those of Helmberg, Rendl, Vanderbei and Wolkowicz (1996).
    Mostly B = I. Where the criterion is that of marginal information, t is the smallest eigenvalue of (K^T M^-1 K)^-1: the largest
    with M - t K K^T >= 0, so that A_i = F_i and B = K K^T.
    """

    def __init__(self, criterion: SmallestEigenvalue, matrices: Array, w: Array) -> None:
        p = matrices.shape[1]
        slope = criterion.slope(mean_of(matrices, w), 1.0 / p)  # X N is a multiple of I
        self._criterion, self._unit = criterion, float(np.exp(slope.log_phi))
        self._marginal, k = criterion.scaled.marginal, criterion.k
        self._scaled = (matrices if self._marginal else criterion.scaled.of(matrices)) / self._unit
        self._b = k @ k.T if self._marginal else np.eye(self._scaled.shape[1])
        self._a, self.pairs = mean_of(self._scaled, w), len(self._b)
        self._t = float(self._least - slope.share / slope.factor[0])
        inverse = np.linalg.inv(self._x)
        self._n = inverse / (inverse * self._b).sum()

    @property
    def _x(self) -> Array:
        return np.asarray(self._a - self._t * self._b)

    @property
    def _least(self) -> float:
        """The largest t with X >= 0."""
        a = self._a
        if not self._marginal:
            return float(np.linalg.eigvalsh(a)[0])
        solved = np.linalg.solve(np.linalg.cholesky(a), self._criterion.k)
        return float(np.linalg.norm(solved, 2) ** -2)

    @property
    def sensitivity(self) -> Array:  # type: ignore[override]
        return np.asarray(np.einsum("ijk,jk->i", self._scaled, self._n))

    @property
    def products(self) -> float:
        return float((self._x * self._n).sum())

    @property
    def slope(self) -> Slope:
        values, vectors = np.linalg.eigh(self._n)
        values, least = np.maximum(values, 0.0), self._least * self._unit
        weights = values / np.einsum("ij,ik,kj,j->", vectors, self._b, vectors, values)
        half = vectors * np.sqrt(weights / least)
        half = half if self._marginal else self._criterion.k @ half
        return Slope(self._criterion, half, float(np.log(least)), weights, 0.0)

    @property
    def gap(self) -> float:
        return float(self.sensitivity.max()) / (float((self._n * self._b).sum()) * self._least) - 1.0

    def newton(self, mu: float) -> Newton:
        lower, of_n, (m, r, _) = np.linalg.cholesky(self._x), np.linalg.cholesky(self._n), self._scaled.shape
        rows = np.linalg.solve(lower, np.moveaxis(self._scaled @ of_n, 0, 1).reshape(r, -1))
        rows = np.moveaxis(rows.reshape(r, m, r), 1, 0).reshape(m, -1)  # L^-1 A_i R, so that products are tr(A_i X^-1 A_j N)
        self._inverse = np.linalg.inv(self._x)
        both = self._inverse @ self._b @ self._n
        along = [np.einsum("ijk,jk->i", self._scaled, (one + one.T) / 2) for one in (both, self._inverse)]
        level = along[0], float((both * self._b).sum()), mu * float((self._inverse * self._b).sum()) - 1.0
        return Newton(rows @ rows.T, mu * along[1], level)

    def direction(self, dw: Array, dt: float, mu: float) -> tuple[Array | float, ...]:
        dx = mean_of(self._scaled, dw) - dt * self._b
        product = self._inverse @ (mu * np.eye(len(self._a)) - dx @ self._n) - self._n
        return (product + product.T) / 2, dx, dt

    def falling(self, direction: tuple[Array | float, ...]) -> float:
        return max(_falling(self._n, np.asarray(direction[0])), _falling(self._x, np.asarray(direction[1])))

    def moved(self, w: Array, direction: tuple[Array | float, ...], length: float) -> OfEigenvalue:
        (dn, _, dt), new = direction, copy(self)
        new._n, new._t, new._a = self._n + length * dn, self._t + length * float(dt), mean_of(self._scaled, w)
        for matrix in (new._x, new._n):
            np.linalg.cholesky(matrix)
        return new

    def residuals(self, mu: float) -> Array:
        lower = np.linalg.cholesky(self._x)
        product = lower.T @ self._n @ lower - mu * np.eye(len(lower))
        return np.append(product.ravel(), 1.0 - (self._n * self._b).sum())


def _falling(matrix: Array, change: Array) -> float:
    """The largest relative fall of a positive definite matrix, along any vector, when it changes."""
    lower = np.linalg.cholesky(matrix)
    relative = np.linalg.solve(lower, np.linalg.solve(lower, change).T)
    return -float(np.linalg.eigvalsh((relative + relative.T) / 2)[0])
