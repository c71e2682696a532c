"""Settings of a campaign: those of a batch's search, seeds, and targets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from functools import partial
from typing import Any

import numpy as np

from ..basics.checks import as_share, by_name, check_positive_int
from ..basics.messages import shown
from ..basics.options import refuse_misplaced
from ..design.goal.goal import goal_of
from ..design.results.settings import ExchangeSettings, method_of, most_iterations
from ..information.problem import DesignProblem
from .batches import Settings, search_of

MOST_TARGET = 1.0
"""Relative standard error above which a percentage was meant."""


def batch_seed(seed: int, batches: int) -> int:
    """The seed of the search after so many batches."""
    return int(np.random.SeedSequence([seed, batches]).generate_state(1)[0])


def batch_settings(problem: DesignProblem, batch: int | None, seed: int, given: Mapping[str, Any]) -> Settings:
    """Settings of the search for a batch, with the search's own defaults; no batch is compared with other designs."""
    by = search_of(problem)
    known = [field.name for field in fields(by.settings) if field.name not in (by.size, "seed", "time_limit")]
    refuse_misplaced((name for name in given if name not in known), by.settings, "fp.Campaign")
    for unknown in (name for name in given if name not in known):
        raise TypeError(f"settings: expected names of {', '.join(known)}; given {shown(unknown)}")
    values = dict(given) | {"goal": goal_of(given.get("goal", "D"))}
    if by.settings is ExchangeSettings:
        method = replace(method_of(given.get("method", "auto")), references=False)
        if method.time_limit is not None:
            raise ValueError(f"time_limit: expected none, by which no search would repeat another, given {method.time_limit:g}")
        values |= {"method": method, "max_iterations": most_iterations(given.get("max_iterations"), method, problem)}
    values[by.size] = check_positive_int(by.batch if batch is None else batch, "batch")
    return by.settings(**values, seed=check_positive_int(seed, "seed", 0))


def checked_targets(given: Mapping[str, float] | float | None, problem: DesignProblem) -> Mapping[str, float]:
    """Targets by name, in the model's order of parameters."""
    if given is not None and not isinstance(given, Mapping):
        given = dict.fromkeys(problem.estimated, given)
    return by_name(given, problem.estimated, "targets", partial(as_share, most=MOST_TARGET))
