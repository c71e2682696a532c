"""Quasi-Monte Carlo: many nodes of equal weight, whatever the dimension."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from functools import lru_cache

import numpy as np

from ...basics.checks import check_positive_int, check_type
from ...basics.interrupts import interrupts_wait
from ...basics.values import Array
from ...engine import _core
from ..gaussian import GaussianPrior
from .base import Rule, node_table

MAX_NODES = 2**20


@dataclass(frozen=True)
class Sobol(Rule):
    """Scrambled Sobol points through the inverse normal distribution function, in the coordinates of the Cholesky factor.

    Parameters
    ----------
    n : int
        Number of nodes, a power of two of at most 2^20.
    seed : int
        Of the scrambling: the same seed gives the same nodes.
    """

    n: int = 1024
    _: KW_ONLY
    seed: int = 0

    def __post_init__(self) -> None:
        n = check_positive_int(self.n, "n")
        if n & (n - 1) or n > MAX_NODES:
            raise ValueError(f"n: expected a power of two of at most {MAX_NODES}, given {n}")
        object.__setattr__(self, "n", n)
        object.__setattr__(self, "seed", check_positive_int(self.seed, "seed", 0))

    def size(self, prior: GaussianPrior) -> int:
        """Return the number of nodes R."""
        check_type(prior, GaussianPrior, "prior")
        return self.n

    def core_nodes(self, prior: GaussianPrior, varied: Sequence[str] | None = None) -> _core.NodeTable:
        p = len(prior.names if varied is None else tuple(varied))
        return node_table(prior, varied, standard_normal(p, self.n, self.seed), np.full(self.n, 1 / self.n))


@lru_cache(maxsize=4)
def standard_normal(p: int, n: int, seed: int = 0) -> Array:
    """Scrambled Sobol points (n, p) of standard normal variables; n is a power of two."""
    from scipy.special import ndtri
    from scipy.stats.qmc import Sobol as Points

    bits = 30
    # The first one reads SciPy's direction numbers, swallows what is raised there, and goes on without them.
    with interrupts_wait():
        points = Points(p, scramble=True, bits=bits, seed=np.random.default_rng(seed))
    uniform = points.random_base2(n.bit_length() - 1)
    if not _one_in_each_interval(uniform):
        raise RuntimeError(f"Sobol: expected {n} different nodes from SciPy, given others; try again")
    z: Array = ndtri(uniform + 0.5 ** (bits + 1))  # the middle of the interval that the digits leave open, which is never 0
    z.flags.writeable = False
    return z


def _one_in_each_interval(uniform: Array) -> bool:
    """Whether each of n equal intervals has one of the n numbers, in every coordinate, as in every scrambled Sobol set."""
    n = len(uniform)
    return all((np.bincount((column * n).astype(np.intp), minlength=n) == 1).all() for column in uniform.T)
