"""A campaign as text: relative standard errors over the batches, targets, and what comes next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from .state import State

MOST_COLUMNS = 6
"""Batches that are shown, the last ones."""


def report_text(state: State, met: Mapping[str, bool], done: bool) -> str:
    """The report of a campaign."""
    history, names, targets = state.batches, state.problem.estimated, state.targets
    points = sum(len(batch.data) for batch in history)
    units = {quantity.name: quantity.unit for quantity in state.problem.model.parameters}
    shown = list(enumerate(history, 1))[-MOST_COLUMNS:]
    columns = [state.rse[0], *(batch.rse for _, batch in shown)]
    header = ["parameter", "unit", "estimate", "prior", *(f"batch {k}" for k, _ in shown)]
    if targets:
        header.append("target    ")
    rows = []
    for name in names:
        row = [name, units[name], f"{state.estimate[name]:#.5g}", *(percent(column[name]) for column in columns)]
        if targets:
            target = targets.get(name)
            row.append("" if target is None else f"{percent(target)} {'met' if met[name] else '   '}")
        rows.append(row)
    so_far = f"{_count(len(history), 'batch', 'batches')}, {_count(points, 'point')} measured"
    lines = [
        f"Campaign on {state.problem.model.name}: {so_far}",
        "Relative standard errors, shares of the estimate",
        *_aligned([header, *rows]),
        *_goodness(state),
        _stage(state, met, done),
    ]
    return "\n".join(lines)


def percent(share: float) -> str:
    """A share in percent; in words where that says little."""
    if not np.isfinite(share):
        return "open"
    return f"{100 * share:.3g} %" if share < 10 else f"{share:.3g} times"


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Columns of one width: names and units to the left, numbers to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(text.ljust(n) if j < 2 else text.rjust(n) for j, (text, n) in enumerate(zip(row, widths, strict=True))).rstrip()
        for row in rows
    ]


def _goodness(state: State) -> list[str]:
    """Whether the model describes the data, where the noise is known; what the estimate lacks."""
    if not state.batches:
        return []
    last, lines = state.batches[-1], []
    if state.problem.noise_std is not None and last.degrees_of_freedom > 1e-9:
        from scipy.stats import chi2

        chance = float(chi2.sf(last.chi_square, last.degrees_of_freedom))
        verdict = "" if chance > 0.001 else ": the model or the noise is wrong"
        lines.append(
            f"Chi-square {last.chi_square:.4g} of {last.degrees_of_freedom:.4g} degrees of freedom (p = {chance:.2g}){verdict}"
        )
    if not last.converged:
        lines.append("The last estimate is not a minimum: its standard errors mean little")
    return lines


def _stage(state: State, met: Mapping[str, bool], done: bool) -> str:
    lacking = [name for name, met in met.items() if not met]
    if done:
        return "All targets are met"
    number = len(state.batches) + 1
    planned = "is to be designed" if state.planned is None else f"is to be measured: {_count(len(state.planned), 'point')}"
    missed = f"; above target: {', '.join(lacking)}" if state.batches and lacking else ""
    return f"Batch {number} {planned}{missed}"


def _count(number: int, one: str, many: str | None = None) -> str:
    return f"{number} {one if number == 1 else many or one + 's'}"
