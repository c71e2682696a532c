"""The goal of a design, in words and in units of the criterion."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TypeAlias

import numpy as np

from ...show.numbers import computed, percent_down
from .found_design import FoundDesign
from .found_runs import FoundRuns
from .settings_section import option_facts

ByGoal: TypeAlias = FoundDesign | FoundRuns
"""Designs of points or runs that a search has found."""

NAMED = ("criterion", "of", "conditions", "scale", "over", "confidence")
"""Options of the goal that have lines of their own in a report."""


def goal_facts(design: ByGoal) -> Iterator[tuple[str, str]]:
    """The options of the goal, the criterion and its value, but for log det F, which is always shown."""
    goal = design.settings.goal
    yield from option_facts(goal, *NAMED)
    if goal.criterion == "D":
        return
    yield "criterion", f"{goal.criterion}: {goal.named}"
    value = computed(design.value, 6) if math.isfinite(design.value) else "infinite: not determined"
    if goal.row.variance and math.isfinite(design.value):
        value += f", standard deviation {computed(math.sqrt(design.value), 4)}"
    yield "its value with this design", value + goal.units
    if goal.row.scaled and design.evaluation.null_directions:
        yield "restricted to", "what the design determines; what it leaves open stands below"


def in_units(design: ByGoal, value: float) -> str:
    """A value of the objective at the prior mean, (7), in units of the criterion for all measurements."""
    if design.settings.goal.criterion == "D":
        return f"{value:.4f}"
    criterion = design.criterion
    log_phi = value / criterion.level + criterion.degree * float(np.log(design.evaluation.n_points / 2))
    return computed(criterion.of_log_phi(log_phi), 6)


def at_least(share: float) -> str:
    """A proven share in percent, rounded down."""
    return f"at least {percent_down(share)}"


def bound_of(design: ByGoal, value: float) -> str:
    """The bound of the objective, in units of the criterion."""
    goal = design.settings.goal
    if goal.over is not None:
        return f"{goal.maximised} over the scenarios at most {value:.4f}"
    if goal.criterion == "D":
        return f"log det at most {value:.4f}"
    side = "at least" if goal.row.minimised else "at most"
    return f"{goal.named} {side} {in_units(design, value)}"
