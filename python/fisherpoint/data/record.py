"""A record: one long trajectory under inputs that are held from sample to sample, the classical coherent experiment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from ..basics.checks import as_float, as_floats, as_index, as_path, by_name, check_known, check_type
from ..basics.csv_file import csv_text
from ..basics.files import write_whole
from ..basics.messages import listed, shown
from ..basics.quantity import names_of
from ..basics.table import as_table
from ..basics.values import Array
from ..models import Model
from ..points.run_files import BEFORE, time_name
from ..points.schedule import Earlier
from ..show.section import Report
from ..show.table_preview import InNotebooks, first_rows, numbered
from .held_inputs import checked_times, held_inputs
from .labels import checked_label, label_columns
from .measured_outputs import measured_outputs
from .merging import merged_channels
from .record_files import read_record
from .record_trajectory import RecordInputs


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
    labels : mapping of name to label, optional
        Of which plant, day or batch it is, such as ``{"plant": "A"}``. Local parameters have one value for each label.
    before : array_like, (n_u,), or (H, 1 + n_u), optional
        Inputs before the first sample, SI units, which equations with a dead time still read at first, see
        `fisherpoint.math.delay`; or rows of a time, s, and the inputs from then on, of which the first has those before it as well.
        Default: those of the first sample. Samples that are taken out of a record know what came before them.

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
    labels: Mapping[str, str] = field(default_factory=dict, kw_only=True)
    before: Array | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        t = checked_times(self.t)
        arrays = {"t": t, "u": held_inputs(self.u, len(t)), "y": measured_outputs(self.y, t.shape)}
        for name, array in arrays.items():
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        object.__setattr__(self, "x0", by_name(self.x0, None, "x0", as_float))
        if self.before is not None:
            object.__setattr__(self, "before", _inputs_before(self.before, t[0], self.u.shape[1]))
        object.__setattr__(self, "begin", float(t[0]) if self.begin is None else as_float(self.begin, "begin"))
        object.__setattr__(self, "labels", by_name(self.labels, None, "labels", checked_label))

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
        before = np.concatenate([self._rows_before, np.column_stack([self.t, self.u])[:first]]) if first else self.before
        t, u, y = (of[first:last] for of in (self.t, self.u, self.y))
        return Record(t, u, y, x0=x0, begin=self.begin, before=before, labels=self.labels)

    @property
    def _rows_before(self) -> Array:
        """Rows of times and inputs before the first sample; the time of a single input does not count."""
        if self.before is None or self.before.ndim == 2:
            return np.empty((0, 1 + self.u.shape[1])) if self.before is None else self.before
        return np.array([[self.t[0] - 1.0, *self.before]])

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
    def inputs(self) -> RecordInputs:
        """The inputs over the time, with what they were before."""
        rows = self._rows_before
        if not len(rows):
            return RecordInputs(self.since, self.u, self.u[0])
        return RecordInputs(self.since, self.u, rows[0, 1:], Earlier(rows[:, 0] - self.t[0], rows[:, 1:]))

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

        Known starts and labels stand in the first row, as ``x0_<name>`` and by their names, and so do inputs before it, as
        ``before_<name>``. Where an input of the model is called t, the column of the times is called ``time``.
        """
        self.check(model)
        inputs = names_of(model.inputs)
        outputs, starts = (f"y_{name}" for name in names_of(model.outputs)), (f"x0_{name}" for name in self.x0)
        if model.delays and self.before is not None and self.before.ndim == 2:
            raise ValueError(
                "before: expected one input before the record, given several: write the whole record, not a part of it"
            )
        known = self.before if self.before is not None and self.before.ndim == 1 else None
        before = [] if known is None else [f"{BEFORE}_{name}" for name in inputs]
        header = (time_name(inputs), *inputs, *outputs, *starts, *before)
        if len(set(header)) != len(header):
            raise ValueError(f"model: expected inputs other than y_<output>, x0_<state> and before_<input>, given {listed(inputs)}")
        first = np.full((len(self), len(self.x0) + len(before)), np.nan)
        first[0] = [*self.x0.values(), *(() if known is None else known)]
        rows = np.column_stack([self.t, self.u, self.y, first]).tolist()
        names = label_columns(self.labels, (*header, *names_of(model.states)))
        labels = [self.labels[name] for name in names if name in self.labels]
        of_rows = [[*row, *(labels if k == 0 else [""] * len(labels))] for k, row in enumerate(rows)]
        write_whole(path, csv_text((*header, *(name for name in names if name in self.labels)), of_rows))

    @classmethod
    def from_table(
        cls,
        table: Any,
        model: Model,
        *,
        columns: Mapping[str, str] | None = None,
        x0: Mapping[str, float] | None = None,
        labels: Sequence[str] | None = None,
    ) -> Record:
        """Read a record of `model` from a table with the times, the inputs, the measured outputs, and the known starts.

        Parameters
        ----------
        table : path, or object with named columns
            A CSV file, such as `to_csv` or a logger writes; or a frame of pandas or polars, a dict of arrays, a dataset of xarray,
            a group of an HDF5 file. Units in brackets in the head of a column, as in ``u [mV]``, in a row below the heads, or as
            an attribute `units`, are converted. Entries that are empty, nan or NA were not measured. Times are in s, or dates and
            times of day, which become seconds from the first.
        model : Model
        columns : mapping of name to column, optional
            The names of the columns, as ``{"t": "Time", "u": "Spannung [mV]", "level": "Pegel"}``; a unit that stands here alone
            counts. What is not named is left out, with a warning that lists it. Rows above the heads are skipped. Default: the
            names are those that follow, and there are no others.

            The times are ``t``, or ``time`` where an input of the model is called t; an output is ``y_<name>``, or its name alone
            where no state or input has that. Outputs may be left out: these were not measured. ``x0_<state>`` has a known start in
            the first row; further rows are empty or repeat it, and an empty first row says that the start is not known. So has
            ``before_<input>`` the input before the first sample, of all inputs or of none.
        x0 : mapping of state name to float, optional
            Start values that are known, SI units; they count instead of those of the table.
        labels : sequence of str, optional
            Further columns that have a label in the first row, beside ``plant`` and ``day``.

        Raises
        ------
        OSError
            Where the file cannot be read.
        TypeError
            For what is neither a path nor has named columns.
        ValueError
            Where a column is missing or unknown, or an entry is no number; the message names row, 1 for the first, and column.
        """
        check_type(model, Model, "model")
        table = as_table(table, columns)
        t, u, y, known, before, of = read_record(table, model, labels)
        try:
            starts = {**known, **by_name({} if x0 is None else x0, None, "x0", as_float)}
            record = cls(t, u, y, x0=starts, before=before, labels=of)
        except ValueError as error:
            raise ValueError(f"{table.path}: {error}") from error
        record.check(model)
        return record

    @classmethod
    def from_csv(
        cls, path: str | Path, model: Model, *, x0: Mapping[str, float] | None = None, labels: Sequence[str] | None = None
    ) -> Record:
        """Read what `to_csv` wrote: `from_table` of a file with the names of the model."""
        return cls.from_table(as_path(path, "path"), model, x0=x0, labels=labels)

    @classmethod
    def merged(
        cls,
        channels: Mapping[str, tuple[ArrayLike, ArrayLike]],
        model: Model,
        *,
        x0: Mapping[str, float] | None = None,
    ) -> Record:
        """Return the record of channels that were sampled at different times.

        A sample is where any channel has one. An input is held from each of its samples to its next one, and an output is
        measured at its own samples alone. The record begins where all inputs are known.

        Parameters
        ----------
        channels : mapping of name to (t, values)
            All inputs and the measured outputs: times (n,), s, increasing, or dates as `datetime64` in all channels, and numbers
            (n,) in the model's units. Samples that are NaN are none. An output may be called ``y_<name>``, and is where an input
            has that name.
        model : Model
        x0 : mapping of state name to float, optional
            Start values that are known, SI units.

        Returns
        -------
        Record
            Its times are those of the channels, of dates the seconds since the first of all.

        Raises
        ------
        ValueError
            For an input that is missing, an unknown name, times that do not increase, or no measured number behind the first
            samples of all inputs.
        """
        check_type(model, Model, "model")
        record = cls(*merged_channels(channels, model), x0={} if x0 is None else x0)
        record.check(model)
        return record


def _inputs_before(given: ArrayLike, start: float, inputs: int) -> Array:
    """Inputs before the first sample (n_u,), or rows of times and inputs (H, 1 + n_u)."""
    before = as_floats(given, "before")
    if before.shape != (inputs,) and (before.ndim != 2 or before.shape[1] != 1 + inputs or not len(before)):
        raise ValueError(f"before: expected shape ({inputs},) or (H, {1 + inputs}), given {before.shape}")
    if before.ndim == 2 and not (np.diff(checked_times(before[:, 0], "before"), append=start) > 0).all():
        raise ValueError(f"before: expected times before the first sample at {start:g} s, given {before[-1, 0]:g}")
    return before
