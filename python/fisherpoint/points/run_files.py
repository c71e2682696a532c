"""Files of runs: one row per segment, as an operator reads them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..basics.checks import check_alike, check_type
from ..basics.csv_file import csv_text
from ..basics.messages import listed, shown
from ..basics.quantity import DURATION, Quantity, names_of
from ..basics.table import DataTable
from ..basics.values import Array, FrozenMapping
from ..models import Model
from .experiments import columns_of, place_names
from .rest import Rest, Rests
from .run_checks import check_period
from .sample_clock import SampleClock
from .sampling import Holds, divided, holds_of, segments_of

RUN, SEGMENT = Quantity("run", "1", "number of a run, from 1"), Quantity("segment", "1", "number of a segment of it, from 1")
MEASURED = Quantity("measured", "1", "whether the outputs are measured at the segment's end")
REST, ALL = "rest", "all"
"""The column that names the states that are at rest at the start, and what stands there for all; `rest_u` has the input u."""
EVERY = Quantity("sample_every", "s", "period at which the outputs are measured instead, up to the end of the run")
"""With the name of an output behind, as `sample_every_q` and `measured_q`, a column is of that output alone."""
TIMES = "t", "time", "time_of_sample"
"""Names of a column of times: the first that is no input of the model is used."""

HOLD, SOLVE = "rest_hold", "rest_solve"
"""Columns that name the states that rest where x0 says, and the inputs that keep the plant there; `rest_y_q` has the output q."""

BEFORE = "before"
"""What columns of inputs before the start begin with: `before_u` has the input u."""

NOTHING: Mapping[str, Any] = FrozenMapping({})


class RunArrays(Protocol):
    """The part of `Runs` that a file has; these stand above this module."""

    x0: Array
    u: Array
    dt: Array
    measured: NDArray[np.bool_]
    by_output: NDArray[np.bool_] | None
    rests: Rests | None
    before: Array | None
    columns: tuple[str, ...] | None

    @property
    def readings(self) -> NDArray[np.bool_]: ...


def runs_csv(
    runs: RunArrays, model: Model | None, outputs: Mapping[str, Array] = NOTHING, labels: Mapping[str, Sequence[str]] = NOTHING
) -> str:
    """The text of a file of runs, see `Runs.to_csv`, with columns of outputs (K, N), and of labels of the runs, behind."""
    columns, rests, n_x, n_u = runs.columns, runs.rests, runs.x0.shape[1], runs.u.shape[2]
    as_it_is = Holds(runs.u, runs.dt, runs.measured, np.full((len(runs.dt), 1), np.nan))
    held = as_it_is if outputs else holds_of(runs.u, runs.dt, runs.readings)
    if model is None and runs.by_output is not None:
        raise ValueError("model: expected the model, whose outputs are measured at different instants, given none")
    if model is not None:
        check_type(model, Model, "model")
        check_alike([(len(model.states), len(model.inputs)), (n_x, n_u)], "states and inputs", "model")
        columns = columns_of(model)
    names = columns or place_names(n_x, n_u)
    k, n = np.nonzero(held.dt)
    starts = np.where((n == 0)[:, None], runs.x0[k], np.nan)
    numbers = np.column_stack([starts, held.u[k, n], held.dt[k, n]]).tolist()
    behind = np.column_stack([np.empty((len(k), 0)), *(values[k, n] for values in outputs.values())]).tolist()
    rows: list[list[Any]] = [
        [str(run + 1), str(segment + 1), *row, str(int(held.measured[run, segment]))]
        for run, segment, row in zip(k.tolist(), n.tolist(), numbers, strict=True)
    ]
    header = (RUN.name, SEGMENT.name, *names, DURATION.name, MEASURED.name)
    of_outputs = () if model is None else names_of(model.outputs)
    if runs.by_output is not None and not held.dense.all():
        header = (*header, *(f"{MEASURED.name}_{name}" for name in of_outputs))
        for row, run, segment in zip(rows, k.tolist(), n.tolist(), strict=True):
            flags = runs.by_output[run, segment].tolist()
            row += [""] * len(flags) if held.dense[run] else [str(int(flag)) for flag in flags]
    if held.dense.any():
        header = (*header, *periods_in(held, of_outputs))
        for row, run, segment in zip(rows, k.tolist(), n.tolist(), strict=True):
            every = held.every[run] if held.by_output else held.every[run, :1]
            row += every.tolist() if segment == 0 else [np.nan] * len(every)
    if rests is not None:
        inputs, given = names[n_x:], _given_outputs(rests)
        header = (*header, *rest_columns(inputs, given))
        for row, run, segment in zip(rows, k.tolist(), n.tolist(), strict=True):
            row += _rest_cells(rests[run] if segment == 0 else None, inputs, given)
    if runs.before is not None:
        header = (*header, *(f"{BEFORE}_{name}" for name in names[n_x:]))
        for row, run, segment in zip(rows, k.tolist(), n.tolist(), strict=True):
            row += runs.before[run].tolist() if segment == 0 else [np.nan] * n_u
    header = (*header, *outputs, *labels)
    rows = [
        [*row, *further, *(of[run] for of in labels.values())] for row, further, run in zip(rows, behind, k.tolist(), strict=True)
    ]
    if len(set(header)) != len(header):
        taken = listed((RUN.name, SEGMENT.name, DURATION.name, MEASURED.name, *outputs))
        raise ValueError(f"columns: expected names that differ from {taken}; given {listed(names)}")
    return csv_text(header, rows)


def periods_in(held: Holds, outputs: Sequence[str]) -> tuple[str, ...]:
    """The columns of the periods of runs."""
    return tuple(f"{EVERY.name}_{name}" for name in outputs) if held.by_output else (EVERY.name,)


def rest_columns(inputs: Sequence[str], outputs: Sequence[str] | None = None) -> tuple[str, ...]:
    """Columns that a file of runs that start at rest has besides; with given outputs, those of runs that a controller holds."""
    controlled = () if outputs is None else (HOLD, SOLVE, *(f"{REST}_y_{name}" for name in outputs))
    return (REST, *(f"{REST}_{name}" for name in inputs), *controlled)


def _given_outputs(rests: Rests) -> tuple[str, ...] | None:
    """The outputs that are given at some rest; None where no input is solved for at any."""
    controlled = [rest for rest in rests if rest is not None and rest.solve]
    return tuple(dict.fromkeys(name for rest in controlled for name in rest.outputs)) if controlled else None


def _rest_cells(rest: Rest | None, inputs: Sequence[str], outputs: Sequence[str] | None) -> list[Any]:
    if rest is None:
        return ["", *[np.nan] * len(inputs), *([] if outputs is None else ["", "", *[np.nan] * len(outputs)])]
    cells = [ALL if rest.states is None else " ".join(rest.states), *rest.held(tuple(inputs))]
    if outputs is not None:
        cells += [" ".join(rest.hold), " ".join(rest.solve), *(rest.outputs.get(name, np.nan) for name in outputs)]
    return cells


def read_runs(
    table: DataTable, model: Model, ignored: Collection[str] = ()
) -> tuple[Array, Array, Array, NDArray[np.bool_], list[Rest | None] | None, Array | None]:
    """x0, u, dt, measured, rest and inputs before the start of the runs in a table; see `Runs.from_csv`."""
    further, before, flags = rest_columns_of(table, model), before_columns_of(table, model), flag_columns_of(table, model)
    of_outputs = _own_columns(table, model, EVERY.name)
    every = (EVERY.name,) if EVERY.name in table and EVERY.name not in columns_of(model) else ()
    if every and of_outputs:
        raise ValueError(f"{table.path}: expected {EVERY.name} of all outputs or of each, given {listed((*every, *of_outputs))}")
    x0, u, dt, measured = runs_of_table(table, model, (*further, *before, *flags, *every, *of_outputs), ignored)
    columns = dict.fromkeys(every, "") | of_outputs
    measured = flags_of_table(table, model, measured, periodic=bool(columns))
    u, dt, measured = _sampled(table, model, u, dt, measured, columns) if columns else (u, dt, measured)
    return x0, u, dt, measured, rest_of_table(table, model) if further else None, before_of_table(table, model)


def _sampled(
    table: DataTable, model: Model, u: Array, dt: Array, measured: NDArray[np.bool_], columns: Mapping[str, str]
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Runs of a table, those with periods divided at their multiples; `columns` have the output of each, "" of all."""
    outputs, first = names_of(model.outputs), np.diff(table.complete(RUN), prepend=0.0) != 0
    periods = {column: table.numbers(column, EVERY.unit) for column in columns}
    for column, of in periods.items():
        table.refuse(~first & ~np.isnan(of), column, "nothing behind the first row of a run")
        table.refuse(first & (of <= 0), column, "a positive period, or nothing")
    by_output, parts = measured.ndim == 3 or "" not in columns.values(), []
    for k, row in enumerate(np.flatnonzero(first).tolist()):
        n, every = int(np.count_nonzero(dt[k])), {column: float(of[row]) for column, of in periods.items() if not np.isnan(of[row])}
        held, durations, flags = u[k, :n], dt[k, :n], measured[k, :n]
        for column, period in every.items():
            try:
                check_period(period, float(dt[k].sum()), float(dt[k].sum()), column)
            except ValueError as error:
                raise table.error(row, column, str(error).removeprefix(f"{column}: ")) from error
        if every:
            of_outputs = {columns[column]: period for column, period in every.items()}
            clock = SampleClock.of(of_outputs.get("", of_outputs), float(durations.sum()), outputs)
            fine = divided(durations[None], clock.times(clock.counts(durations[None])), clock.every)
            held, durations, flags = held[fine.of[0]], fine.dt[0], clock.readings(fine.measured)[0]
            flags = flags if by_output else flags[:, 0]
        if by_output:
            flags = np.broadcast_to(flags.reshape(len(flags), -1), (len(flags), len(outputs)))
        parts.append((held, durations, flags))
    return segments_of(parts)


