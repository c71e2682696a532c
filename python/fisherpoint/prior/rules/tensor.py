"""Rules on tensor grids: a few values for each coordinate, and all their combinations. Nodes are never stored."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import lru_cache, partial
from math import prod
from typing import ClassVar

import numpy as np
from numpy.polynomial.hermite_e import hermegauss

from ...basics.checks import as_floats, as_positive, by_name, check_names, check_positive_int, check_type
from ...basics.messages import shown
from ...basics.values import Array
from ...engine import _core
from ..coordinates import Coordinates, cholesky_coordinates, correlated_groups, principal_coordinates
from ..gaussian import GaussianPrior
from .base import Rule

MAX_NODES = 2**40
"""Nodes past which a grid counts as a slip: more than a week of work for one point."""

MAX_LEVELS, MAX_HERMITE_LEVELS = 10**6, 100
"""Maximum numbers of levels of one parameter."""

Edges = tuple[float, ...]


@dataclass(frozen=True, repr=False)
class TensorGrid(Rule):
    """Cells per parameter, eq. (13): equidistant, or between given edges.

    Each parameter takes `levels` values from mean - span std to mean + span std, each with the probability of its cell, a
    difference of the normal distribution function; a node's weight is the product. One level is the mean, with weight 1. The
    predictive covariance of a point exists only where the trajectories of all nodes are ok, as (21) requires.

    Correlated parameters have their cells along the principal axes of their correlation matrix. The logarithm of a log-normal
    parameter takes the part of the parameter.

    Parameters
    ----------
    levels : int or mapping of parameter name to int, optional
        Default: 3. The same for parameters that are correlated with each other.
    span : float, optional
        Half-width of the grid in prior standard deviations; default 1.5.
    edges : sequence of float, or mapping of parameter name to such, optional
        Instead of both: ascending edges of the cells in prior standard deviations from the mean, at least two. A cell's value is
        its middle.

    Raises
    ------
    ValueError
        Where a number makes no grid, or edges are given beside levels or span.
    """

    levels: int | Mapping[str, int] | None = None
    _: KW_ONLY
    span: float | None = None
    edges: Sequence[float] | Mapping[str, Sequence[float]] | None = None

    max_lost_weight: ClassVar[float] = 0.0

    def __post_init__(self) -> None:
        set_field = object.__setattr__
        if self.edges is not None:
            for name in ("levels", "span"):
                if getattr(self, name) is not None:
                    raise ValueError(f"{name}: expected none together with edges, given {shown(getattr(self, name))}")
            if isinstance(self.edges, Mapping):
                set_field(self, "edges", by_name(self.edges, None, "edges", _checked_edges))
            else:
                set_field(self, "edges", _checked_edges(self.edges, "edges"))
            return
        set_field(self, "levels", _checked_levels(3 if self.levels is None else self.levels))
        set_field(self, "span", as_positive(1.5 if self.span is None else self.span, "span", "number of standard deviations"))

    def __repr__(self) -> str:
        return (
            f"TensorGrid(levels={self.levels!r}, span={self.span})" if self.edges is None else f"TensorGrid(edges={self.edges!r})"
        )

    def levels_of(self, prior: GaussianPrior) -> dict[str, int]:
        """Return the number of levels of each parameter of the prior."""
        check_type(prior, GaussianPrior, "prior")
        if self.edges is None:
            return _levels_of(self.levels, prior)
        if isinstance(self.edges, Mapping):
            check_names(self.edges, prior.names, "edges")
            return {name: len(self.edges[name]) - 1 for name in prior.names}
        return dict.fromkeys(prior.names, len(self.edges) - 1)

    def size(self, prior: GaussianPrior) -> int:
        """Return the number of nodes R."""
        return prod(self.levels_of(prior).values())

    def check(self, prior: GaussianPrior) -> None:
        self.levels_of(prior)
        for group in correlated_groups(prior, prior.names):
            if len({self._cells_of(name) for name in group}) > 1:
                raise ValueError(
                    f"levels: expected the same cells for the correlated {', '.join(group)}, whose cells lie along common axes; "
                    "given different ones"
                )

    def core_nodes(self, prior: GaussianPrior, varied: Sequence[str] | None = None) -> _core.PriorGrid:
        self.check(prior)

        def axis(name: str) -> tuple[Array, Array]:
            cells = self._cells_of(name)
            if isinstance(cells, int):
                return _core.cells(0.0, 1.0, cells, self.span or 0.0)
            return _core.cells_between(np.array(cells))

        return _grid(prior, varied, self.levels_of(prior), self.edges is None, axis, principal_coordinates)

    def _cells_of(self, name: str) -> int | Edges:
        given = self.levels if self.edges is None else self.edges
        cells = given[name] if isinstance(given, Mapping) else given
        return cells if isinstance(cells, int) else tuple(cells or ())


@dataclass(frozen=True)
class GaussHermite(Rule):
    """Tensor product of Gauss-Hermite rules: exact for polynomials up to degree 2 levels - 1 in every coordinate.

    Correlated parameters have the coordinates of the Cholesky factor in the prior's order. One level is the mean.

    Parameters
    ----------
    levels : int or mapping of parameter name to int
        At most 100.
    """

    levels: int | Mapping[str, int] = 3

    def __post_init__(self) -> None:
        object.__setattr__(self, "levels", _checked_levels(self.levels, MAX_HERMITE_LEVELS))

    def levels_of(self, prior: GaussianPrior) -> dict[str, int]:
        """Return the number of levels of each parameter of the prior."""
        return _levels_of(self.levels, prior)

    def size(self, prior: GaussianPrior) -> int:
        """Return the number of nodes R."""
        return prod(self.levels_of(prior).values())

    def core_nodes(self, prior: GaussianPrior, varied: Sequence[str] | None = None) -> _core.PriorGrid:
        levels = self.levels_of(prior)
        return _grid(prior, varied, levels, True, lambda name: hermite(levels[name]), cholesky_coordinates)


@lru_cache
def hermite(levels: int) -> tuple[Array, Array]:
    """Nodes and weights of the Gauss-Hermite rule for the standard normal distribution, symmetric to the last bit."""
    z, weights = hermegauss(levels)
    z, weights = (z - z[::-1]) / 2, (weights + weights[::-1]) / 2
    return np.asarray(z), np.asarray(weights / weights.sum())


def _grid(
    prior: GaussianPrior,
    varied: Sequence[str] | None,
    levels: Mapping[str, int],
    one_is_mean: bool,
    axis: Callable[[str], tuple[Array, Array]],
    coordinates_of: Callable[[GaussianPrior, Iterable[str]], Coordinates],
) -> _core.PriorGrid:
    """The tensor grid with the given axis in the coordinate of each parameter that varies."""
    names = [name for name in (prior.names if varied is None else varied) if not (one_is_mean and levels[name] == 1)]
    if (size := prod(levels[name] for name in names)) > MAX_NODES:
        raise ValueError(f"levels: expected a grid of at most {MAX_NODES:.0e} nodes, given {float(min(size, 10**300)):.0e}")
    coordinates, still = coordinates_of(prior, names), (np.zeros(1), np.ones(1))
    axes = [axis(name) if name in names else still for name in prior.names]
    if not coordinates.diagonal:
        return _core.PriorGrid(axes, coordinates.center, coordinates.matrix, coordinates.exponential.tolist())
    return _core.PriorGrid([(coordinates.axis(j, z), probability) for j, (z, probability) in enumerate(axes)])


def _levels_of(levels: int | Mapping[str, int] | None, prior: GaussianPrior) -> dict[str, int]:
    check_type(prior, GaussianPrior, "prior")
    if isinstance(levels, Mapping):
        check_names(levels, prior.names, "levels")
        return {name: levels[name] for name in prior.names}
    return dict.fromkeys(prior.names, levels or 1)


def _checked_levels(given: int | Mapping[str, int], most: int = MAX_LEVELS) -> int | Mapping[str, int]:
    if isinstance(given, Mapping):
        return by_name(given, None, "levels", partial(check_positive_int, most=most))
    return check_positive_int(given, "levels", most=most)


def _checked_edges(given: Sequence[float], name: str) -> Edges:
    edges = as_floats(given, name)
    if edges.ndim != 1 or len(edges) < 2 or not (edges[1:] > edges[:-1]).all():
        raise ValueError(f"{name}: expected at least two ascending numbers of standard deviations, given {shown(given, 80)}")
    if not _core.cells_between(edges)[1].sum() > 0:
        raise ValueError(f"{name}: expected cells with a probability above zero, given {shown(given, 80)}")
    return tuple(edges.tolist())
