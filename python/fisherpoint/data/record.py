"""A record: one long trajectory under inputs that are held from sample to sample, the classical coherent experiment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from ..basics.checks import as_float, as_floats, as_index, as_rows, by_name, check_known, check_type
from ..basics.csv_table import CsvTable, csv_text
from ..basics.files import write_whole
from ..basics.messages import listed, shown
from ..basics.quantity import Quantity, names_of
from ..basics.values import Array
from ..models import Model
from ..points.run_files import time_name
from ..show.section import Report
from ..show.table_preview import InNotebooks, first_rows, numbered
from .measured_outputs import measured_outputs


@dataclass(frozen=True, eq=False)
class Record(InNotebooks):
    """N samples of one trajectory: y[n] = g(x(t[n]), u[n], theta), with u[n] held from t[n] to t[n+1], and x(t[0]) = x0.

    Parameters
    ----------
    t : array_like, (N,)
        Times of the samples, s, increasing; the steps may differ.
    u : array_like, (N, n_u)
        Inputs in the model's order, SI units; (N,) is taken for a single input.
    y : array_like, (N, n_y)
        Outputs in the model's order, SI units; NaN where an output was not measured. (N,) is taken for a single output.
    x0 : mapping of state name to float, optional
        Start values that are known, SI units. States that are not named are estimated.
    begin : float, optional
        The time at which t of equations is zero, s; default: that of the first sample. Samples that are taken out of a record keep
        that of the whole.

    Raises
    ------
    TypeError
        Where x0 is no mapping.
    ValueError
        For wrong shapes, times that do not increase, numbers that are not finite, or no measured number at all.
    """

    t: Array
    u: Array
    y: Array
    x0: Mapping[str, float] = field(default_factory=dict, kw_only=True)
    begin: float | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        t = checked_times(self.t)
        arrays = {"t": t, "u": held_inputs(self.u, len(t)), "y": measured_outputs(self.y, t.shape)}
        for name, array in arrays.items():
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        object.__setattr__(self, "x0", by_name(self.x0, None, "x0", as_float))
        object.__setattr__(self, "begin", float(t[0]) if self.begin is None else as_float(self.begin, "begin"))

    def __len__(self) -> int:
        return len(self.t)

    def __getitem__(self, samples: slice) -> Record:
        """Return the samples from one to another, without a gap; the start stays known only where the first one is among them."""
        if not isinstance(samples, slice):
            raise TypeError(f"samples: expected a slice, given {shown(samples)}")
        first, last, step = cast(slice, as_index(samples, len(self), "samples")).indices(len(self))
        if step != 1 or not first < last:
            raise ValueError(f"samples: expected a slice of consecutive samples, at least one, given {shown(samples)}")
        x0 = self.x0 if first == 0 else {}
        return Record(self.t[first:last], self.u[first:last], self.y[first:last], x0=x0, begin=self.begin)

    def __repr__(self) -> str:
        measured = int(np.isfinite(self.y).sum())
        sizes = f"{self.u.shape[1]} inputs, {self.y.shape[1]} outputs, {measured} of {self.y.size} numbers"
        return (
            f"Record({len(self)} samples over {self.t[-1] - self.t[0]:g} s, {sizes}, known start of {', '.join(self.x0) or 'none'})"
        )

    def _in_notebook(self) -> Report:
        columns = {"t": self.t, **numbered("u", self.u), **numbered("y", self.y)}
        return Report(repr(self), [first_rows(len(self), columns)])

    @property
    def since(self) -> Array:
        """The times of the samples as equations read them, (N,), s."""
        return np.asarray(self.t - (self.begin or 0.0))

    @property
    def samples(self) -> Array:
        """Outputs (N, n_y) with a row for each sample, as y."""
        return self.y

    def check(self, model: Model) -> None:
        """Raise unless inputs, outputs and the known start are those of `model`."""
        check_type(model, Model, "model")
        for name, array, quantities in (("u", self.u, model.inputs), ("y", self.y, model.outputs)):
            if array.shape[1] != len(quantities):
                raise ValueError(
                    f"{name}: expected {len(quantities)} columns, {listed(names_of(quantities))}; given {array.shape[1]}"
                )
        check_known(self.x0, names_of(model.states), "x0", "names of states,")

    def to_csv(self, path: str | Path, model: Model) -> None:
        """Write one row per sample: t, the inputs, and the outputs as ``y_<name>``, empty where not measured.

        Known starts stand in the first row, as ``x0_<name>``. Where an input of the model is called t, the column of the times is
        called ``time``.
        """
        self.check(model)
        outputs, starts = (f"y_{name}" for name in names_of(model.outputs)), (f"x0_{name}" for name in self.x0)
        header = (time_name(names_of(model.inputs)), *names_of(model.inputs), *outputs, *starts)
        if len(set(header)) != len(header):
            raise ValueError(f"model: expected inputs other than y_<output> and x0_<state>, given {listed(names_of(model.inputs))}")
        x0 = np.full((len(self), len(self.x0)), np.nan)
        x0[0] = list(self.x0.values())
        write_whole(path, csv_text(header, np.column_stack([self.t, self.u, self.y, x0]).tolist()))

    @classmethod
    def from_csv(cls, path: str | Path, model: Model, *, x0: Mapping[str, float] | None = None) -> Record:
        """Read a record of `model` from a file with the columns t, its inputs, its measured outputs, and its known starts.

        Parameters
        ----------
        path : str or Path
            The column of an output is called ``y_<name>``, or as the output where no state or input has that name. Outputs may
            be left out, or single entries empty: these were not measured. Columns ``x0_<state>`` have known starts in the first
            row; further rows are empty or repeat it, and an empty first row says that the start is not known. Units in the
            header, as in ``u [mV]``, are converted. Where an input of the model is called t, the time is the column ``time``.
        model : Model
        x0 : mapping of state name to float, optional
            Start values that are known, SI units; they count instead of those of the file.

        Raises
        ------
        OSError
            Where the file cannot be read.
        ValueError
            Where a column is missing or unknown, or an entry is no number; the message names row and column.
        """
        check_type(model, Model, "model")
        table = CsvTable(path)
        table.warn_of_cut_off()
        time, columns, starts = _columns(table, model)
        table.read_decimal_commas((time, *names_of(model.inputs), *columns.values(), *starts.values()))
        t = table.complete(Quantity(time, "s"))
        table.refuse(np.diff(t, prepend=-np.inf) <= 0, time, "a time after that of the row before")
        u = np.column_stack([np.empty((len(table), 0)), *(table.complete(quantity) for quantity in model.inputs)])
        y = np.full((len(table), len(model.outputs)), np.nan)
        for i, quantity in enumerate(model.outputs):
            if quantity.name in columns:
                y[:, i] = table.numbers(columns[quantity.name], quantity.unit)
        try:
            record = cls(t, u, y, x0={**_starts(table, model, starts), **by_name({} if x0 is None else x0, None, "x0", as_float)})
        except ValueError as error:
            raise ValueError(f"{table.path}: {error}") from error
        record.check(model)
        return record


def checked_times(values: ArrayLike) -> Array:
    """Times of samples, increasing."""
    t = as_floats(values, "t")
    if t.ndim != 1 or not len(t):
        raise ValueError(f"t: expected shape (N,), at least one sample, given {t.shape}")
    late = np.flatnonzero(np.diff(t) <= 0)
    if len(late):
        n = int(late[0]) + 1
        raise ValueError(f"t: expected increasing times in s, given {t[n]:g} after {t[n - 1]:g} at sample {n}")
    return t


def held_inputs(values: ArrayLike, count: int) -> Array:
    """Inputs (count, n_u)."""
    return as_rows(as_floats(values, "u"), count, "u", "n_u")


def _columns(table: CsvTable, model: Model) -> tuple[str, dict[str, str], dict[str, str]]:
    """The columns of the times, of each output that was measured, and of starts by state, after a check of all columns."""
    time, inputs, outputs = time_name(names_of(model.inputs)), names_of(model.inputs), names_of(model.outputs)
    starts = {name: f"x0_{name}" for name in names_of(model.states) if f"x0_{name}" in table and f"x0_{name}" not in inputs}
    needed = (time, *inputs)
    taken = {*needed, *names_of(model.states), *starts.values()}
    choices = {name: [column for column in (f"y_{name}", name) if column in table and column not in taken] for name in outputs}
    read = {*needed, *starts.values(), *(column for columns in choices.values() for column in columns)}
    if not set(needed) <= set(table.names) or set(table.names) - read or sorted(map(len, choices.values()))[-1] != 1:
        expected = listed((*needed, *(f"y_{name}" for name in outputs)))
        further = f"; x0_<state>, of {listed(names_of(model.states))}, for known starts" if model.states else ""
        raise ValueError(
            f"{table.path}: expected the columns {expected}, of outputs those measured, once{further}; given {listed(table.names)}"
        )
    return time, {name: columns[0] for name, columns in choices.items() if columns}, starts


def _starts(table: CsvTable, model: Model, columns: Mapping[str, str]) -> dict[str, float]:
    """Starts that the first row has; further rows say the same, or nothing."""
    known = {}
    for state in model.states:
        if state.name in columns:
            column = columns[state.name]
            values = table.numbers(column, state.unit)
            other = ~np.isnan(values) & (values != values[0])
            table.refuse(other, column, "the start in the first row, and nothing else below it")
            if not np.isnan(values[0]):
                known[state.name] = float(values[0])
    return known