def _own_columns(table: DataTable, model: Model, head: str) -> dict[str, str]:
    """Columns of a table that are of an output alone, and the output."""
    columns = {f"{head}_{name}": name for name in names_of(model.outputs)}
    return {column: name for column, name in columns.items() if column in table and column not in columns_of(model)}


def flag_columns_of(table: DataTable, model: Model) -> tuple[str, ...]:
    """The columns that say which outputs are measured; none where a table does not."""
    given = _own_columns(table, model, MEASURED.name)
    for missing in (f"{MEASURED.name}_{name}" for name in names_of(model.outputs) if given and name not in given.values()):
        raise ValueError(f"{table.path}: expected the column {missing} beside {next(iter(given))}, given none")
    return tuple(given)


def flags_of_table(table: DataTable, model: Model, measured: NDArray[np.bool_], periodic: bool = False) -> NDArray[np.bool_]:
    """Which segments are measured (K, N), or which outputs (K, N, n_y), of a table whose runs are known to be in order.

    Where runs may be `periodic` flags of outputs may be left out.
    """
    columns = flag_columns_of(table, model)
    if not columns:
        return measured
    k = table.complete(RUN).astype(int) - 1
    n = table.complete(SEGMENT).astype(int) - 1
    found = np.zeros((*measured.shape, len(columns)), dtype=bool)
    for j, column in enumerate(columns):
        flags = table.numbers(column, "1")
        known = np.isnan(flags) if periodic else np.zeros(len(flags), dtype=bool)
        table.refuse(~known & (flags != 0) & (flags != 1), column, "1 or 0")
        table.refuse((flags == 1) & ~measured[k, n], column, f"no 1 where {MEASURED.name} is 0")
        found[k, n, j] = (flags == 1) | (known & measured[k, n])
    return found


