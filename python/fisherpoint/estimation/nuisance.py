"""Nuisance parameters, estimated beside the others: constants of the plant that are known roughly, and starts that all runs share.

Each is an unknown of the fit, with what is known of it beforehand as one more residual, (c - c_0) / std. So its error is common to
all data, what the data say about it is used, and the standard errors of the parameters are those of not knowing it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..basics.quantity import names_of
from ..basics.values import Array, FrozenMapping
from ..information.assumed import Assumed, assumed_of
from ..models import Model
from ..prior.gaussian import GaussianPrior

NOTHING: Mapping[str, float] = FrozenMapping({})


@dataclass(frozen=True)
class Nuisance:
    """The nuisance parameters of a fit.

    Attributes
    ----------
    uncertain : mapping of name to float
        Standard deviations, SI units, of constants and of parameters that are not estimated.
    starts : mapping of state name to float
        The same of the starts that all points or runs share.
    """

    uncertain: Mapping[str, float] = NOTHING
    starts: Mapping[str, float] = NOTHING

    def __bool__(self) -> bool:
        return bool(self.uncertain or self.starts)

    def of(self, model: Model) -> Assumed:
        """The model in which they are parameters."""
        return assumed_of(model, self.uncertain, None, self.starts, tuple(self.starts))


def known_beforehand(prior: GaussianPrior | None, assumed: Assumed, theta: Array) -> GaussianPrior | None:
    """Prior of all unknowns: that of the parameters, and the nuisance ones at theta (q,); None of none."""
    names = assumed.nuisance_names
    if not names:
        return prior
    mean = dict(zip(names, theta[assumed.nuisance].tolist(), strict=True))
    if prior is None:
        return GaussianPrior(mean, std=dict(zip(names, assumed.nuisance_std.tolist(), strict=True)))
    own = prior.marginal([name for name in prior.names if name not in names])
    p = len(own.names)
    covariance = np.zeros((p + len(names), p + len(names)))
    covariance[:p, :p] = own.covariance
    covariance[range(p, p + len(names)), range(p, p + len(names))] = np.square(assumed.nuisance_std)
    return GaussianPrior({**own.mean, **mean}, covariance=covariance, log=own.log)


def nuisance_of(
    uncertain: Mapping[str, float] | None, initial_state_std: Mapping[str, float] | None, shared: Sequence[str]
) -> tuple[Nuisance, Mapping[str, float]]:
    """The nuisance parameters, and the standard deviations of the starts that deviate anew in each point or run."""
    starts = dict(initial_state_std or {})
    common = {name: starts.pop(name) for name in tuple(starts) if name in shared}
    return Nuisance(FrozenMapping(dict(uncertain or {})), FrozenMapping(common)), starts


def own_parameters(model: Model, theta: Array) -> Array:
    """Parameters (..., p) of a model, of those of the model with nuisance parameters behind its own."""
    return theta[..., : len(names_of(model.parameters))]
