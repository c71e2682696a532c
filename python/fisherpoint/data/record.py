"""A record: one long trajectory under inputs that are held from sample to sample, the classical coherent experiment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from ..basics.checks import as_float, as_index, as_path, by_name, check_known, check_type
from ..basics.csv_file import csv_text
from ..basics.files import write_whole
from ..basics.messages import listed, shown
from ..basics.quantity import names_of
from ..basics.table import as_table
from ..basics.values import Array
from ..models import Model
from ..points.run_files import time_name
from ..show.section import Report
from ..show.table_preview import InNotebooks, first_rows, numbered
from .held_inputs import checked_times, held_inputs
from .labels import checked_label, label_columns
from .measured_outputs import measured_outputs
from .merging import merged_channels
from .record_files import read_record


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

    def __post_init__(self) -> None:
        t = checked_times(self.t)
        arrays = {"t": t, "u": held_inputs(self.u, len(t)), "y": measured_outputs(self.y, t.shape)}
        for name, array in arrays.items():
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        object.__setattr__(self, "x0", by_name(self.x0, None, "x0", as_float))
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
        return Record(self.t[first:last], self.u[first:last], self.y[first:last], x0=x0, begin=self.begin, labels=self.labels)

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

        Known starts and labels stand in the first row, as ``x0_<name>`` and by their names. Where an input of the model is called
        t, the column of the times is called ``time``.
        """
        self.check(model)
        outputs, starts = (f"y_{name}" for name in names_of(model.outputs)), (f"x0_{name}" for name in self.x0)
        header = (time_name(names_of(model.inputs)), *names_of(model.inputs), *outputs, *starts)
        if len(set(header)) != len(header):
            raise ValueError(f"model: expected inputs other than y_<output> and x0_<state>, given {listed(names_of(model.inputs))}")
        x0 = np.full((len(self), len(self.x0)), np.nan)
        x0[0] = list(self.x0.values())
        rows = np.column_stack([self.t, self.u, self.y, x0]).tolist()
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
            the first row; further rows are empty or repeat it, and an empty first row says that the start is not known.
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
        t, u, y, known, of = read_record(table, model, labels)
        try:
            record = cls(t, u, y, x0={**known, **by_name({} if x0 is None else x0, None, "x0", as_float)}, labels=of)
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
