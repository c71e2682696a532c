"""Designs of several sizes as tables."""

from __future__ import annotations

import numpy as np

from ..show.numbers import computed, counted, number, percent
from ..show.section import Report, Section
from .criterion_report import maximised_of
from .swept import SweptDesigns

_LARGEST = 3
"""Parameters that are named for each size: those with the largest standard errors next to the prior's."""


_ERRORS = {
    "D": ("mean error", "det(F)^(-1/2p), the geometric mean over the directions of the parameters, in prior std"),
    "Ds": ("mean error", "the geometric mean over the directions of the parameters that were asked for, in prior std"),
    "A": ("joint error", "the root of the trace of F^-1, of errors next to their scales"),
    "E": ("largest error", "that of the combination of parameters that is known worst, next to its scale"),
    "ME": ("error ratio", "the largest error of a combination of parameters over the smallest"),
    "c": ("error", "the standard deviation of the function"),
    "I": ("error", "the root of the mean variance of the predictions"),
}
"""By criterion, what phi^(-1/2) is called, and is."""


def sweep_report(sweep: SweptDesigns) -> Report:
    """The designs by size."""
    prior, asked = sweep.problem.prior.std, sweep.settings
    name = "D" if asked is None else asked.criterion
    error, what = _ERRORS.get(name, _ERRORS["D"]), "log det F" if asked is None else maximised_of(asked)
    rows, marked, timed = [], [], bool(sweep.problem.model.states)
    for k, (size, of) in enumerate(zip(sweep.sizes, sweep.designs, strict=True)):
        errors = of.evaluation.standard_errors
        told = np.isfinite(of.information)
        if errors is None:
            worst, mean = "F is singular", "-"
            if told and name not in ("D", "Ds"):
                mean = computed(of.mean_error)
        else:
            share = {name: errors[name] / prior[name] for name in sweep.problem.estimated}
            largest = sorted(share, key=lambda name: -share[name])[:_LARGEST]
            worst = ", ".join(f"{name} {percent(share[name])}" for name in largest)
            mean = computed(of.mean_error) if name in ("c", "I", "ME") else percent(of.mean_error)
        if size == sweep.knee:
            marked.append(k)
        at_least = "-" if of.at_least is None else percent(of.at_least)
        cost = [] if sweep.cost is None else [number(of.cost or 0.0)]
        information = computed(of.information, 5) if told else "-inf"
        lasting = [number(float(of.points.dt.sum()))] if timed else []
        rows.append((str(size), information, mean, worst, at_least, *lasting, *cost))
    lasting = ["duration [s]"] if timed else []
    columns = ["points", f"{what}, sum", error[0], "largest errors, of prior std", "efficiency at least", *lasting]
    notes = [
        f"{error[0]}: {error[1]}.",
        f"efficiency at least: proven among designs of the {sweep.n_candidates} candidates that the searches have evaluated, by the"
        " best weights of these; it says nothing of points between them.",
    ]
    if sweep.knee is not None:
        notes.append(f"From {sweep.knee} points on, which are marked, more help little next to the first ones.")
    table = Section("Designs by size", [*columns, *([] if sweep.cost is None else ["cost"])], rows, marked, notes)
    if asked is not None and asked.prior_information:
        notes.append("The prior's information counts once beside the data, in the criterion, its bounds and the errors.")
    if asked is not None and asked.over is not None:
        notes.append("The errors of parameters are those at the prior mean.")
    warnings = []
    if sweep.stop_reason != "done":
        why = "Interrupted" if sweep.stop_reason == "interrupted" else "The time limit is over"
        warnings.append(f"{why}: larger sizes are missing.")
    beside = f" beside {sweep.n_previous} previous ones" if sweep.n_previous else ""
    sizes = sweep.sizes
    title = f"{counted(len(sizes), 'design')} of {sizes[0]} to {sizes[-1]} points{beside} for {sweep.problem.model.name}"
    return Report(title, [table], warnings)