def before_columns_of(table: DataTable, model: Model) -> tuple[str, ...]:
    """The columns in which a table has the inputs before the starts of runs; none where it does not."""
    columns = tuple(f"{BEFORE}_{name}" for name in names_of(model.inputs))
    given = [name for name in columns if name in table and name not in columns_of(model)]
    for missing in (name for name in columns if given and name not in table):
        raise ValueError(f"{table.path}: expected the column {missing} beside {given[0]}, given none")
    return columns if given else ()


def before_of_table(table: DataTable, model: Model) -> Array | None:
    """The inputs before the starts of runs (K, n_u), from a table whose runs are known to be in order."""
    columns, first = before_columns_of(table, model), np.diff(table.complete(RUN), prepend=0.0) != 0
    each = [table.numbers(name, q.unit) for name, q in zip(columns, model.inputs, strict=False)]
    for name, values in zip(columns, each, strict=True):
        table.refuse(~np.isnan(values) & ~first, name, "nothing behind the first row of a run")
        table.refuse(np.isnan(values) & first & ~np.isnan(each[0]), name, "the input before the start, as of the others")
    return np.column_stack(each)[first] if each else None


def rest_columns_of(table: DataTable, model: Model) -> tuple[str, ...]:
    """The columns in which a table says how runs start at rest; none where it does not."""
    if REST not in table or REST in columns_of(model):
        return ()
    given = [name for name in names_of(model.outputs) if f"{REST}_y_{name}" in table]
    controlled = HOLD in table or SOLVE in table or given
    further = rest_columns(names_of(model.inputs), given if controlled else None)
    for missing in (name for name in further if name not in table):
        raise ValueError(f"{table.path}: expected the column {missing} beside {REST}, given none")
    return further


