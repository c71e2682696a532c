"""Files of runs: one row per segment, as an operator reads them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..basics.checks import check_alike, check_type
from ..basics.csv_table import CsvTable, csv_text
from ..basics.messages import listed, shown
from ..basics.quantity import DURATION, Quantity, names_of
from ..basics.values import Array, FrozenMapping
from ..models import Model
from .experiments import columns_of, place_names
from .rest import Rest, Rests

RUN, SEGMENT = Quantity("run", "1", "number of a run, from 1"), Quantity("segment", "1", "number of a segment of it, from 1")
MEASURED = Quantity("measured", "1", "whether the outputs are measured at the segment's end")
REST, ALL = "rest", "all"
"""The column that names the states that are at rest at the start, and what stands there for all; `rest_u` has the input u."""

NOTHING: Mapping[str, Array] = FrozenMapping({})


class RunArrays(Protocol):
    """What a file has of `Runs`, which stand above this module."""

    x0: Array
    u: Array
    dt: Array
    measured: NDArray[np.bool_]
    rests: Rests | None
    columns: tuple[str, ...] | None


def runs_csv(runs: RunArrays, model: Model | None, outputs: Mapping[str, Array] = NOTHING) -> str:
    """The text of a file of runs, see `Runs.to_csv`, with columns of outputs (K, N) behind."""
    columns, rests, n_x, n_u = runs.columns, runs.rests, runs.x0.shape[1], runs.u.shape[2]
    if model is not None:
        check_type(model, Model, "model")
        check_alike([(len(model.states), len(model.inputs)), (n_x, n_u)], "states and inputs", "model")
        columns = columns_of(model)
    names = columns or place_names(n_x, n_u)
    k, n = np.nonzero(runs.dt)
    starts = np.where((n == 0)[:, None], runs.x0[k], np.nan)
    numbers = np.column_stack([starts, runs.u[k, n], runs.dt[k, n]]).tolist()
    behind = np.column_stack([np.empty((len(k), 0)), *(values[k, n] for values in outputs.values())]).tolist()
    rows: list[list[Any]] = [
        [str(run + 1), str(segment + 1), *row, str(int(runs.measured[run, segment]))]
        for run, segment, row in zip(k.tolist(), n.tolist(), numbers, strict=True)
    ]
    header = (RUN.name, SEGMENT.name, *names, DURATION.name, MEASURED.name)
    if rests is not None:
        header = (*header, *rest_columns(names[n_x:]))
        for row, run, segment in zip(rows, k.tolist(), n.tolist(), strict=True):
            row += _rest_cells(rests[run] if segment == 0 else None, names[n_x:])
    header = (*header, *outputs)
    rows = [[*row, *further] for row, further in zip(rows, behind, strict=True)]
    if len(set(header)) != len(header):
        taken = listed((RUN.name, SEGMENT.name, DURATION.name, MEASURED.name, *outputs))
        raise ValueError(f"columns: expected names that differ from {taken}; given {listed(names)}")
    return csv_text(header, rows)


def rest_columns(inputs: Sequence[str]) -> tuple[str, ...]:
    """Columns that a file of runs that start at rest has besides."""
    return (REST, *(f"{REST}_{name}" for name in inputs))


def _rest_cells(rest: Rest | None, inputs: Sequence[str]) -> list[Any]:
    if rest is None:
        return ["", *[np.nan] * len(inputs)]
    return [ALL if rest.states is None else " ".join(rest.states), *rest.held(tuple(inputs))]


def read_runs(path: str | Path, model: Model) -> tuple[Array, Array, Array, NDArray[np.bool_], list[Rest | None] | None]:
    """x0, u, dt, measured and rest of the runs in a file; see `Runs.from_csv`."""
    table = CsvTable(path)
    further = rest_columns_of(table, model)
    parts = runs_of_table(table, model, further)
    return *parts, rest_of_table(table, model) if further else None


def rest_columns_of(table: CsvTable, model: Model) -> tuple[str, ...]:
    """The columns in which a table says how runs start at rest; none where it does not."""
    if REST not in table or REST in columns_of(model):
        return ()
    further = rest_columns(names_of(model.inputs))
    for missing in (name for name in further if name not in table):
        raise ValueError(f"{table.path}: expected the column {missing} beside {REST}, given none")
    return further


def rest_of_table(table: CsvTable, model: Model) -> list[Rest | None]:
    """How each run starts at rest, of a table that says so and of which the runs are known to be in order."""
    run, texts = table.complete(RUN), table.texts(REST)
    held = {quantity.name: table.numbers(f"{REST}_{quantity.name}", quantity.unit) for quantity in model.inputs}
    first, states = np.diff(run, prepend=0.0) != 0, names_of(model.states)
    told = np.array([bool(text) for text in texts])
    table.refuse(told & ~first, REST, "nothing behind the first row of a run")
    for name, values in held.items():
        table.refuse(told & np.isnan(values), f"{REST}_{name}", "the held input of a run that starts at rest")
        table.refuse(~told & ~np.isnan(values), f"{REST}_{name}", "nothing where no run starts at rest")
    found: list[Rest | None] = []
    for row in np.flatnonzero(first).tolist():
        names = texts[row].split()
        for unknown in (name for name in names if name not in states and names != [ALL]):
            raise table.error(row, REST, f"expected {ALL!r} or names of states, {listed(states)}; given {shown(unknown)}")
        u = {name: float(values[row]) for name, values in held.items()}
        found.append(Rest(u, states=None if names == [ALL] else names) if names else None)
    return found


def runs_of_table(
    table: CsvTable, model: Model, outputs: Collection[str] = (), ignored: Collection[str] = ()
) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """The same of a table that may have columns of outputs besides, and others that are not read."""
    expected = (RUN.name, SEGMENT.name, *columns_of(model), DURATION.name, MEASURED.name)
    if set(table.names) - set(outputs) - (set(ignored) - set(expected)) != set(expected):
        raise ValueError(f"{table.path}: expected the columns {listed(expected)}; given {listed(table.names)}")
    table.read_decimal_commas((*columns_of(model), DURATION.name, *outputs))
    run, segment, flag = (table.complete(quantity) for quantity in (RUN, SEGMENT, MEASURED))
    table.refuse((flag != 0) & (flag != 1), MEASURED.name, "1 or 0")
    first = np.diff(run, prepend=0.0) != 0
    table.refuse(run != np.cumsum(first), RUN.name, "runs in order, from 1 on")
    rows = np.arange(len(run))
    within = rows - np.maximum.accumulate(np.where(first, rows, 0))
    table.refuse(segment != within + 1, SEGMENT.name, "the segments of a run in order, from 1 on")
    starts = []
    for quantity in model.states:
        values = table.numbers(quantity.name, quantity.unit)
        table.refuse(np.isnan(values) & first, quantity.name, "the start in the first row of a run")
        table.refuse(~np.isnan(values) & ~first, quantity.name, "nothing behind the first row of a run")
        starts.append(values[first])
    k, n = run.astype(int) - 1, within
    shape = int(k[-1]) + 1, int(n.max()) + 1
    held = np.column_stack([np.empty((len(k), 0)), *(table.complete(quantity) for quantity in model.inputs)])
    u, dt, measured = np.zeros((*shape, held.shape[1])), np.zeros(shape), np.zeros(shape, dtype=bool)
    u[k, n], dt[k, n], measured[k, n] = held, table.complete(DURATION), flag == 1
    ends = np.bincount(k)
    for short in np.flatnonzero(ends < shape[1]):
        u[short, ends[short] :] = u[short, ends[short] - 1]
    return np.column_stack(starts), u, dt, measured


def plan_csv(runs: RunArrays, model: Model) -> str:
    """The text of a time table: at which time of which run which inputs are set, and whether a sample is taken just before.

    A run's last row is its end, at which the inputs stay as they are.
    """
    header = (RUN.name, "t", *names_of(model.inputs), "measure")
    rows: list[list[Any]] = []
    for k, dt in enumerate(runs.dt):
        n = int(np.count_nonzero(dt))
        t = np.concatenate([[0.0], np.cumsum(dt[:n])])
        held = np.concatenate([runs.u[k, :n], runs.u[k, n - 1 : n]])
        flags = np.concatenate([[False], runs.measured[k, :n]])
        rows += [
            [str(k + 1), time, *values, "yes" if flag else "no"]
            for time, values, flag in zip(t.tolist(), held.tolist(), flags.tolist(), strict=True)
        ]
    return csv_text(header, rows)
