"""Nuisance quantities, not known exactly and not estimated: constants, parameters, and start states.

What is drawn anew in each point or run (a load, a start) is an error of that point or run: with H = dy/dz and P the squares of the
standard deviations, its outputs scatter about their prediction by R_k = R + H P H^T, and not by R, the sensor noise, alone. What
has one value for the whole plant (a constant) moves all outputs at once: it is a nuisance parameter, estimated beside the others
with the information 1/std^2 that it has beforehand (`nuisance.py`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..basics.checks import as_std_or_zero, by_name, check_type
from ..basics.quantity import names_of
from ..basics.values import Array, FrozenMapping, IntArray
from ..models import Model
from ..points.experiments import Experiments
from ..points.predictive import PredictiveCovariance, covariance_over_nodes, nodes_of
from ..points.run_trajectories import checked_sensitivities
from ..points.settings import Integration, checked_arguments
from ..points.status import Status, only_finite
from ..prior.gaussian import GaussianPrior
from ..prior.rules import LinearizedRule, Rule
from .local import LocalStds

NOTHING: FrozenMapping[float] = FrozenMapping({})

MARGIN = 3.0
"""Standard deviations of a surface's value, under those of the start, that a point keeps from a jump or limit."""


class AssumedCovariance(NamedTuple):
    """covariance (K, n_y, n_y) in squared output units, zero where the status (K,) is not ok."""

    covariance: Array
    status: IntArray


