"""The first-order propagation of a covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...basics.checks import check_type
from ...basics.values import Array
from ...engine import _core
from ..gaussian import GaussianPrior
from .base import Rule


@dataclass(frozen=True)
class LinearizedRule(Rule):
    """S Sigma S^T with the sensitivities S at the prior mean and the covariance Sigma of the parameters: no node but the mean.

    The status of a point is that of its trajectory at the mean: nothing is tried elsewhere.
    """

    def size(self, prior: GaussianPrior) -> int:
        """Return the number of nodes, which is 1."""
        check_type(prior, GaussianPrior, "prior")
        return 1

    def core_nodes(self, prior: GaussianPrior, varied: Sequence[str] | None = None) -> _core.NodeTable:
        mean = np.array([list(prior.mean.values())])
        return _core.NodeTable(mean, np.ones(1), mean[:0])

    def second_moments(self, prior: GaussianPrior, varied: Sequence[str] | None = None) -> Array:
        """Return the prior's own: the covariance (p, p) of parameters in units of their prior std."""
        check_type(prior, GaussianPrior, "prior")
        moves = np.array([varied is None or name in varied for name in prior.names])
        return prior.correlation * np.outer(moves, moves)
