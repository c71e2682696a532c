"""Measured outputs of experiment points and of runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..basics.checks import as_index, as_parts, as_path, check_alike, check_type
from ..basics.files import write_whole
from ..basics.table import as_table
from ..basics.values import Array
from ..models import Model
from ..points.points_or_runs import Points, as_flat, as_runs, joined
from ..points.runs import Runs
from ..show.numbers import counted
from ..show.section import Report
from ..show.table_preview import InNotebooks, beside, first_rows, numbered
from .labels import checked_labels
from .measured_outputs import measured_outputs, refuse_beside_samples, runs_with_outputs
from .measurement_files import measurements_csv, read_measurements


@dataclass(frozen=True, eq=False)
class Measurements(InNotebooks):
    """The outputs that were measured at K experiment points, or in K runs.

    Parameters
    ----------
    points : Experiments or Runs
        The K points, or runs; x0 as measured where it was, else as planned. Replicates are points, or runs, that occur more than
        once.
    y : array_like, (K, n_y), or (K, N, n_y) of runs
        Outputs in the model's order, SI units; NaN where an output was not measured, as at every segment that is not `measured`.
        (K,), or (K, N), is taken for a single output.
    labels : mapping of name to labels, optional
        Of which plant, day or batch each is: K texts or whole numbers, or one for all, such as ``{"plant": ["A", "A", "B"]}``.
        Local parameters have one value for each label.

    Raises
    ------
    TypeError
        Where `points` are neither `Experiments` nor `Runs`.
    ValueError
        For a wrong shape, infinite numbers, a number at a segment that is not measured, or no measured number at all.
    """

    points: Points
    y: Array
    labels: Mapping[str, tuple[str, ...]] = field(default_factory=dict, kw_only=True)

    def __post_init__(self) -> None:
        runs = as_runs(self.points)
        y = measured_outputs(self.y, self.points.dt.shape)
        refuse_beside_samples(runs, y.reshape(*runs.dt.shape, -1))
        y.flags.writeable = False
        object.__setattr__(self, "y", y)
        object.__setattr__(self, "labels", checked_labels(self.labels, len(self.points)))

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, rows: int | slice | Sequence[int] | NDArray[Any]) -> Measurements:
        """Measurements of the chosen points or runs; at least one must have a number."""
        chosen = as_index(rows, len(self), "data")
        return Measurements(self.points[chosen], self.y[chosen], labels=self._labels_of(chosen))

    def _labels_of(self, rows: slice | NDArray[Any]) -> dict[str, tuple[str, ...]]:
        return {name: tuple(np.array(given, dtype=object)[rows]) for name, given in self.labels.items()}

    @property
    def runs(self) -> Runs:
        """The runs; points are runs of one segment."""
        return as_runs(self.points)

    @property
    def run_outputs(self) -> Array:
        """Outputs (K, N, n_y) of `runs`."""
        return self.y.reshape(*self.runs.dt.shape, -1)

    @property
    def samples(self) -> Array:
        """Outputs (S, n_y) with a row for each sample: a point, or a measured segment, run after run."""
        return self.run_outputs[self.runs.measured]

    @property
    def measured_part(self) -> Measurements:
        """The measurements without points and runs that have no number; runs end at their last number."""
        runs, there = self.runs, np.asarray(np.isfinite(self.run_outputs).any(axis=2))
        if np.array_equal(there, runs.measured) and there[np.arange(len(runs)), runs.segments - 1].all():
            return self
        runs, y = runs_with_outputs(runs, self.run_outputs)
        points = as_flat(runs, self.points)
        return Measurements(points, y.reshape(*points.dt.shape, -1), labels=self._labels_of(np.flatnonzero(there.any(axis=1))))

    @staticmethod
    def join(parts: Sequence[Measurements]) -> Measurements:
        """Return all parts, one after the other; points are runs of one segment where runs are among them.

        Labels stay that all parts have.
        """
        parts = as_parts(parts, Measurements)
        sizes = [(part.points.x0.shape[1], part.points.u.shape[-1], part.y.shape[-1]) for part in parts]
        check_alike(sizes, "states, inputs and outputs")
        points = joined([part.points for part in parts])
        segments = as_runs(points).dt.shape[1]
        missing = [((0, 0), (0, segments - part.runs.dt.shape[1]), (0, 0)) for part in parts]
        y = [np.pad(part.run_outputs, by, constant_values=np.nan) for part, by in zip(parts, missing, strict=True)]
        names = [name for name in parts[0].labels if all(name in part.labels for part in parts)]
        labels = {name: tuple(label for part in parts for label in part.labels[name]) for name in names}
        return Measurements(points, np.concatenate(y).reshape(*points.dt.shape, -1), labels=labels)

    def to_csv(self, path: str | Path, model: Model) -> None:
        """Write the design's CSV, or that of the runs, with a column ``y_<output>`` for each output, empty where not measured.

        Every digit is kept, and the file appears whole or not at all. The starts are written as they are, in the states' columns,
        and labels in columns of their names.
        """
        check_type(model, Model, "model")
        write_whole(path, measurements_csv(self.points, self.y, model, self.labels))

    @classmethod
    def from_table(
        cls, table: Any, model: Model, *, columns: Mapping[str, str] | None = None, labels: Sequence[str] | None = None
    ) -> Measurements:
        """Read measurements of `model` from a table: the columns of a design or of runs, and one for each measured output.

        Parameters
        ----------
        table : path, or object with named columns
            A CSV file, such as `to_csv` or a rig writes; or a frame of pandas or polars, a dict of arrays, a dataset of xarray, a
            group of an HDF5 file. Units in brackets in the head of a column, as in ``p_A [bar]``, in a row below the heads, or as
            an attribute `units`, are converted. Entries that are empty, nan or NA were not measured.
        model : Model
        columns : mapping of name to column, optional
            The names of the columns, as ``{"q": "Position", "u": "Valve [%]", "y_p_A": "Druck A"}``; a unit that stands here
            alone counts. What is not named is left out, with a warning that lists it. Rows above the heads are skipped. Default:
            the names are those that follow, and there are no others but those for one's own use.

            States, inputs and ``dt`` are called by their names, an output ``y_<name>``, or its name alone where no state or input
            has that. Outputs may be missing or empty; of points ``x0_<state>`` is a measured start. Columns ``run`` and ``segment``
            distinguish runs from points. See docs/how_to/measurements.md for the format, and for what is refused.
        labels : sequence of str, optional
            Further columns that have labels, beside ``plant`` and ``day``; a run has its label in its first row at least.

        Raises
        ------
        OSError
            Where the file cannot be read.
        TypeError
            For what is neither a path nor has named columns.
        ValueError
            Where it is no whole table of this model, or numbers are none, in wrong units or beyond physics; the message names
            row, 1 for the first, and column.
        """
        check_type(model, Model, "model")
        points, y, of = read_measurements(as_table(table, columns), model, labels)
        return Measurements(points, y, labels=of)

    @classmethod
    def from_csv(cls, path: str | Path, model: Model, *, labels: Sequence[str] | None = None) -> Measurements:
        """Read what `to_csv` wrote: `from_table` of a file with the names of the model."""
        return cls.from_table(as_path(path, "path"), model, labels=labels)

    def __eq__(self, other: object) -> bool:
        same = isinstance(other, Measurements) and self.points == other.points and self.labels == other.labels
        return same and isinstance(other, Measurements) and np.array_equal(self.y, other.y, equal_nan=True)

    __hash__ = None  # type: ignore[assignment]  # arrays

    def _in_notebook(self) -> Report:
        outputs = numbered("y", self.samples)
        if self.points is self.runs:
            run, segment = np.nonzero(self.runs.measured)
            places: dict[str, Any] = {
                "run": list(map(str, run)),
                "segment": list(map(str, segment)),
                "t": self.runs.t[run, segment],
            }
            return Report(repr(self), [first_rows(len(run), {**places, **outputs})])
        (points,) = self.points._in_notebook().sections
        return Report(repr(self), [beside(points, first_rows(len(self), outputs))])

    def __repr__(self) -> str:
        samples = self.samples
        of = counted(len(self), self.points.kind) + (f", {len(samples)} samples" if self.points is self.runs else "")
        return f"Measurements({of}, {samples.shape[1]} outputs, {np.isfinite(samples).sum()} of {samples.size} numbers)"
