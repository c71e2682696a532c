"""Designs of several sizes as tables."""

from __future__ import annotations

import numpy as np

from ...basics.stop_reason import StopReason
from ...information.combinations import combinations
from ...show.numbers import computed, counted, number, percent, percent_down
from ...show.section import Report, Section
from ..results.settings_section import option_facts
from ..results.singular_report import GUIDE, ridge_facts
from .sweep_record import SweptDesigns

_LARGEST = 3
"""Parameters that are named for each size: those with the largest standard errors next to the prior's."""


def sweep_report(sweep: SweptDesigns) -> Report:
    """The designs by size."""
    prior, settings = sweep.problem.prior.std, sweep.settings
    row, what = settings.goal.row, settings.goal.maximised
    written = percent if row.relative else computed
    rows, marked, timed = [], [], bool(sweep.problem.model.states)
    most = len(sweep.problem.estimated) - len(sweep.not_estimable)
    for k, (size, of) in enumerate(zip(sweep.sizes, sweep.designs, strict=True)):
        errors = of.evaluation.standard_errors
        regular = np.isfinite(of.information)
        if errors is None:
            rank = of.evaluation.rank
            worst = f"F is singular: rank {rank}{f' of {most} that are possible' if rank < most else ''}"
            mean = written(of.mean_error) if regular else "-"
        else:
            share = {one: errors[one] / prior[one] for one in sweep.problem.estimated}
            largest = sorted(share, key=lambda one: -share[one])[:_LARGEST]
            worst = ", ".join(f"{one} {percent(share[one])}" for one in largest)
            mean = written(of.mean_error)
        if size == sweep.knee:
            marked.append(k)
        at_least = "-" if of.at_least is None else percent_down(of.at_least)
        cost = [] if sweep.cost is None else [number(of.cost or 0.0)]
        information = computed(of.information, 5) if regular else "-inf"
        lasting = [number(float(of.points.dt.sum()))] if timed else []
        rows.append((str(size), information, mean, worst, at_least, *lasting, *cost))
    lasting = ["duration [s]"] if timed else []
    columns = ["points", f"{what}, sum", row.error, "largest errors, of prior std", "efficiency at least", *lasting]
    notes = [f"{row.error}: {row.of_error}."]
    if sweep.n_candidates:
        notes.append(
            f"efficiency at least: proven among designs of the {sweep.n_candidates} candidates that the searches have evaluated, by"
            " the best weights of these; it says nothing of points between them. None is claimed of points that are too few."
        )
    if sweep.knee is not None:
        notes.append(f"From {sweep.knee} points on, which are marked, more help little next to the first ones.")
    notes += [f"{fact}: {text}." for fact, text in ridge_facts(sweep.ridge)]
    notes += [f"{words}: {value}." for words, value in option_facts(settings.goal, "criterion", "of", "over")]
    if settings.goal.over is not None:
        notes.append("The errors of parameters are those at the prior mean.")
    table = Section("Designs by size", [*columns, *([] if sweep.cost is None else ["cost"])], rows, marked, notes)
    warnings = []
    if sweep.not_estimable:
        left = combinations(sweep.not_estimable)
        of_rest = f"{what}, {row.error}s and efficiencies are of the rest"
        if not row.of_all:
            of_rest = f"criterion {settings.goal.criterion} is determined all the same"
        warnings.append(
            f"No point of the region was found with information on {left} (in prior std): {of_rest}. Measure other outputs, widen"
            f" the region, or leave parameters out (parameters = [...]). See {GUIDE}."
        )
    if not sweep.stop_reason.complete:
        last, missing = f"the search for {sweep.sizes[-1]} points was not done", "larger sizes are missing"
        if sweep.stop_reason != StopReason.interrupted:
            missing = f"{last}, and {missing}"
        warnings.append(f"The sweep was ended early ({sweep.stop_reason.words}): {missing}. {sweep.stop_reason.advice}")
    beside = f" beside {sweep.n_previous} previous ones" if sweep.n_previous else ""
    sizes = sweep.sizes
    title = f"{counted(len(sizes), 'design')} of {sizes[0]} to {sizes[-1]} points{beside} for {sweep.problem.model.name}"
    return Report(title, [table], warnings)
