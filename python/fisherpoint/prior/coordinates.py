"""From standard normal coordinates to parameters: the one place where a rule's nodes become parameters.

A rule has its nodes in coordinates z of independent standard normal variables. Parameters follow as theta = center + matrix z, and
the exponential of that where they are log-normal. Parameters that do not vary stay at their mean.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from ..basics.values import Array
from .gaussian import GaussianPrior


@dataclass(frozen=True, eq=False)
class Coordinates:
    """center (p,), matrix (p, p) and which parameters are exponentials (p,); without correlation the matrix is diagonal."""

    center: Array
    matrix: Array
    exponential: Array
    diagonal: bool

    def theta(self, z: Array) -> Array:
        """Parameters (R, p) of coordinates (R, p)."""
        sums = self.center + (z * np.diag(self.matrix) if self.diagonal else z @ self.matrix.T)
        return np.where(self.exponential, np.exp(np.where(self.exponential, sums, 0.0)), sums)

    def axis(self, j: int, z: Array) -> Array:
        """Values of parameter j where coordinate j has the values z, for a diagonal matrix."""
        values: Array = self.center[j] + z * self.matrix[j, j]
        return np.exp(values) if self.exponential[j] else values


def cholesky_coordinates(prior: GaussianPrior, varied: Iterable[str]) -> Coordinates:
    """Coordinates by the Cholesky factor: the first parameter has the first coordinate, the second the first two, and so on."""
    return _coordinates(prior, tuple(varied), _cholesky)


def principal_coordinates(prior: GaussianPrior, varied: Iterable[str]) -> Coordinates:
    """Coordinates by the principal axes of the correlation of every group of correlated parameters; others have one each."""
    return _coordinates(prior, tuple(varied), _principal_axes)


def correlated_groups(prior: GaussianPrior, varied: Iterable[str]) -> list[tuple[str, ...]]:
    """Parameters that hang together by correlations, directly or through others, in the prior's order."""
    from scipy.sparse.csgraph import connected_components

    names = [name for name in prior.names if name in set(varied)]
    rows = [prior.names.index(name) for name in names]
    _, of = connected_components(prior.correlation[np.ix_(rows, rows)] != 0, directed=False)
    groups: dict[int, list[str]] = {}
    for name, group in zip(names, of.tolist(), strict=True):
        groups.setdefault(group, []).append(name)
    return list(map(tuple, groups.values()))


def _coordinates(prior: GaussianPrior, varied: tuple[str, ...], factor: Callable[[Array], Array]) -> Coordinates:
    names, p = prior.names, len(prior.names)
    center, matrix = np.array(list(prior.mean.values())), np.zeros((p, p))
    exponential = np.array([name in prior.log and name in varied for name in names])
    diagonal = True
    # Group by group: a factor of the whole would mix coordinates that have nothing to do with each other.
    for group in correlated_groups(prior, varied):
        rows = [names.index(name) for name in group]
        std = prior.normal_std[rows]
        if len(group) == 1:
            matrix[rows[0], rows[0]] = std[0]
        else:
            diagonal = False
            matrix[np.ix_(rows, rows)] = std[:, None] * factor(prior.normal_correlation[np.ix_(rows, rows)])
    center[exponential] = np.log(center[exponential]) - prior.normal_std[exponential] ** 2 / 2
    return Coordinates(center, matrix, exponential, diagonal)


def _cholesky(correlation: Array) -> Array:
    return np.asarray(np.linalg.cholesky(correlation), dtype=np.float64)


def _principal_axes(correlation: Array) -> Array:
    """Eigenvectors times roots of eigenvalues, the largest first; the largest component of each is positive."""
    values, vectors = np.linalg.eigh(correlation)
    values, vectors = values[::-1], vectors[:, ::-1]
    largest = np.take_along_axis(vectors, np.argmax(np.abs(vectors) > np.abs(vectors).max(axis=0) - 1e-9, axis=0)[None], axis=0)
    axes: Array = vectors * np.sign(largest) * np.sqrt(values)
    return axes
