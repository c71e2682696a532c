"""Local parameters in the report of a fit: their values and spreads as tables, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..show.numbers import counted, digits_of, number, percent
from ..show.section import Section
from .statistics import FitStatistics

MOST_ROWS = 40
"""Values of a local parameter that its table shows."""

STRONG = 0.98
"""Correlation of a value with a common unknown from which on it is pointed out."""


def local_sections(fit: FitStatistics) -> Iterator[Section]:
    """The spreads of local parameters, and a table of the values of each."""
    if fit.spread:
        yield _spreads(fit)
    for name, values in fit.local.items():
        if not values:
            continue
        rows, marked = [], []
        for k, one in enumerate(list(values.values())[:MOST_ROWS]):
            full = f"{name}[{one.group}]"
            digits = digits_of(one.estimate, one.standard_error)
            if not np.isfinite(one.standard_error):
                marked.append(k)
            if full in fit.at_bounds:
                rows.append((one.group, number(one.estimate, digits), "at its bound", "-", "-"))
                continue
            share = percent(one.standard_error / abs(one.estimate)) if one.estimate else "-"
            low, high = (number(end, min(digits, 6)) for end in one.interval)
            rows.append((one.group, number(one.estimate, digits), number(one.standard_error, 3), share, f"{low} to {high}"))
        more = len(values) - MOST_ROWS
        notes = [f"and {more} more: Fit.local, local.csv and fit.json have all"] if more > 0 else []
        by, unit = fit.weighted.observed.local.local[name].by, fit.units[f"{name}[{next(iter(values))}]"]
        columns = (by, "estimate", "std error", "RSE", "95 % interval")
        yield Section(f"{name} of each {by}" + (f", {unit}" if unit != "1" else ""), columns, tuple(rows), tuple(marked), notes)


def _spreads(fit: FitStatistics) -> Section:
    rows = []
    for name, one in fit.spread.items():
        estimated = one.interval is not None and one.standard_error is not None
        error = number(one.standard_error, 3) if one.standard_error is not None and np.isfinite(one.standard_error) else "-"
        interval = "-" if one.interval is None else f"{number(one.interval[0], 3)} to {number(one.interval[1], 3)}"
        rows.append((name, fit.weighted.observed.local.local[name].by, number(one.std), error if estimated else "given", interval))
    return Section(
        "Spread of local parameters, one std", ("parameter", "between", "spread", "std error", "95 % interval"), tuple(rows)
    )


def local_findings(fit: FitStatistics) -> Iterator[str]:
    """What is wrong with local parameters, each as a sentence."""
    local, common = fit.weighted.observed.local, len(fit.common)
    for name, one in fit.spread.items():
        if one.nothing and one.interval is not None:
            groups = f"{local.local[name].by}s"
            yield f"{name}: no spread between the {groups} is found, at most {number(one.interval[1], 3)}: they may share one value"
    between = np.abs(fit.correlation[:common, common:])
    for name in (name for name in local.local if name not in fit.spread):  # a spread keeps values near their mean
        places = local.of_parameter(name)
        for i in np.flatnonzero((between[:, places] > STRONG).any(axis=1)) if len(places) else ():
            strong = between[i, places]
            of = counted(int((strong > STRONG).sum()), "group")
            yield (
                f"{fit.common[i]} and {name} cannot be separated in {of}: their correlation is up to {strong.max():.3f}; "
                "a spread between the groups would help"
            )
