"""Designs of several sizes as tables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..information.combinations import combination
from ..show.numbers import computed, counted, number, percent, percent_down
from ..show.section import Report, Section
from .singular_report import GUIDE, ridge_facts
from .swept import SweptDesigns

_LARGEST = 3
"""Parameters that are named for each size: those with the largest standard errors next to the prior's."""


def sweep_report(sweep: SweptDesigns) -> Report:
    """The designs by size."""
    prior = sweep.problem.prior.std
    rows, marked, timed = [], [], bool(sweep.problem.model.states)
    most = len(sweep.problem.estimated) - len(sweep.not_told)
    for k, (size, of) in enumerate(zip(sweep.sizes, sweep.designs, strict=True)):
        errors = of.evaluation.standard_errors
        told = np.isfinite(of.information)
        if errors is None:
            rank = of.evaluation.rank
            worst = f"F is singular: rank {rank}{f' of {most} that are possible' if rank < most else ''}"
            mean = percent(of.mean_error) if told else "-"
        else:
            share = {name: errors[name] / prior[name] for name in sweep.problem.estimated}
            largest = sorted(share, key=lambda name: -share[name])[:_LARGEST]
            worst = ", ".join(f"{name} {percent(share[name])}" for name in largest)
            mean = percent(of.mean_error)
        if size == sweep.knee:
            marked.append(k)
        at_least = "-" if of.at_least is None else percent_down(of.at_least)
        cost = [] if sweep.cost is None else [number(of.cost or 0.0)]
        information = computed(of.information, 5) if told else "-inf"
        lasting = [number(float(of.points.dt.sum()))] if timed else []
        rows.append((str(size), information, mean, worst, at_least, *lasting, *cost))
    lasting = ["duration [s]"] if timed else []
    columns = ["points", "log det F, sum", "mean error", "largest errors, of prior std", "efficiency at least", *lasting]
    notes = [
        "mean error: det(F)^(-1/2p), the geometric mean over the directions of the parameters, in prior std.",
    ]
    if sweep.n_candidates:
        notes.append(
            f"efficiency at least: proven among designs of the {sweep.n_candidates} candidates that the searches have evaluated, by"
            " the best weights of these; it says nothing of points between them. None is claimed of points that are too few."
        )
    if sweep.knee is not None:
        notes.append(f"From {sweep.knee} points on, which are marked, more help little next to the first ones.")
    table = Section("Designs by size", [*columns, *([] if sweep.cost is None else ["cost"])], rows, marked, notes)
    table = replace(table, notes=[*table.notes, *(f"{what}: {text}." for what, text in ridge_facts(sweep))])
    warnings = []
    if sweep.not_told:
        left = "; ".join(map(combination, sweep.not_told))
        warnings.append(
            f"No point of the region was found to tell about {left} (in prior std): log det F, mean errors and efficiencies are of"
            f" the rest. Measure other outputs, widen the region, or leave parameters out (parameters = [...]). See {GUIDE}."
        )
    if sweep.stop_reason != "done":
        why = "The time limit is over" if sweep.stop_reason == "time_limit" else "Interrupted"
        first = f"the search for {sweep.sizes[0]} points was not done, and " if sweep.stop_reason == "interrupted_first" else ""
        warnings.append(f"{why}: {first}larger sizes are missing.")
    beside = f" beside {sweep.n_previous} previous ones" if sweep.n_previous else ""
    sizes = sweep.sizes
    title = f"{counted(len(sizes), 'design')} of {sizes[0]} to {sizes[-1]} points{beside} for {sweep.problem.model.name}"
    return Report(title, [table], warnings)
