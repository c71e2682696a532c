"""What a design is worth over the prior, as sections of its report."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...show.numbers import computed, counted
from ...show.section import Section
from .criterion_report import ByGoal


def over_sections(design: ByGoal) -> Iterator[Section]:
    """What was maximised, its parts, and the standard errors; nothing where the criterion is of the prior mean."""
    values, over = design.scenarios, design.settings.goal.over
    if values is None or over is None:
        return
    log_dets = np.array(values.log_dets)
    scenarios = f"{counted(len(log_dets), 'scenario')}, {over.named_scenarios}"
    facts = [
        ("maximised", f"{design.settings.goal.maximised} over {scenarios}: {values.value:.4f}"),
        ("log det F at the prior mean", f"{design.evaluation.log_det:.4f}"),
        ("in the mean of the scenarios", f"{values.mean:.4f}"),
        ("smallest, largest", f"{log_dets.min():.4f}, {log_dets.max():.4f}"),
    ]
    yield Section("Criterion over the prior", (), facts)
    units = {quantity.name: quantity.unit for quantity in design.problem.model.parameters}
    at_mean, expected, largest = design.evaluation.standard_errors or {}, values.expected_errors, values.largest_errors
    columns = ("parameter", "unit", "at the prior mean", "geometric mean", "largest")
    rows = [
        (name, units[name], *(computed(of.get(name, np.inf)) for of in (at_mean, expected, largest)))
        for name in design.evaluation.parameters
    ]
    note = "In each scenario they are those of the sensor noise there; the mean is that of their logarithms, by the weights."
    yield Section("Standard errors over the prior", columns, rows, notes=[note])
