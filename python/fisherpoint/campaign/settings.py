"""What a campaign is given: the settings of a batch's search, seeds, and targets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from functools import partial
from inspect import signature
from typing import Any

import numpy as np

from ..basics.checks import as_positive, by_name, check_positive_int
from ..basics.messages import shown
from ..design.exchange import exchange
from ..design.settings import ExchangeSettings
from ..information.problem import DesignProblem

_NOT_SETTINGS = ("n_experiments", "seed", "time_limit")


def batch_seed(seed: int, batches: int) -> int:
    """The seed of the search after so many batches."""
    return int(np.random.SeedSequence([seed, batches]).generate_state(1)[0])


def batch_settings(batch: int, seed: int, given: Mapping[str, Any]) -> ExchangeSettings:
    """Settings of the search for a batch, with the defaults of `exchange` but for references, which a batch needs none of."""
    defaults = {name: one.default for name, one in signature(exchange).parameters.items()}
    known = [field.name for field in fields(ExchangeSettings) if field.name not in _NOT_SETTINGS]
    for unknown in (name for name in given if name not in known):
        raise TypeError(f"settings: expected names of {', '.join(known)}; given {shown(unknown)}")
    values = {name: defaults[name] for name in known} | {"references": False} | dict(given)
    return ExchangeSettings(
        n_experiments=check_positive_int(batch, "batch"), seed=check_positive_int(seed, "seed", 0), time_limit=None, **values
    )


def checked_targets(given: Mapping[str, float] | float | None, problem: DesignProblem) -> Mapping[str, float]:
    """Targets by name, in the model's order of parameters."""
    if given is not None and not isinstance(given, Mapping):
        given = dict.fromkeys(problem.estimated, given)
    return by_name(given, problem.estimated, "targets", partial(as_positive, what="share of the estimate"))
