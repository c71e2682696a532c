"""Interface of every rule."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ...basics.checks import check_type
from ...basics.values import Array
from ...engine import _core
from ..coordinates import cholesky_coordinates
from ..gaussian import GaussianPrior

MAX_LOST_WEIGHT = 1e-3
"""Share of the absolute weight that the nodes of a point may lose before the point is none; the cells of (13) may lose none."""

PILOTS = 15
"""Outermost nodes of a stored rule for which, with the mean, steps are planned."""


@dataclass(frozen=True)
class Rule(ABC):
    """A way to take expectations over a prior: nodes theta (R, p) with weights (R,), which may be negative."""

    max_lost_weight: ClassVar[float] = MAX_LOST_WEIGHT
    signed: ClassVar[bool] = False  # whether weights may be negative

    @abstractmethod
    def size(self, prior: GaussianPrior) -> int:
        """Return the number of nodes R."""

    @abstractmethod
    def core_nodes(self, prior: GaussianPrior, varied: Sequence[str] | None = None) -> _core.PriorNodes:
        """Return the nodes as the core walks over them; parameters that are not `varied` stay at the mean."""

    def check(self, prior: GaussianPrior) -> None:
        """Raise ValueError where the rule does not fit the prior."""
        self.size(prior)

    def nodes(self, prior: GaussianPrior) -> tuple[Array, Array]:
        """Return the nodes theta (R, p) in SI units and their weights (R,)."""
        check_type(prior, GaussianPrior, "prior")
        return self.core_nodes(prior).nodes()

    def second_moments(self, prior: GaussianPrior, varied: Sequence[str] | None = None) -> Array:
        """Return the covariance (p, p) that the nodes have about the prior mean, for parameters in units of their prior std."""
        check_type(prior, GaussianPrior, "prior")
        mean, std = (np.array(list(values.values())) for values in (prior.mean, prior.std))
        return np.asarray(self.core_nodes(prior, varied).second_moments(mean, std))

    def variances(self, prior: GaussianPrior) -> dict[str, float]:
        """Return what the nodes make of each parameter's variance, as a share of the prior's."""
        check_type(prior, GaussianPrior, "prior")
        return dict(zip(prior.names, np.diag(self.second_moments(prior)).tolist(), strict=True))


def node_table(prior: GaussianPrior, varied: Sequence[str] | None, z: Array, weights: Array) -> _core.NodeTable:
    """Nodes with the coordinates z (R, number varied) of the Cholesky factor, as the core stores them."""
    names = [name for name in prior.names if varied is None or name in set(varied)]
    coordinates = cholesky_coordinates(prior, names)
    everything = np.zeros((len(z), len(prior.names)))
    everything[:, [prior.names.index(name) for name in names]] = z
    theta = coordinates.theta(everything)
    return _core.NodeTable(theta, weights, theta[_outermost(z, weights)])


def _outermost(z: Array, weights: Array) -> NDArray[np.intp]:
    """Places of PILOTS nodes among the outermost, spread evenly where more are equally far out."""
    distance = np.where(weights != 0, np.round(np.linalg.norm(z, axis=1), 9), -1.0)
    far = np.argsort(-distance, kind="stable")[: max(PILOTS, np.count_nonzero(distance == distance.max()))]
    far = far[distance[far] > 0]
    return far[np.unique(np.linspace(0, len(far) - 1, PILOTS).round().astype(int))] if len(far) else far
