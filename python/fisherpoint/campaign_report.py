"""A campaign as text: relative standard errors over the batches, targets, and what comes next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from .campaign_state import relative

if TYPE_CHECKING:
    from .campaign import Campaign

MOST_COLUMNS = 6
"""Batches that are shown, the last ones."""


def report_text(campaign: Campaign) -> str:
    """The report of a campaign."""
    history, prior, names = campaign.history, campaign.problem.prior, campaign.problem.estimated
    points = sum(len(batch.data) for batch in history)
    units = {quantity.name: quantity.unit for quantity in campaign.problem.model.parameters}
    before = relative({name: prior.std[name] for name in names}, prior.mean)
    shown = list(enumerate(history, 1))[-MOST_COLUMNS:]
    columns: list[Mapping[str, float]] = [before, *(batch.rse for _, batch in shown)]
    header = ["parameter", "unit", "estimate", "prior", *(f"batch {k}" for k, _ in shown)]
    if campaign.targets:
        header.append("target    ")
    rows = []
    for name in names:
        row = [name, units[name], f"{campaign.estimate[name]:#.5g}", *(percent(column[name]) for column in columns)]
        if campaign.targets:
            target = campaign.targets.get(name)
            row.append("" if target is None else f"{percent(target)} {'met' if campaign.met[name] else '   '}")
        rows.append(row)
    so_far = f"{_count(len(history), 'batch', 'batches')}, {_count(points, 'point')} measured"
    lines = [
        f"Campaign on {campaign.problem.model.name}: {so_far}",
        "Relative standard errors, shares of the estimate",
        *_aligned([header, *rows]),
        *_goodness(campaign),
        _stage(campaign),
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


def _goodness(campaign: Campaign) -> list[str]:
    """Whether the model describes the data, where the noise is known; what the estimate lacks."""
    if not campaign.history:
        return []
    last, lines = campaign.history[-1], []
    if campaign.problem.noise_std is not None and last.degrees_of_freedom > 1e-9:
        from scipy.stats import chi2

        chance = float(chi2.sf(last.chi_square, last.degrees_of_freedom))
        verdict = "" if chance > 0.001 else ": the model or the noise is wrong"
        lines.append(
            f"Chi-square {last.chi_square:.4g} of {last.degrees_of_freedom:.4g} degrees of freedom (p = {chance:.2g}){verdict}"
        )
    if not last.converged:
        lines.append("The last estimate is not a minimum: its standard errors mean little")
    return lines


def _stage(campaign: Campaign) -> str:
    lacking = [name for name, met in campaign.met.items() if not met]
    if campaign.done:
        return "All targets are met"
    number = len(campaign.history) + 1
    planned = "is to be designed" if campaign.planned is None else f"is to be measured: {_count(len(campaign.planned), 'point')}"
    missed = f"; above target: {', '.join(lacking)}" if campaign.history and lacking else ""
    return f"Batch {number} {planned}{missed}"


def _count(number: int, one: str, many: str | None = None) -> str:
    return f"{number} {one if number == 1 else many or one + 's'}"
