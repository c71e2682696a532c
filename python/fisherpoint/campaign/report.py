"""A campaign as a report: relative standard errors over the batches, targets, and what comes next."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from ..information.problem_report import local_in_words
from ..show.numbers import computed, counted, number, percent
from ..show.section import Report, Section
from .batches import search_of
from .state import CampaignState

MOST_LOCAL = 20
"""Values of local parameters that are shown, the last ones."""

MOST_COLUMNS = 6
"""Batches that are shown, the last ones."""


def campaign_report(state: CampaignState, met: Mapping[str, bool], done: bool) -> Report:
    """The report of a campaign."""
    history, names, targets = state.batches, state.problem.estimated, state.targets
    measured = Counter({} if history else {search_of(state.problem).kind: 0})
    for batch in history:
        measured[batch.data.points.kind] += len(batch.data)
    units = {quantity.name: quantity.unit for quantity in state.problem.model.parameters}
    shown = list(enumerate(history, 1))[-MOST_COLUMNS:]
    errors = [state.rse[0], *(batch.rse for _, batch in shown)]
    columns = ["parameter", "unit", "estimate", "prior", *(f"batch {k}" for k, _ in shown)]
    if targets:
        columns += ["target", "met"]
    rows = []
    for name in names:
        row = [name, units[name], computed(state.estimate[name], 5), *(percent(one[name]) for one in errors)]
        if targets:
            target = targets.get(name)
            row += ["", ""] if target is None else [f"{number(100 * target, 3)} %", "yes" if met[name] else "no"]
        rows.append(row)
    so_far = (
        f"{counted(len(history), 'batch', 'batches')}, {' and '.join(counted(n, kind) for kind, n in measured.items())} measured"
    )
    local, shown_local = state.problem.local_parameters, list(history[-1].local)[-MOST_LOCAL:] if history else []
    notes = [*_goodness(state), _stage(state, met, done)]
    table = Section("Relative standard errors, shares of the estimate", columns, rows, notes=notes)
    stuck = bool(history) and not history[-1].converged
    warnings = ["The last fit has not converged: its standard errors are not reliable"] * stuck
    sections = [table]
    if shown_local:
        of_each = [
            (name, units[name.partition("[")[0]], computed(history[-1].local[name], 5), computed(history[-1].local_errors[name]))
            for name in shown_local
        ]
        left_out = len(history[-1].local) - len(shown_local)
        notes = [f"{local_in_words(local)}{f'; {left_out} earlier ones left out' if left_out else ''}"]
        sections.append(Section("Local parameters", ("value", "unit", "estimate", "standard error"), of_each, notes=notes))
    return Report(f"Campaign on {state.problem.model.name}: {so_far}", sections, warnings)


def _goodness(state: CampaignState) -> list[str]:
    """Whether the model describes the data, where the noise is known."""
    if state.problem.noise is None or not state.batches or not state.batches[-1].degrees_of_freedom > 1e-9:
        return []
    from scipy.stats import chi2

    last = state.batches[-1]
    chance = float(chi2.sf(last.chi_square, last.degrees_of_freedom))  # of a larger one
    degrees = f"{number(last.chi_square)} of {number(last.degrees_of_freedom)} degrees of freedom"
    return [f"Chi-square {degrees} (p = {number(chance, 2)}){'' if chance > 0.001 else ': the model or the noise is wrong'}"]


def _stage(state: CampaignState, met: Mapping[str, bool], done: bool) -> str:
    if done:
        return "All targets are met"
    lacking = [name for name, is_met in met.items() if not is_met]
    planned = (
        "is to be designed" if state.planned is None else f"is to be measured: {counted(len(state.planned), state.planned.kind)}"
    )
    missed = f"; above target: {', '.join(lacking)}" if state.batches and lacking else ""
    return f"Batch {len(state.batches) + 1} {planned}{missed}"
