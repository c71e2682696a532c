"""Files of measurements: the design's CSV with a column for each measured output, checked before anything is estimated from them.

A file with the columns ``run`` and ``segment``, where no state or input is called so, is one of runs: that of `Runs.to_csv`, with
the same columns of outputs and of bookkeeping. Others are of points:

=================  ===================================================================================================
column             entry
=================  ===================================================================================================
``q``              a state's name: planned start. It may be missing, or empty, where ``x0_q`` is there
``x0_q``           measured start, which counts instead of the planned one; empty: as planned
``u``, ``dt``      the inputs and the duration
``y_q``            an output; empty or nan: not measured. Also ``q``, where no state or input has that name
``status``         as `fisherpoint simulate` writes it: a row that is not ok has no outputs
``plant``, ``day``  labels: the plant and the day of the row; of a run, in its first row at least
``comment`` ...    `BOOKKEEPING`, not read
=================  ===================================================================================================
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from ..basics.csv_file import csv_text
from ..basics.messages import listed
from ..basics.quantity import DURATION, names_of
from ..basics.table import DataTable
from ..basics.values import Array, FrozenMapping
from ..models import Model
from ..points.experiments import BOOKKEEPING, Experiments, columns_of
from ..points.points_or_runs import Points, as_runs
from ..points.run_files import (
    MEASURED,
    REST,
    RUN,
    SEGMENT,
    before_columns_of,
    before_of_table,
    flag_columns_of,
    flags_of_table,
    rest_columns,
    rest_columns_of,
    rest_of_table,
    runs_csv,
    runs_of_table,
    time_name,
)
from ..points.runs import Runs
from ..points.status import Status
from .labels import label_columns, labels_of_table
from .plausibility import refuse_implausible


def measurements_csv(points: Points, y: Array, model: Model, labels: Mapping[str, Sequence[str]] = FrozenMapping({})) -> str:
    """The text of a file of measurements; every digit is kept, and what was not measured is an empty entry."""
    label_columns(labels, column_names(model))
    axes, outputs = names_of(model.axes), [f"y_{name}" for name in names_of(model.outputs)]
    given = (points.x0.shape[1], points.u.shape[-1], y.shape[-1])
    expected = (len(model.states), len(model.inputs), len(model.outputs))
    if given != expected:
        raise ValueError(f"model: expected one of {given} states, inputs and outputs, given {model.name} of {expected}")
    runs = as_runs(points)
    if points is runs:
        of_segments = {name: y[:, :, i] for i, name in enumerate(outputs)}
        return runs_csv(runs, model, of_segments, labels)
    header = (*axes, *outputs, *labels)
    if len(set(header)) != len(header):
        raise ValueError(f"model: expected names that differ from y_<output>, given {listed(axes)}")
    rows = np.column_stack([runs.starts.table[:, : len(axes)], y]).tolist()
    return csv_text(header, [[*row, *(given[k] for given in labels.values())] for k, row in enumerate(rows)])


def read_measurements(
    table: DataTable, model: Model, labels: Sequence[str] | None = None
) -> tuple[Points, Array, Mapping[str, tuple[str, ...]]]:
    """Read and check points, or runs, outputs and labels of a table of measurements; see `Measurements.from_table`."""
    table.warn_of_cut_off()
    of_labels = label_columns(labels, column_names(model))
    is_runs = {RUN.name, SEGMENT.name} <= set(table.names) - set(_axes(model))
    return (_runs if is_runs else _points)(table, model, of_labels)


def column_names(model: Model) -> tuple[str, ...]:
    """Names of the columns that tables of records and measurements may have."""
    states, inputs, outputs = (names_of(some) for some in (model.states, model.inputs, model.outputs))
    of_runs = (
        RUN.name,
        SEGMENT.name,
        MEASURED.name,
        *(f"{MEASURED.name}_{name}" for name in outputs),
        *rest_columns(inputs, outputs),
    )
    starts, measured = (f"x0_{name}" for name in states), (f"y_{name}" for name in outputs)
    return tuple(dict.fromkeys((time_name(inputs), *_axes(model), *starts, *outputs, *measured, *of_runs, "status")))


def _points(table: DataTable, model: Model, labels: tuple[str, ...]) -> tuple[Experiments, Array, Mapping[str, tuple[str, ...]]]:
    outputs = _match(table, model, labels)
    starts = {state.name: name for state in model.states if (name := f"x0_{state.name}") in table and name not in _axes(model)}
    table.read_decimal_commas(name for name in table.names if name in {*_axes(model), *starts.values(), *outputs.values()})

    n, nothing = len(table), np.full(len(table), np.nan)
    planned, x0 = np.empty((n, len(model.states))), np.empty((n, len(model.states)))
    for i, state in enumerate(model.states):
        of_plan = table.numbers(state.name, state.unit) if state.name in table else nothing
        measured = table.numbers(starts[state.name], state.unit) if state.name in starts else nothing
        x0[:, i] = np.where(np.isnan(measured), of_plan, measured)
        planned[:, i] = np.where(np.isnan(of_plan), measured, of_plan)
        table.refuse(np.isnan(x0[:, i]), state.name if state.name in table else starts[state.name], "a start value")
    u = np.column_stack([np.empty((n, 0)), *(table.complete(quantity) for quantity in model.inputs)])
    dt = table.complete(DURATION) if "dt" in table else np.ones(n)
    y = _numbers(table, model, outputs, _failed(table))
    points = Experiments(x0, u, dt, columns=columns_of(model))
    _, same = Runs.of_points(points.starting(planned)).distinct()
    refuse_implausible(table, model, outputs, same[:, None], x0, u, y)
    return points, y, labels_of_table(table, labels)


def _runs(table: DataTable, model: Model, labels: tuple[str, ...]) -> tuple[Runs, Array, Mapping[str, tuple[str, ...]]]:
    further = (*rest_columns_of(table, model), *before_columns_of(table, model), *flag_columns_of(table, model))
    outputs = _columns_of_outputs(table, model, {*_axes(model), RUN.name, SEGMENT.name, MEASURED.name, *further})
    x0, u, dt, measured = runs_of_table(table, model, (*outputs.values(), *further), (*BOOKKEEPING, *labels))
    rest = rest_of_table(table, model) if REST in further else None
    if not outputs:
        of_outputs = listed(f"y_{name}" for name in names_of(model.outputs))
        raise ValueError(f"{table.path}: expected of the columns {of_outputs} those that were measured; given none")
    k, n = np.nonzero(dt)
    numbers, readings = _numbers(table, model, outputs, []), flags_of_table(table, model, measured)
    for j, name in enumerate(names_of(model.outputs)):
        if name in outputs:
            flags = readings[k, n] if readings.ndim == 2 else readings[k, n, j]
            column = MEASURED.name if readings.ndim == 2 else f"{MEASURED.name}_{name}"
            table.refuse(~np.isnan(numbers[:, j]) & ~flags, outputs[name], f"no number where {column} is 0")
    try:
        runs = Runs(x0, u, dt, readings, rest=rest, before=before_of_table(table, model), columns=columns_of(model))
    except ValueError as error:
        raise ValueError(f"{table.path}: {error}") from error
    _, same = runs.distinct(sampled_alike=False)
    replicates = np.column_stack([same[k], n])
    refuse_implausible(table, model, outputs, replicates, x0, u[:, 0], numbers, np.flatnonzero(n == 0))
    y = np.full((*dt.shape, numbers.shape[1]), np.nan)
    y[k, n] = numbers
    return runs, y, labels_of_table(table, labels, n == 0)


def _numbers(table: DataTable, model: Model, outputs: Mapping[str, str], failed: list[int]) -> Array:
    """Outputs of the rows, (rows, n_y), NaN where not measured."""
    y = np.full((len(table), len(model.outputs)), np.nan)
    for j, quantity in enumerate(model.outputs):
        if quantity.name in outputs:
            y[:, j] = table.numbers(outputs[quantity.name], quantity.unit)
    y[failed] = np.nan
    if np.isnan(y).all():
        raise ValueError(f"{table.path}: expected at least one measured output, given none in {listed(outputs.values())}")
    return y


def _axes(model: Model) -> tuple[str, ...]:
    """Names that mean states, inputs and dt, whatever else they could mean; dt also where points need none."""
    return (*names_of(model.states), *names_of(model.inputs), "dt")


def _match(table: DataTable, model: Model, labels: tuple[str, ...]) -> dict[str, str]:
    """Return the column of each output that has one, after a check of all columns."""
    axes = _axes(model)
    outputs = _columns_of_outputs(table, model, axes)
    starts = {f"x0_{state}": state for state in names_of(model.states)}
    given = {*table.names, *(state for name, state in starts.items() if name in table)}
    missing = [name for name in names_of(model.axes) if name not in given]
    known = {*axes, *outputs.values(), *starts, *labels, *BOOKKEEPING, "status"}
    unknown = [name for name in table.names if name not in known]
    if missing or unknown or not outputs:
        of_outputs = listed(f"y_{name}" for name in names_of(model.outputs))
        wrong = [f"none for {listed(missing)}"] if missing else []
        wrong += [] if outputs else ["none for an output"]
        wrong += [f"the unknown {listed(unknown)}"] if unknown else []
        another = f": the file of another model than {model.name}" if unknown and (missing or not outputs) else ""
        raise ValueError(
            f"{table.path}: expected the columns {listed(names_of(model.axes))}, and of {of_outputs} those that were measured; "
            f"given {'; '.join(wrong)}{another}{table.naming_hint(unknown)}"
        )
    return outputs


def _columns_of_outputs(table: DataTable, model: Model, taken: Collection[str]) -> dict[str, str]:
    """The column of each output that has one, which is none of those that are taken."""
    outputs: dict[str, str] = {}
    for output in names_of(model.outputs):
        columns = [name for name in (f"y_{output}", output) if name in table and name not in taken]
        if len(columns) > 1:
            raise ValueError(f"{table.path}: expected one column of the output {output}, given {' and '.join(columns)}")
        if columns:
            outputs[output] = columns[0]
    return outputs


def _failed(table: DataTable) -> list[int]:
    """Rows whose status says that they have no outputs."""
    if "status" not in table:
        return []
    texts = table.texts("status")
    known = [status.name for status in Status]
    table.refuse([text not in ("", *known) for text in texts], "status", f"one of {', '.join(known)}, or nothing")
    return [row for row, text in enumerate(texts) if text not in ("", "ok")]