def rest_of_table(table: DataTable, model: Model) -> list[Rest | None]:
    """How each run starts at rest, from a table that says so and whose runs are known to be in order."""
    run, texts = table.complete(RUN), table.texts(REST)
    first, states, inputs = np.diff(run, prepend=0.0) != 0, names_of(model.states), names_of(model.inputs)
    held = {q.name: table.numbers(f"{REST}_{q.name}", q.unit) for q in model.inputs}
    given = {q.name: table.numbers(name, q.unit) for q in model.outputs if (name := f"{REST}_y_{q.name}") in table}
    lists = {REST: (texts, (*states, ALL))}
    lists |= {name: (table.texts(name), known) for name, known in ((HOLD, states), (SOLVE, inputs)) if name in table}
    at_rest = np.array([bool(text) for text in texts])
    table.refuse(at_rest & ~first, REST, "nothing behind the first row of a run")
    solved = {name: np.array([name in text.split() for text in lists[SOLVE][0]]) if SOLVE in lists else ~at_rest for name in inputs}
    for name, values in held.items():
        table.refuse(at_rest & ~solved[name] & np.isnan(values), f"{REST}_{name}", "the held input of a run that starts at rest")
    numbers = {**{f"{REST}_{name}": held[name] for name in held}, **{f"{REST}_y_{name}": given[name] for name in given}}
    for column, values in numbers.items():
        table.refuse(~at_rest & ~np.isnan(values), column, "nothing where no run starts at rest")
    found: list[Rest | None] = []
    for row in np.flatnonzero(first).tolist():
        names = {column: of[row].split() for column, (of, _) in lists.items()}
        for column, (_, known) in lists.items():
            for unknown in (name for name in names[column] if name not in known or (name == ALL and len(names[column]) > 1)):
                what = f"{ALL!r} or names of states, {listed(states)}" if column == REST else f"names among {listed(known)}"
                raise table.error(row, column, f"expected {what}; given {shown(unknown)}")
        found.append(_rest_of_row(table, row, names, held, given) if names[REST] else None)
    return found


def _rest_of_row(
    table: DataTable, row: int, names: Mapping[str, list[str]], held: Mapping[str, Array], given: Mapping[str, Array]
) -> Rest:
    u, outputs = ({name: float(of[row]) for name, of in some.items() if not np.isnan(of[row])} for some in (held, given))
    states = None if names[REST] == [ALL] else names[REST]
    try:
        return Rest(u, states=states, hold=names.get(HOLD, ()), outputs=outputs, solve=names.get(SOLVE, ()))
    except ValueError as error:
        raise table.error(row, REST, str(error)) from error


def runs_of_table(
    table: DataTable, model: Model, outputs: Collection[str] = (), ignored: Collection[str] = ()
) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Read the runs of a table that may also have columns of outputs, and `ignored` ones that are not read."""
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
    starts = [np.empty((int(first.sum()), 0))]
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


def time_name(inputs: Sequence[str]) -> str:
    """Name of a column of times beside inputs of these names."""
    return next(name for name in TIMES if name not in inputs)


def plan_csv(runs: RunArrays, model: Model) -> str:
    """The text of a time table: the times of each run at which inputs are set, and whether a sample is taken just before.

    A run's last row is its end, at which the inputs stay as they are. Runs that are sampled densely have a row for each hold alone,
    and the period of the samples, or of those of each output, in their first. The head has units, and numbers ten digits,
    without the rounding of sums: the table is for people and sequencers, and nothing reads it back.
    """
    timed = (Quantity(time_name(names_of(model.inputs)), "s"), *model.inputs)
    of, outputs = holds_of(runs.u, runs.dt, runs.readings), names_of(model.outputs)
    periodic, apart = bool(of.dense.any()), runs.by_output is not None and not of.dense.all()
    header = (RUN.name, *(q.name if q.unit in ("", "1") else f"{q.name} [{q.unit}]" for q in timed), "measure")
    header = (*header, *(f"measure {name}" for name in outputs)) if apart else header
    header = (*header, *(f"{name} [{EVERY.unit}]" for name in periods_in(of, outputs))) if periodic else header
    rows: list[list[Any]] = []
    for k, dt in enumerate(of.dt):
        n = int(np.count_nonzero(dt))
        t = np.concatenate([[0.0], np.cumsum(dt[:n])])
        held = np.concatenate([of.u[k, :n], of.u[k, n - 1 : n]])
        flags = np.concatenate([[False], of.measured[k, :n]])
        own = [
            [str(k + 1), *(f"{value:.10g}" for value in (time, *values)), "yes" if flag else "no"]
            for time, values, flag in zip(t.tolist(), held.tolist(), flags.tolist(), strict=True)
        ]
        if apart:
            known = np.full((n + 1, len(outputs)), "no", dtype=object)
            known[1:] = "" if of.dense[k] else np.where(runs.readings[k, :n], "yes", "no")
            own = [[*row, *words] for row, words in zip(own, known.tolist(), strict=True)]
        if periodic:
            every = of.every[k] if of.by_output else of.every[k, :1]
            periods = ["" if np.isnan(period) else f"{period:.10g}" for period in every]
            own = [[*row, *(periods if place == 0 else [""] * len(periods))] for place, row in enumerate(own)]
        rows += own
    return csv_text(header, rows)
