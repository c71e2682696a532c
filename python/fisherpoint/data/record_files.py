"""Tables of records: the times, the inputs, the measured outputs and the known starts, checked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..basics.messages import listed
from ..basics.quantity import Quantity, names_of
from ..basics.table import DataTable
from ..basics.values import Array
from ..models import Model
from ..points.run_files import BEFORE, time_name
from .labels import label_columns, labels_of_table


def read_record(
    table: DataTable, model: Model, labels: Sequence[str] | None = None
) -> tuple[Array, Array, Array, dict[str, float], Array | None, dict[str, str]]:
    """t (N,), u (N, n_u), y (N, n_y), the known starts, the inputs before and the labels of a table of `model`.

    See `Record.from_table`.
    """
    states, inputs, outputs = (names_of(some) for some in (model.states, model.inputs, model.outputs))
    taken = (*states, *inputs, *outputs, *(f"y_{name}" for name in outputs), *(f"x0_{name}" for name in states))
    of_labels = label_columns(labels, (time_name(inputs), *taken, *(f"{BEFORE}_{name}" for name in inputs)))
    time, columns, starts, before = _columns(table, model, of_labels)
    table.warn_of_cut_off()
    table.read_decimal_commas((time, *names_of(model.inputs), *columns.values(), *starts.values(), *before.values()))
    t = table.times(time)
    table.refuse(np.diff(t, prepend=-np.inf) <= 0, time, "a time after that of the row before")
    u = np.column_stack([np.empty((len(table), 0)), *(table.complete(quantity) for quantity in model.inputs)])
    y = np.full((len(table), len(model.outputs)), np.nan)
    for i, quantity in enumerate(model.outputs):
        if quantity.name in columns:
            y[:, i] = table.numbers(columns[quantity.name], quantity.unit)
    known = _first_numbers(table, model.inputs, before)
    if known and len(known) < len(model.inputs):
        raise ValueError(f"{table.path}: expected all inputs before the first sample, given {listed(known)}")
    found = labels_of_table(table, of_labels, np.arange(len(table)) == 0)
    of_table = {name: first for name, (first,) in found.items()}
    return t, u, y, _first_numbers(table, model.states, starts), np.array(list(known.values())) if known else None, of_table


def _columns(table: DataTable, model: Model, labels: Sequence[str]) -> tuple[str, dict[str, str], dict[str, str], dict[str, str]]:
    """The columns of the times, of measured outputs, of starts by state, and of inputs before, after a check of all columns."""
    time, inputs, outputs = time_name(names_of(model.inputs)), names_of(model.inputs), names_of(model.outputs)
    starts = {name: f"x0_{name}" for name in names_of(model.states) if f"x0_{name}" in table and f"x0_{name}" not in inputs}
    before = {name: f"{BEFORE}_{name}" for name in inputs if f"{BEFORE}_{name}" in table and f"{BEFORE}_{name}" not in inputs}
    needed = (time, *inputs)
    taken = {*needed, *names_of(model.states), *starts.values(), *before.values()}
    choices = {name: [column for column in (f"y_{name}", name) if column in table and column not in taken] for name in outputs}
    read = {*needed, *labels, *starts.values(), *before.values(), *(column for columns in choices.values() for column in columns)}
    if not set(needed) <= set(table.names) or set(table.names) - read or sorted(map(len, choices.values()))[-1] != 1:
        expected = listed((*needed, *(f"y_{name}" for name in outputs)))
        further = f"; x0_<state>, of {listed(names_of(model.states))}, for known starts" if model.states else ""
        given = f"{listed(table.names)}{table.naming_hint(set(table.names) - read)}"
        raise ValueError(f"{table.path}: expected the columns {expected}, of outputs those measured, once{further}; given {given}")
    return time, {name: columns[0] for name, columns in choices.items() if columns}, starts, before


def _first_numbers(table: DataTable, quantities: Sequence[Quantity], columns: Mapping[str, str]) -> dict[str, float]:
    """Numbers that the first row has; further rows say the same, or nothing."""
    known = {}
    for quantity in quantities:
        if quantity.name in columns:
            column = columns[quantity.name]
            values = table.numbers(column, quantity.unit)
            other = ~np.isnan(values) & (values != values[0])
            table.refuse(other, column, "the start in the first row, and nothing else below it")
            if not np.isnan(values[0]):
                known[quantity.name] = float(values[0])
    return known
