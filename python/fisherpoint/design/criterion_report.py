"""The goal of a design, in words and in units of the criterion."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Protocol

import numpy as np

from ..information.evaluation import Evaluation
from ..show.numbers import computed, percent_down
from .optimality.criteria import Criterion
from .optimality.goal import CriterionSettings, named
from .over_prior import OverPrior


class Settings(CriterionSettings, Protocol):
    @property
    def over(self) -> OverPrior | None: ...
    @property
    def prior_information(self) -> bool: ...


class ByCriterion(Protocol):
    """A design of points or runs."""

    @property
    def settings(self) -> Settings: ...
    @property
    def evaluation(self) -> Evaluation: ...
    @property
    def criterion(self) -> Criterion: ...
    @property
    def value(self) -> float: ...


def goal_text(design: ByCriterion) -> str:
    """The end of a headline; nothing for log det F, which is the usual one."""
    name, of = design.settings.criterion, design.settings.of
    return "" if name == "D" else f"; chosen by criterion {name}, {named(name, of)}"


def maximised(design: ByCriterion) -> str:
    """What stands at the axis of a picture, and in sentences about what is proven."""
    return maximised_of(design.settings)


def maximised_of(settings: Settings) -> str:
    """What is maximised, by the settings of a search."""
    over = settings.over
    what = "log det F"
    if settings.criterion != "D":
        sign = "-" if settings.criterion in ("A", "c", "I", "ME") else ""
        what = named(settings.criterion, settings.of)
        what = what if settings.criterion == "Ds" else f"{sign}log({what})"
    return what if over is None else over.described_with(what)


def goal_facts(design: ByCriterion) -> Iterator[tuple[str, str]]:
    """The criterion and its value, but for log det F, which is always shown; and whether the prior counts."""
    settings = design.settings
    if settings.prior_information:
        yield "prior information", "counts once beside the data, in the criterion, its bounds and the standard errors"
    if settings.criterion == "D":
        return
    yield "criterion", f"{settings.criterion}: {named(settings.criterion, settings.of)}"
    value = computed(design.value, 6) if math.isfinite(design.value) else "infinite: not determined"
    if settings.criterion in ("c", "I") and math.isfinite(design.value):
        value += f", standard deviation {computed(math.sqrt(design.value), 4)}"
    if settings.scale is not None:
        value += f", with errors in units of {', '.join(f'{size:g} ({name})' for name, size in settings.scale.items())}"
    elif settings.criterion in ("A", "E", "ME"):
        value += ", parameters in units of their prior std"
    yield "its value with this design", value
    if settings.criterion in ("A", "E", "ME") and design.evaluation.null_directions:
        yield "restricted to", "what the design determines; what it leaves open stands below"


def in_units(design: ByCriterion, value: float) -> str:
    """A value of the objective at the prior mean, (7), in units of the criterion for all measurements."""
    if design.settings.criterion == "D":
        return f"{value:.4f}"
    criterion = design.criterion
    log_phi = value / criterion.level + criterion.degree * float(np.log(design.evaluation.n_points / 2))
    return computed(criterion.of_log_phi(log_phi), 6)


def at_least(share: float) -> str:
    """A proven share in percent, rounded down."""
    return f"at least {percent_down(share)}"


def bound_of(design: ByCriterion, value: float) -> str:
    """The bound of the objective, in units of the criterion."""
    settings = design.settings
    if settings.over is not None:
        return f"{maximised(design)} over the scenarios at most {value:.4f}"
    if settings.criterion == "D":
        return f"log det at most {value:.4f}"
    side = "at least" if settings.criterion in ("A", "c", "I") else "at most"
    return f"{named(settings.criterion, settings.of)} {side} {in_units(design, value)}"