@dataclass(frozen=True, eq=False)
class Assumed:
    """A model in which what is not known exactly are parameters.

    Attributes
    ----------
    model : Model
        The model, with constants and then deviations of start states behind its own parameters.
    further : ndarray
        Values of these: the constants', and zeros.
    columns : list of int
        Places among `model.parameters` of what is drawn anew in each point or run.
    std : ndarray
        Its standard deviations, SI units.
    nuisance : list of int
        Places among `model.parameters` of what has one value for the whole plant.
    nuisance_std : ndarray
        Its standard deviations, SI units.
    free : list of int
        Places of local parameters of which each point or run has its own value, and of whose spread nothing is known.
    free_std : ndarray
        Standard deviations of the prior, SI units, of plants that are drawn; they are no information.
    open : list of int
        Places in `nuisance` of what nothing is known of beforehand, and whose standard deviations are only units.
    """

    model: Model
    further: Array
    columns: list[int]
    std: Array
    nuisance: list[int]
    nuisance_std: Array
    free: list[int]
    free_std: Array
    open: list[int]

    def theta(self, theta: Array) -> Array:
        """Parameters of the extended model, for parameters (p,) or (K, p) of the model."""
        return np.concatenate([theta, np.broadcast_to(self.further, (*theta.shape[:-1], len(self.further)))], axis=-1)

    def prior(self, theta: Array) -> GaussianPrior:
        """A prior for the extended model; of its standard deviations only those of what is drawn anew mean something."""
        names, std = names_of(self.model.parameters), np.ones(len(self.model.parameters))
        std[self.columns] = self.std
        return GaussianPrior(
            dict(zip(names, self.theta(theta).tolist(), strict=True)), std=dict(zip(names, std.tolist(), strict=True))
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters of the extended model that are drawn anew in each point or run."""
        names = names_of(self.model.parameters)
        return tuple(names[j] for j in sorted(self.columns))

    @property
    def drawn(self) -> tuple[list[int], Array]:
        """Places and standard deviations of all that has a new value in each point or run."""
        return self.columns + self.free, np.append(self.std, self.free_std)

    @property
    def nuisance_names(self) -> tuple[str, ...]:
        """Names of the parameters of the extended model that have one value for the whole plant."""
        names = names_of(self.model.parameters)
        return tuple(names[j] for j in self.nuisance)

    def covariance(self, dy_dtheta: Array) -> Array:
        """G P G^T, (K, n_y, n_y), from sensitivities (K, n_y, p) of the extended model; not finite where that overflows."""
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is given a status
            spread = dy_dtheta[:, :, self.columns] * self.std
            product: Array = spread @ spread.transpose(0, 2, 1)
            return (product + product.transpose(0, 2, 1)) / 2

    def predictive(self, points: Experiments, theta: Array, rule: Rule, settings: Integration) -> PredictiveCovariance:
        """The predictive covariance (16) over what is drawn anew, at parameters (p,) of the model."""
        nodes = nodes_of(rule, self.prior(theta), names_of(self.model.parameters), self.names)
        return covariance_over_nodes(self.model, points, self.theta(theta), nodes, rule, settings)


def assumed_of(
    model: Model,
    uncertain: Mapping[str, float] | None = None,
    varies: Mapping[str, float] | None = None,
    initial_state_std: Mapping[str, float] | None = None,
    shared: Sequence[str] = (),
    local: LocalStds | None = None,
) -> Assumed:
    """Extend a model; the same arguments give the same object.

    Parameters
    ----------
    model : Model
    uncertain, varies : mapping of name to float, optional
        Standard deviations, SI units, of constants and parameters: of what has one value for the plant, and of what is drawn anew.
    initial_state_std : mapping of state name to float, optional
        Standard deviations, SI units, of the deviations of starts.
    shared : sequence of str
        States whose start deviates once for all points or runs.
    local : LocalStds, optional
        Local parameters.

    Raises
    ------
    TypeError
        Where a constant of a model without equations is not known exactly.
    ValueError
        For an unknown name, a standard deviation that is negative, or a name that is `uncertain` and `varies`.
    """
    constants, parameters, states = map(names_of, (model.constant_quantities, model.parameters, model.states))
    common = by_name(uncertain, (*constants, *parameters), "uncertain", as_std_or_zero)
    anew = by_name(varies, (*constants, *parameters), "varies", as_std_or_zero)
    for name in (name for name in anew if name in common):
        raise ValueError(f"varies: expected names that are not among uncertain, given {name!r}, which is")
    starts = by_name(initial_state_std, states, "initial_state_std", as_std_or_zero)
    once = tuple(name for name in starts if name in shared)
    if local is None:
        return _extended(model, common, anew, starts, once, NOTHING, NOTHING)
    common, anew = FrozenMapping({**common, **local.whole, **local.open}), FrozenMapping({**anew, **local.anew})
    return _extended(model, common, anew, starts, once, FrozenMapping(local.free), FrozenMapping(local.open))


@lru_cache(maxsize=16)
def _extended(
    model: Model,
    common: FrozenMapping[float],
    anew: FrozenMapping[float],
    starts: FrozenMapping[float],
    shared: tuple[str, ...],
    free: FrozenMapping[float],
    open_: FrozenMapping[float],
) -> Assumed:
    constants = [name for name in names_of(model.constant_quantities) if name in common or name in anew]
    try:
        extended = model.estimate(*constants) if constants else model
    except TypeError as error:
        label, given = "uncertain" if any(name in common for name in constants) else "varies", type(model).__name__
        raise TypeError(f"{label}: expected a model with equations where it names constants, given a {given}") from error
    extended = extended.free_start(*starts) if starts else extended
    own, p = names_of(model.parameters), len(model.parameters)
    place = {name: j for j, name in enumerate((*own, *constants))}
    of_start = {name: p + len(constants) + j for j, name in enumerate(starts)}
    further = np.array([model.constants[name] for name in constants] + [0.0] * len(starts))

    def chosen(stds: Mapping[str, float], shares: bool) -> tuple[list[int], Array]:
        names = [name for name in place if name in stds]
        own_starts = [name for name in starts if (name in shared) == shares]
        columns = [place[name] for name in names] + [of_start[name] for name in own_starts]
        return columns, np.array([stds[name] for name in names] + [starts[name] for name in own_starts])

    nuisance, nuisance_std = chosen(common, True)
    unknown = [j for j, column in enumerate(nuisance) if any(column == place[name] for name in open_)]
    return Assumed(
        extended,
        further,
        *chosen(anew, False),
        nuisance,
        nuisance_std,
        [place[name] for name in free],
        np.array(list(free.values())),
        unknown,
    )


def assumed_covariance(
    model: Model,
    points: Experiments,
    theta: Mapping[str, float] | ArrayLike,
    *,
    varies: Mapping[str, float] | None = None,
    initial_state_std: Mapping[str, float] | None = None,
    rtol: float = 1e-6,
    threads: int | None = None,
    kinks: str = "cross",
    jumps: str = "cross",
    rule: Rule | None = None,
) -> AssumedCovariance:
    """Share of the output covariance that comes from what is drawn anew in each point: H P H^T, with exact tangents H, or (16).

    Parameters
    ----------
    model, points, theta, rtol, threads, kinks, jumps
        As in `simulate`.
    varies : mapping of name to float, optional
        Standard deviations, SI units, of constants and of parameters that are not estimated.
    initial_state_std : mapping of state name to float, optional
        Standard deviations, SI units, of the deviations of the starts from x0.
    rule : Rule, optional
        Takes the predictive covariance (16) over these instead of tangents; theta is (p,) then.

    Returns
    -------
    AssumedCovariance
        A point whose trajectory or tangents fail has the status of that, and zeros.

    Raises
    ------
    TypeError, ValueError
        As `simulate`; for an unknown name or a negative standard deviation; and for a constant of a model without equations,
        whose tangents nothing gives.
    """
    check_type(model, Model, "model")
    check_type(points, Experiments, "points")
    values = model.theta(theta)
    assumed = assumed_of(model, None, varies, initial_state_std)
    settings = checked_arguments(model, points, values, rtol, threads, kinks, jumps, None)
    if rule is not None and not isinstance(rule, LinearizedRule):
        check_type(rule, Rule, "rule")
        return AssumedCovariance(*assumed.predictive(points, values, rule, settings))
    result = checked_sensitivities(assumed.model, points, assumed.theta(values), settings, outputs_alone=True)
    covariance = assumed.covariance(result.dy_dtheta)
    status = only_finite(result.status, covariance)
    covariance[status != Status.ok] = 0.0
    return AssumedCovariance(covariance, status)


def starts_near(
    model: Model, points: Experiments, theta: Array, initial_state_std: Mapping[str, float], kinks: bool
) -> dict[str, NDArray[np.intp]]:
    """Return for each jump and limit, and each kink on request, the indices of the points that a start may put past it.

    Those are the points nearer to it than `MARGIN` standard deviations of its value, to first order in the starts' deviations.
    """
    if not len(points):
        return {}
    std = np.array([initial_state_std.get(name, 0.0) for name in names_of(model.states)])
    steps = np.diag(std)[std > 0]
    moves = np.concatenate([np.zeros((1, len(std))), steps, -steps])[:, None]
    x = (points.x0 + moves).reshape(-1, len(std))
    u, parameters = np.tile(points.u, (len(moves), 1)), np.tile(theta, (len(x), 1))
    shape = (len(moves), len(points))
    crossed = len(model.jumps) + (len(model.kinks) if kinks else 0)
    surfaces = np.asarray(model.core.switching(x, u, parameters)).reshape(*shape, len(model.jumps) + len(model.kinks))
    limits = np.asarray(model.core.limits(x, u, parameters)).reshape(*shape, len(model.domain))
    values = np.concatenate([surfaces[:, :, :crossed], limits], axis=2)
    up, down = np.split(values[1:], 2)
    distance = np.abs(values[0])
    inside = values[0] > 0  # what is past a limit has left the domain
    inside[:, : crossed + len(model.poles)] = True
    # Not finite where a deviation already leaves what the model takes: that is near.
    near = inside & ~(distance >= MARGIN * np.linalg.norm((up - down) / 2, axis=0))
    names = (*model.jumps, *model.kinks)[:crossed] + model.domain
    each = {name: [m for m, other in enumerate(names) if other == name] for name in names}
    return {name: np.flatnonzero(near[:, of].any(axis=1)) for name, of in each.items() if near[:, of].any()}
