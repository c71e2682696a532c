"""Whether the units of a model's equations fit, and the warning where they do not."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

from .clock import clock_quantity
from .dimensions import is_time, mistakes_in_units, plain_rate_of, rate_of, stated
from .quantities import DescribedModel
from .read_equations import place_of
from .surfaces.structure import Equations

MOST_MISTAKES = 5
"""Maximum number of mistakes in units that a warning lists."""


def mistakes_of(model: DescribedModel, equations: Equations, clock: Any) -> tuple[str, ...]:
    """A sentence for each place where units of a model's equations do not fit for certain; `clock` is the time that they read."""
    states, outputs = model.states, model.outputs
    both = [
        *((f"equations.{q.name}", rate, rate_of(q)) for q, rate in zip(states, equations.rates, strict=True)),
        *((place_of(model, q), output, stated(q)) for q, output in zip(outputs, equations.output, strict=True)),
    ]
    conditions = [*((f"domain[{i}]", one) for i, one in enumerate(equations.conditions)), *equations.along]
    rates = {f"equations.{q.name}": plain_rate_of(q) for q in states}
    read = [] if clock is None else [clock_quantity(clock.name)]
    found = mistakes_in_units(both, conditions, rates, (*(q for of in model._quantities() for q in of), *read))
    times = {*model.delays.values(), *model.late_outputs.values()}
    used = [q for q in (*model.parameters, *model.constant_quantities) if q.name in times]
    return (*found, *(f"{q.name} in {q.unit}, which is no time, is a dead time" for q in used if not is_time(q)))


def warn_of_mistakes(name: str, mistakes: Sequence[str], stacklevel: int) -> None:
    """Warn of the mistakes in units of the model of this name, where there are any."""
    if mistakes:
        more = f"; and {len(mistakes) - MOST_MISTAKES} more" if len(mistakes) > MOST_MISTAKES else ""
        listed = "; ".join(mistakes[:MOST_MISTAKES])
        text = f"units of {name}: {listed}{more}. If that is meant, check_units = false keeps quiet"
        warnings.warn(text, stacklevel=stacklevel)
