"""Runs as tables: what each of them is, where it starts, and which inputs it holds for how long."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ...basics.messages import listed
from ...basics.quantity import names_of
from ...models import Model
from ...points.runs import Runs
from ...points.sampling import holds_of
from ...show.numbers import number
from ...show.section import Section
from ..results.report import ROWS_OF_PAGES, kept_note

ROWS = 40
"""Runs, and holds of inputs, that are shown of a longer list: results stand behind them."""

WIDTH = 78
"""Characters of a line; tables that are wider are divided."""


def runs_tables(model: Model, runs: Runs, n_kept: int) -> Iterator[Section]:
    """What each run is, where it starts, and what it holds."""
    sampled, samples, of = runs, runs.measured.sum(axis=1), holds_of(runs.u, runs.dt, runs.readings)
    runs = runs.holding(of.u, of.dt, of.measured)
    columns = ["run", "segments", "samples", "duration [s]", *(f"{q.name} [{q.unit}]" for q in model.inputs)]
    rows, starts = [], []
    for k in range(min(len(runs), ROWS)):
        held = runs.u[k, : runs.segments[k]]
        ranges = [
            number(low) if low == high else f"{number(low)} to {number(high)}"
            for low, high in zip(held.min(0), held.max(0), strict=True)
        ]
        sizes = [str(runs.segments[k]), str(int(samples[k])), number(float(runs.dt[k].sum()))]
        rows.append([str(k + 1), *sizes, *ranges])
        starts.append([str(k + 1), *(number(value) for value in runs.x0[k])])
    notes = [f"... and {len(runs) - ROWS} more"] if len(runs) > ROWS else []
    notes += kept_note("Run", n_kept)
    if of.dense.any():
        for j, name in enumerate(names_of(model.outputs) if of.by_output else [""]):
            periods = sorted({one for one in of.every[:, j].tolist() if not np.isnan(one)})
            often = f"every {', '.join(number(one) for one in periods)} s, from the start to the end." if periods else "never."
            notes.append(f"Samples{f' of {name}' if name else ''} are taken {often}")
    else:
        notes.append("A run starts, holds the inputs of each segment, and is sampled at the ends that are measured.")
    if sampled.by_output is not None:
        counts = zip(sampled.by_output.sum(axis=(0, 1)).tolist(), names_of(model.outputs), strict=True)
        notes.append(f"Outputs are measured at samples of their own: {', '.join(f'{name} at {count}' for count, name in counts)}.")
    yield from divided(Section("Runs", columns, rows, notes=notes))
    states = names_of(model.states)
    found = {name for rest in sampled.rest[:ROWS] if rest is not None for name in rest.found(states)}
    guesses = (
        [f"Guesses of {listed(name for name in states if name in found)}: each plant starts at its own rest."] if found else []
    )
    yield from divided(Section("Starts", ["run", *(f"{q.name} [{q.unit}]" for q in model.states)], starts, notes=guesses))
    if model.inputs:
        yield from divided(_held(model, runs, sampled), keys=2)


def _held(model: Model, runs: Runs, sampled: Runs) -> Section:
    """Which inputs are held from when to when, in runs that are `sampled`; segments in a row with the same inputs are one hold."""
    columns = ["run", "segments", "from [s]", "to [s]", *(f"{q.name} [{q.unit}]" for q in model.inputs), "samples"]
    rows: list[list[str]] = []
    ends, more = runs.t, 0
    for k in range(len(runs)):
        n, instants = int(runs.segments[k]), sampled.t[k, sampled.measured[k]]
        near = 0.5 * float(sampled.dt[k, sampled.dt[k] > 0].min())
        changes = np.flatnonzero((np.diff(runs.u[k, :n], axis=0) != 0).any(axis=1)) + 1
        for first, stop in zip([0, *changes.tolist()], [*changes.tolist(), n], strict=True):
            if len(rows) == ROWS:
                more += 1
                continue
            place = str(first + 1) if stop == first + 1 else f"{first + 1} to {stop}"
            times = number(float(ends[k, first] - runs.dt[k, first]), 6), number(float(ends[k, stop - 1]), 6)
            values = (number(value, 6) for value in runs.u[k, first].tolist())
            until = np.array([ends[k, first] - runs.dt[k, first], ends[k, stop - 1]]) + near
            samples = int(np.diff(np.searchsorted(instants, until))[0])
            rows.append([str(k + 1), place, *times, *values, str(samples)])
    notes = [f"... and {more} more; design.csv and plan.csv have all"] if more else []
    return Section("Inputs that are held", columns, rows, notes=notes)


def segments_table(model: Model, runs: Runs, title: str = "Segments of the runs") -> Section:
    """Every segment of every run, up to a number of rows; of densely sampled ones, what they hold."""
    of = holds_of(runs.u, runs.dt, runs.readings)
    runs = runs.holding(of.u, of.dt, of.measured)
    columns = ["run", "segment", "from [s]", *(f"{q.name} [{q.unit}]" for q in model.inputs), "dt [s]", "sample at the end"]
    run, segment = np.nonzero(runs.dt)
    starts = runs.t - runs.dt
    rows = [
        (
            str(k + 1),
            str(n + 1),
            number(float(starts[k, n]), 6),
            *(number(value, 6) for value in runs.u[k, n].tolist()),
            number(float(runs.dt[k, n]), 6),
            "yes" if runs.measured[k, n] else "no",
        )
        for k, n in zip(run[:ROWS_OF_PAGES].tolist(), segment[:ROWS_OF_PAGES].tolist(), strict=True)
    ]
    notes = [f"... and {len(run) - ROWS_OF_PAGES} more"] if len(run) > ROWS_OF_PAGES else []
    return Section(title, columns, rows, notes=notes)


def divided(section: Section, keys: int = 1) -> Iterator[Section]:
    """A table as some that fit into a line, each with the first columns, which say what its rows are about.

    A single column that does not fit beside these stays as it is.
    """
    sizes = [max(len(row[i]) for row in (section.columns, *section.rows)) for i in range(len(section.columns))]
    first = list(range(keys))
    groups: list[list[int]] = [first]
    for place in range(keys, len(sizes)):
        if len(groups[-1]) > keys and sum(sizes[i] + 2 for i in (*groups[-1], place)) > WIDTH:
            groups.append(first)
        groups[-1] = [*groups[-1], place]
    for k, group in enumerate(groups):
        title, notes = section.title if k == 0 else f"{section.title}, continued", section.notes if k == len(groups) - 1 else ()
        rows = [_some(row, group) for row in section.rows]
        yield Section(title, _some(section.columns, group), rows, section.marked, notes)


def _some(row: Sequence[str], places: list[int]) -> list[str]:
    return [row[i] for i in places]
