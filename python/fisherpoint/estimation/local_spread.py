"""The spread of local parameters between their groups, as given, or estimated by restricted maximum likelihood.

With penalties (l_g - mu) / s beside the data, minus twice the restricted likelihood of a spread s is, where the model is linear,

    min over all unknowns of (chi-square + penalties)  +  log det F  +  2 G log s

with F of all unknowns, penalties included, and G groups (Laplace's approximation where the model is not linear). Its derivative by
log s is 2 (G - sum over g of (penalty^2 + leverage of its row)). The model is made linear at the estimate, and the spread taken
anew there, until both come to rest.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.stop_reason import StopReason
from ..basics.values import Array, FrozenMapping
from .bordered import BlockFactor, Bordered, BorderedTangent
from .known_noise import KnownNoise
from .local_values import Spread
from .search import FoundMinimum, search_with_known_noise
from .weighting import WeightedResiduals

ROUNDS = 50
"""How often at most the spread is taken anew."""

SETTLED = 1e-9
"""Change of a spread, as a share, from which on it is the same."""

LEAST, MOST = 1e-3, 1e4
"""Bounds of a spread, in multiples of the median standard error that the values have without."""

THRESHOLD = 3.841459
"""Quantile of chi-square with one degree of freedom, of an interval that holds in 95 %."""

STEP = 1e-4
"""Step of the logarithm of a spread, for second derivatives."""

SMALLEST = 1e-300
"""Least pivot whose logarithm counts: that of an unknown which the data do not determine, whatever the spread."""


@dataclass(frozen=True, eq=False)
class LocalSearch:
    """The search with known noise, and with what the spreads say of local parameters."""

    residuals: WeightedResiduals
    noise: KnownNoise

    def __call__(self, z0: Array) -> tuple[FoundMinimum, Mapping[str, Spread]]:
        """The minimum from starts (B, P), and the spreads by name."""
        local = self.residuals.observed.local
        spreads = {name: Spread(one.std) for name, one in local.local.items() if one.std is not None}
        if not local.means:
            return self._with(spreads, z0), FrozenMapping(spreads)
        first = len(self.residuals.unknowns) - len(local.each)
        units = {name: float(self.residuals.unknowns.scale[first + local.of_parameter(name)[0]]) for name in local.means}
        spreads |= {name: Spread(unit) for name, unit in units.items()}
        evaluations, reached = 0, 1
        for round_ in range(ROUNDS):
            found = self._with(spreads, z0)
            evaluations += found.evaluations
            reached = found.reached if round_ == 0 else reached
            data = replace(found.residuals, prior_factor=self.residuals.prior_factor)
            latest = _Likelihood.at(data, found.z, spreads).best(local.means)
            settled = max(abs(latest[name].std / spreads[name].std - 1) for name in local.means) < SETTLED
            if settled or round_ == ROUNDS - 1:
                break
            spreads |= latest
            z0 = found.z[None]
        reason = found.stop_reason if settled else StopReason.weights_changed
        spreads |= {name: replace(latest[name], std=spreads[name].std) for name in local.means}  # those that were in the residuals
        return found._replace(evaluations=evaluations, reached=reached, stop_reason=reason), FrozenMapping(spreads)

    def _with(self, spreads: Mapping[str, Spread], z0: Array) -> FoundMinimum:
        rows = self.residuals.observed.local.spread_rows(self.residuals.unknowns, {name: one.std for name, one in spreads.items()})
        if not len(rows):
            return search_with_known_noise(self.residuals, z0, self.noise)
        return search_with_known_noise(
            replace(self.residuals, prior_factor=beside(self.residuals.prior_factor, rows)), z0, self.noise
        )


def beside(factor: Array | None, rows: Array) -> Array | None:
    """Rows (k, P) of what is known beforehand together with further ones; None of none."""
    if not len(rows):
        return factor
    return rows if factor is None else np.concatenate([factor, rows])


class _Penalties(NamedTuple):
    """The penalties of blocks at z, with a spread of 1 and columns in units of the data's.

    Attributes
    ----------
    spread : ndarray of int, (G, q)
        Number of the spread of each local unknown; -1 of none.
    own, border : ndarray, (G, q, q) and (G, q, C)
    at : ndarray, (G, q)
        The penalties themselves.
    """

    spread: NDArray[np.intp]
    own: Array
    border: Array
    at: Array


@dataclass(frozen=True, eq=False)
class _Likelihood:
    """Minus twice the restricted likelihood of spreads, of the model that is linear at z.

    Attributes
    ----------
    layout : Bordered
    tangent : BorderedTangent
        Of the data and the prior, without penalties.
    penalties : tuple of _Penalties
        Of each of the layout's blocks.
    given : mapping of name to float
        The spreads so far.
    typical : mapping of name to float
        Median standard error of each parameter's values, all else known, SI units.
    """

    layout: Bordered
    tangent: BorderedTangent
    penalties: tuple[_Penalties, ...]
    given: dict[str, float]
    typical: Mapping[str, float]

    @classmethod
    def at(cls, residuals: WeightedResiduals, z: Array, spreads: Mapping[str, Spread]) -> _Likelihood:
        local, further = residuals.observed.local, residuals.prior_factor
        layout, _ = local.layout(residuals.y.shape[-1], np.zeros((0, len(z))) if further is None else further)
        r, jacobian, _ = residuals.stored(z[None], np.zeros(1, dtype=np.intp))
        tangent = layout.tangent(r, jacobian)
        c, size, typical = layout.common, tangent.size[0], {}
        row_of, spread_of = np.zeros((layout.local, len(z))), np.full(layout.local, -1)
        for k, name in enumerate(spreads):
            places, rows = local.of_parameter(name), local.spread_rows(residuals.unknowns, {name: 1.0})
            row_of[places], spread_of[places] = rows, k
            typical[name] = float(np.median(rows[np.arange(len(rows)), c + places] / size[c + places]))
        penalties = []
        for blocks in layout.blocks:
            rows = row_of[blocks.unknowns]
            scaled = rows / size
            own = np.take_along_axis(scaled, c + blocks.unknowns[:, None, :], axis=2)
            penalties.append(_Penalties(spread_of[blocks.unknowns], own, scaled[..., :c], rows @ z))
        return cls(layout, tangent, tuple(penalties), {name: one.std for name, one in spreads.items()}, typical)

    def __call__(self, log: Array, names: Sequence[str]) -> tuple[float, Array]:
        """The value, and its derivatives by the logarithms of the spreads of these names."""
        spreads = self.given | dict(zip(names, np.exp(log).tolist(), strict=True))
        stds, corner = np.array([*spreads.values(), np.inf]), self.tangent.factor.corner
        along, common = self.layout.of_unknowns(self.tangent.along)
        parts, residuals = [], []
        for penalties, top, rows in zip(self.penalties, self.tangent.factor.tops, along, strict=True):
            q, weight = top.shape[2], 1 / stds[penalties.spread]
            own, border = (weight[None, ..., None] * some for some in (penalties.own, penalties.border))
            parts.append((np.concatenate([top[..., :q], own], axis=2), np.concatenate([top[..., q:], border], axis=2)))
            residuals.append(np.concatenate([rows, (weight * penalties.at)[None]], axis=2))
        factor = BlockFactor.of(parts, corner)
        tops, last = factor.projected(residuals, common)
        steps, of_common = factor.solved([-one for one in tops], -last)
        value = float(np.square(common + (corner @ of_common[..., None])[..., 0]).sum())
        value += 2 * float(np.log(np.maximum(factor.pivots(), SMALLEST)).sum())
        slopes = np.zeros(len(stds))
        for penalties, (own, border), rows, step, leverage in zip(
            self.penalties, parts, residuals, steps, factor.leverages(), strict=True
        ):
            q, left = step.shape[2], (rows + (own @ step[..., None] + border @ of_common[:, None, :, None])[..., 0])[0]
            value += float(np.square(left).sum()) + 2 * float(np.log(stds[penalties.spread[penalties.spread >= 0]]).sum())
            np.add.at(slopes, penalties.spread, 2 * (1 - np.square(left[:, q:]) - leverage[0][:, q:]))
        return value, slopes[[list(spreads).index(name) for name in names]]

    def best(self, names: Sequence[str]) -> dict[str, Spread]:
        """The most likely spreads of these names, with standard errors and intervals."""
        bounds = np.log([[end * self.typical[name] for end in (LEAST, MOST)] for name in names])
        start = np.clip(np.log([self.given[name] for name in names]), bounds[:, 0], bounds[:, 1])
        log, least = _lowest(lambda at: self(at, names), start, bounds)
        steps = STEP * np.eye(len(names))
        hessian = np.array([(self(log + step, names)[1] - self(log - step, names)[1]) / (2 * STEP) for step in steps])
        found = {}
        for j, name in enumerate(names):
            others = np.arange(len(names)) != j
            explained = np.linalg.pinv(hessian[np.ix_(others, others)]) @ hessian[others, j]
            curvature, std = float(hessian[j, j] - hessian[j, others] @ explained), float(np.exp(log[j]))
            error = std * float(np.sqrt(2 / curvature)) if curvature > 0 else float(np.inf)
            found[name] = Spread(std, error, self._interval(names, j, log, least, bounds))
        return found

    def _interval(self, names: Sequence[str], j: int, log: Array, least: float, bounds: Array) -> tuple[float, float]:
        from scipy.optimize import brentq

        others = np.arange(len(names)) != j

        def above(at: float) -> float:
            def of_others(some: Array) -> tuple[float, Array]:
                value, slopes = self(np.insert(some, int(np.sum(others[:j])), at), names)
                return value, slopes[others]

            lowest = _lowest(of_others, log[others], bounds[others])[1] if others.any() else self(np.array([at]), names)[0]
            return lowest - least - THRESHOLD

        low, high = bounds[j]
        lower = 0.0 if log[j] - low < STEP or above(low) <= 0 else float(np.exp(brentq(above, low, log[j], xtol=1e-6)))
        upper = float(np.inf) if above(high) <= 0 else float(np.exp(brentq(above, log[j], high, xtol=1e-6)))
        return lower, upper


def _lowest(value: Callable[[Array], tuple[float, Array]], start: Array, bounds: Array) -> tuple[Array, float]:
    from scipy.optimize import minimize, root

    found = minimize(value, start, jac=True, method="L-BFGS-B", bounds=bounds.tolist(), options={"ftol": 1e-15, "gtol": 1e-9})
    at = np.asarray(found.x, dtype=np.float64)
    if ((at > bounds[:, 0]) & (at < bounds[:, 1])).all():  # where the values are flat to rounding, the derivatives are not

        def slopes(log: Array) -> Array:
            return value(log)[1]

        finer = np.asarray(root(slopes, at, tol=1e-12).x, dtype=np.float64)
        if np.abs(finer - at).max() < 1e-2 and ((finer > bounds[:, 0]) & (finer < bounds[:, 1])).all():
            at = finer
    return at, value(at)[0]
