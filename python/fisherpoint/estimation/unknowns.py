"""Unknowns as standardised coordinates z: theta = center + scale z, or the exponential of that."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..basics.checks import as_float, as_numbers, check_known, check_mapping
from ..basics.messages import shown
from ..basics.values import Array, FrozenMapping, IntArray
from ..models import Model
from ..prior.gaussian import GaussianPrior
from .least_squares import CONVERGED, RAN_OFF, Minima

EPSILON = float(np.finfo(np.float64).eps)

FARTHEST, NEXT_TO = 30.0, 1e-9
"""How far the logarithm of an unknown may go from its center: a factor of 1e13, past which trajectories mean nothing; and how near
to that it counts as there."""

AT = 4.0
"""How many doubles a coordinate may be off a bound by rounding."""


@dataclass(frozen=True, eq=False)
class Unknowns:
    """P unknowns: parameters, and starts of records that are not known.

    Attributes
    ----------
    names : tuple of str
    center, scale : ndarray, (P,)
        Of the unknowns, or of their logarithms. The center is zero where no prior has one: an unknown may become much smaller than
        its start, and keeps its digits.
    log : ndarray of bool, (P,)
    lower, upper : ndarray, (P,)
        Bounds of z.
    has_prior : ndarray of bool, (P,)
        Whether center and scale are the mean and the standard deviation of a prior.
    """

    names: tuple[str, ...]
    center: Array
    scale: Array
    log: NDArray[np.bool_]
    lower: Array
    upper: Array
    has_prior: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.names)

    def values(self, z: Array) -> Array:
        """Unknowns (B, P) in SI units of coordinates (B, P)."""
        linear = self.center + self.scale * z
        return np.where(self.log, np.exp(np.where(self.log, linear, 0.0)), linear)

    def slopes(self, values: Array) -> Array:
        """d values / dz, (B, P), at the unknowns (B, P)."""
        return np.where(self.log, values, 1.0) * self.scale

    def spacing(self, z: Array) -> Array:
        """How far apart neighbouring values of the unknowns are in coordinates, (..., P), at z (..., P)."""
        linear = np.abs(self.center + self.scale * z)
        size = np.where(self.log, np.maximum(linear, 1.0), linear)  # of a logarithm: what its exponential is rounded to, too
        return np.asarray(np.maximum(EPSILON * size / self.scale, np.spacing(np.abs(z))))

    def coordinates(self, values: Array) -> Array:
        """z (B, P) of unknowns (B, P)."""
        linear = np.where(self.log, np.log(np.where(self.log, values, 1.0)), values)
        return (linear - self.center) / self.scale

    def at_bounds(self, z: Array) -> tuple[str, ...]:
        """Names of the unknowns that are at a bound at z (P,)."""
        return tuple(name for name, at in zip(self.names, self.held(z), strict=True) if at)

    def without_bounds(self, names: Collection[str]) -> Unknowns:
        """Return these unknowns without the bounds of those of these names."""
        free = np.isin(self.names, list(names))
        return replace(self, lower=np.where(free, -np.inf, self.lower), upper=np.where(free, np.inf, self.upper))

    def held(self, z: Array) -> NDArray[np.bool_]:
        """Whether coordinates (..., P) are at a bound, to within rounding."""
        lower, upper = (np.where(np.isfinite(bound), bound, np.nan) for bound in (self.lower, self.upper))
        room = AT * self.spacing(z)
        return np.asarray((z <= lower + room) | (z >= upper - room))

    def ended(self, minima: Minima) -> IntArray:
        """How searches ended (B,): not at a minimum where a logarithm went as far as it may, which is no bound that anyone gave."""
        off = (self.log & (np.abs(minima.z) * self.scale >= FARTHEST - NEXT_TO)).any(axis=1)
        return np.where(off & (minima.end == CONVERGED), RAN_OFF, minima.end).astype(np.int32)


def unknowns_of(
    start: Mapping[str, float],
    prior: GaussianPrior | None,
    sizes: Mapping[str, float],
    bounds: Mapping[str, tuple[float | None, float | None]],
    about: Mapping[str, tuple[float, float]] = FrozenMapping({}),
) -> Unknowns:
    """Coordinates for the unknowns in the order of `start`.

    Parameters
    ----------
    start : mapping of name to float
    prior : GaussianPrior or None
        Of some of them: its mean is where z = 0, its standard deviation the unit of z. Others have |start| as the unit.
    sizes : mapping of name to float
        Units of z of others, where |start| is none.
    bounds : mapping of name to (lower, upper)
        None is no bound.
    about : mapping of name to (center, unit)
        Of others, where both are known.
    """
    names = tuple(start)
    center, scale, log = np.zeros(len(names)), np.ones(len(names)), np.zeros(len(names), dtype=bool)
    has_prior = np.array([(prior is not None and name in prior.names) or name in about for name in names], dtype=bool)
    lower, upper = np.full(len(names), -np.inf), np.full(len(names), np.inf)
    for j, name in enumerate(names):
        if prior is not None and name in prior.names:
            center[j], scale[j] = prior.mean[name], prior.normal_std[prior.names.index(name)]
            if name in prior.log:
                log[j], center[j] = True, np.log(prior.mean[name]) - scale[j] ** 2 / 2
                lower[j], upper[j] = -FARTHEST / scale[j], FARTHEST / scale[j]
        elif name in about:
            center[j], scale[j] = about[name]
        else:
            scale[j] = sizes.get(name) or abs(start[name]) or 1.0
        for side, bound in zip((lower, upper), bounds.get(name, (None, None)), strict=True):
            if bound is not None and np.isfinite(bound) and not (log[j] and bound <= 0):
                side[j] = ((np.log(bound) if log[j] else bound) - center[j]) / scale[j]
    return Unknowns(names, center, scale, log, lower, upper, has_prior)


def checked_bounds(
    model: Model, given: Mapping[str, tuple[float | None, float | None]] | None, names: tuple[str, ...]
) -> dict[str, tuple[float | None, float | None]]:
    """Bounds as given, over those without which the model makes no sense."""
    bounds: dict[str, tuple[float | None, float | None]] = {name: (least, None) for name, least in model.least.items()}
    given = {} if given is None else check_mapping(given, "bounds", "(lower, upper)")
    check_known(given, names, "bounds")
    for name, pair in given.items():
        if not isinstance(pair, tuple | list) or len(pair) != 2:
            raise TypeError(f"bounds[{name!r}]: expected (lower, upper) with None for no bound, given {shown(pair)}")
        low, high = (_checked_bound(bound, f"bounds[{name!r}]") for bound in pair)
        if low is not None and high is not None and not low < high:
            raise ValueError(f"bounds[{name!r}]: expected lower < upper, given {low:g} and {high:g}")
        bounds[name] = (bounds.get(name, (None, None))[0] if low is None else low, high)
    return bounds


def _checked_bound(given: float | None, name: str) -> float | None:
    """A number, or None where there is no bound: also for an infinite one."""
    return None if given is None or np.isinf(as_numbers(given, name)).all() else as_float(given, name)


def prior_factor(prior: GaussianPrior | None, unknowns: Unknowns) -> Array | None:
    """L^-1 (k, P) of the correlation L L^T that the prior has in coordinates, for the k unknowns that it covers; None for none."""
    if prior is None:
        return None
    columns = [j for j, name in enumerate(unknowns.names) if name in prior.names]
    if not columns:
        return None
    correlation = prior.marginal([unknowns.names[j] for j in columns]).normal_correlation
    factor = np.zeros((len(columns), len(unknowns)))
    factor[:, columns] = np.linalg.solve(np.linalg.cholesky(correlation), np.eye(len(columns)))
    return factor
