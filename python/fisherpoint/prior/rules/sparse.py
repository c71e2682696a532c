"""Rules with few nodes in many dimensions, which integrate polynomials of low total degree exactly. Some weights are negative."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations, product
from math import comb
from typing import ClassVar

import numpy as np

from ...basics.checks import check_positive_int, check_type
from ...basics.values import Array
from ...engine import _core
from ..gaussian import GaussianPrior
from .base import Rule, node_table
from .tensor import hermite

MAX_LEVEL = 8
MAX_STORED_NODES = 2**20
"""Nodes past which a stored rule counts as a slip."""


@dataclass(frozen=True)
class SparseGaussHermite(Rule):
    """Smolyak's combination of small tensor products of Gauss-Hermite rules with 1, 3, 5, ... nodes.

    Exact for polynomials up to total degree 2 level + 1 in the coordinates of the Cholesky factor. For nine parameters level 1 has
    19 nodes, level 2 has 199 and level 3 has 1501. Negative weights can make a matrix that is not a covariance: see
    `PredictiveCovariance.projection`.

    Parameters
    ----------
    level : int
        At most 8.
    """

    level: int = 2

    signed: ClassVar[bool] = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "level", check_positive_int(self.level, "level", most=MAX_LEVEL))

    def size(self, prior: GaussianPrior) -> int:
        """Return the number of nodes R."""
        check_type(prior, GaussianPrior, "prior")
        return _sparse_size(len(prior.names), self.level)

    def core_nodes(self, prior: GaussianPrior, varied: Sequence[str] | None = None) -> _core.NodeTable:
        names = prior.names if varied is None else tuple(varied)
        if (size := _sparse_size(len(names), self.level)) > MAX_STORED_NODES:
            raise ValueError(f"level: expected a rule of at most {MAX_STORED_NODES} nodes, given {self.level} with {size}")
        return node_table(prior, names, *_smolyak(len(names), self.level))


@dataclass(frozen=True)
class Unscented(Rule):
    """The 2 p + 1 points of the unscented transform, with kappa = 3 - p: exact up to total degree 3.

    The mean with weight 1 - p/3, and each coordinate of the Cholesky factor at plus and minus sqrt(3) with weight 1/6.
    """

    signed: ClassVar[bool] = True

    def size(self, prior: GaussianPrior) -> int:
        """Return the number of nodes R."""
        check_type(prior, GaussianPrior, "prior")
        return 2 * len(prior.names) + 1

    def core_nodes(self, prior: GaussianPrior, varied: Sequence[str] | None = None) -> _core.NodeTable:
        p = len(prior.names if varied is None else tuple(varied))
        ends = np.sqrt(3) * np.eye(p)
        z = np.concatenate([np.zeros((1, p)), ends, -ends])
        return node_table(prior, varied, z, np.concatenate([[1 - p / 3], np.full(2 * p, 1 / 6)]))


def _sparse_size(p: int, level: int) -> int:
    """Number of nodes: a coordinate that is not 0 has 2 l values of its own at level l, and the levels sum up to `level`."""
    sizes = [1] + [0] * level  # by what the levels sum up to
    for _ in range(p):
        sizes = [sizes[n] + sum(2 * used * sizes[n - used] for used in range(1, n + 1)) for n in range(level + 1)]
    return sum(sizes)


@lru_cache(maxsize=32)
def _smolyak(p: int, level: int) -> tuple[Array, Array]:
    """Coordinates (R, p) and weights (R,), the mean first."""
    weights: dict[tuple[tuple[int, float], ...], float] = {(): 0.0}  # by the coordinates that are not 0
    for total in range(level + 1):
        sign = (-1.0) ** (level - total) * comb(p - 1, level - total)
        if not sign:
            continue
        for levels in _levels_that_sum_to(total, p):
            rules = [[(j, float(z), float(w)) for z, w in zip(*hermite(2 * n + 1), strict=True)] for j, n in levels]
            for node in product(*rules):
                place = tuple((j, z) for j, z, _ in node if z)
                weight = float(np.prod([w for _, _, w in node]))
                weights[place] = weights.get(place, 0.0) + sign * weight
    z = np.zeros((len(weights), p))
    for r, place in enumerate(weights):
        for j, value in place:
            z[r, j] = value
    found = np.array(list(weights.values()))
    z.flags.writeable = found.flags.writeable = False
    return z, found


def _levels_that_sum_to(total: int, p: int) -> Iterator[tuple[tuple[int, int], ...]]:
    """All ways to share `total` among p coordinates, as pairs of a coordinate and its level above 0."""
    for count in range(min(total, p) + 1):
        for coordinates in combinations(range(p), count):
            for cuts in combinations(range(1, total), count - 1) if count else ([()] if not total else []):
                ends = [0, *cuts, total]
                yield tuple((j, ends[i + 1] - ends[i]) for i, j in enumerate(coordinates))
