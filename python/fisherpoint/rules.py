"""How expectations over the prior are taken: rules that turn a prior into weighted nodes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import prod

from . import _core
from .prior import GaussianPrior
from .quantity import Array, FrozenMapping, as_float, check_names, check_positive_int

MAX_NODES = 2**40
"""Nodes past which a grid counts as a slip: more than a week of work for one point."""


@dataclass(frozen=True)
class TensorGrid:
    """Equidistant cells per parameter, eq. (13).

    Each parameter takes `levels` values from mean - span std to mean + span std, each with the probability of its cell, a
    difference of the normal distribution function; a node's weight is the product. One level is the mean, with weight 1.

    Parameters
    ----------
    levels : int or mapping of parameter name to int
    span : float
        Half-width of the grid in prior standard deviations.
    """

    levels: int | Mapping[str, int] = 3
    span: float = 1.5

    def __post_init__(self) -> None:
        if isinstance(self.levels, Mapping):
            checked = {name: check_positive_int(n, f"levels[{name!r}]") for name, n in self.levels.items()}
            object.__setattr__(self, "levels", FrozenMapping(checked))
        else:
            object.__setattr__(self, "levels", check_positive_int(self.levels, "levels"))
        span = as_float(self.span, "span")
        if not span > 0:
            raise ValueError(f"span: expected a positive number of standard deviations, given {span:g}")
        object.__setattr__(self, "span", span)

    def levels_of(self, prior: GaussianPrior) -> dict[str, int]:
        """Return the number of levels of each parameter of the prior."""
        if isinstance(self.levels, Mapping):
            check_names(self.levels, prior.names, "levels")
            return {name: self.levels[name] for name in prior.names}
        return dict.fromkeys(prior.names, self.levels)

    def size(self, prior: GaussianPrior) -> int:
        """Return the number of nodes R."""
        return prod(self.levels_of(prior).values())

    def variances(self, prior: GaussianPrior) -> dict[str, float]:
        """Return what the grid makes of each parameter's variance, as a share of the prior's; 0 for a single level."""
        shares = {}
        for name, levels in self.levels_of(prior).items():
            z, probability = _core.cells(0.0, 1.0, levels, self.span)
            shares[name] = float(probability @ z**2 / probability.sum())
        return shares

    def nodes(self, prior: GaussianPrior) -> tuple[Array, Array]:
        """Return the nodes theta (R, p) and the cell probabilities (R,); the last parameter runs fastest.

        The predictive covariance does not need them: it walks over the grid without storing it.
        """
        return self.grid(prior).nodes()

    def grid(self, prior: GaussianPrior, varied: Iterable[str] | None = None) -> _core.PriorGrid:
        """Return the grid as the core walks over it; parameters that are not `varied` stay at the mean."""
        varied = prior.names if varied is None else tuple(varied)
        levels = {name: count if name in varied else 1 for name, count in self.levels_of(prior).items()}
        if prod(levels.values()) > MAX_NODES:
            raise ValueError(f"levels: expected a grid of at most {MAX_NODES:.0e} nodes, given {prod(levels.values()):.0e}")
        return _core.PriorGrid([_core.cells(prior.mean[name], prior.std[name], levels[name], self.span) for name in prior.names])
