"""Experiment points E = {x0, u, dt}, eq. (2): start in x0, hold input u, sample the output after dt."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..basics.checks import as_floats, as_index, as_parts, as_path, as_rows, as_sequence, check_alike, check_name, check_type
from ..basics.csv_file import csv_text
from ..basics.files import write_whole
from ..basics.messages import listed, shown
from ..basics.quantity import DURATION, names_of
from ..basics.table import DataTable
from ..basics.values import Array
from ..models import Model
from ..show.section import Report
from ..show.table_preview import InNotebooks, first_rows, numbered

BOOKKEEPING = ("comment", "note", "time", "date", "operator", "run", "point", "replicate", "batch")
"""Columns that a rig's file may have besides, and that are not read."""


class Experiments(InNotebooks):
    """A sequence of K experiment points.

    Parameters
    ----------
    x0 : array_like, (K, n_x)
        Start states, SI units.
    u : array_like, (K, n_u)
        Inputs, held constant; (K,) is taken for a single input.
    dt : array_like, (K,), optional
        Durations, s. Points without a state need none; they get 1.
    columns : tuple of str, optional
        Names of the states and inputs, for files; the model's, where the points come from one.

    Raises
    ------
    ValueError
        For wrong shapes, numbers that are not finite, or a duration that is not positive.
    """

    kind: ClassVar[str] = "point"
    """Word for one of them."""

    def __init__(self, x0: ArrayLike, u: ArrayLike, dt: ArrayLike | None = None, *, columns: tuple[str, ...] | None = None) -> None:
        self.x0, self.u = as_floats(x0, "x0"), as_floats(u, "u")
        if self.x0.ndim != 2:
            raise ValueError(f"x0: expected shape (K, n_x), given {self.x0.shape}")
        count = len(self.x0)
        self.u = as_rows(self.u, count, "u", "n_u")
        if dt is None and self.x0.shape[1]:
            raise ValueError("dt: expected durations in s, given none")
        self.dt = np.ones(count) if dt is None else as_floats(dt, "dt")
        if self.dt.shape != (count,):
            raise ValueError(f"dt: expected shape ({count},), given {self.dt.shape}")
        if not (self.dt > 0).all():
            row = int(np.argmin(self.dt))
            raise ValueError(f"dt: expected positive durations in s, given {self.dt[row]:g} in points[{row}]")
        self.columns = None if columns is None else checked_columns(columns, self.x0.shape[1] + self.u.shape[1])
        for array in (self.x0, self.u, self.dt):
            array.flags.writeable = False

    def _arguments(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in ("x0", "u", "dt", "columns")}

    def __len__(self) -> int:
        return len(self.dt)

    def __getitem__(self, index: int | slice | Sequence[int] | NDArray[Any]) -> Experiments:
        rows = as_index(index, len(self.dt), "points")
        try:
            return Experiments._of(self.x0[rows], self.u[rows], self.dt[rows], self.columns)
        except IndexError as error:
            raise IndexError(f"points: expected indices below {len(self)}, or as many flags; given {shown(index)}") from error

    @classmethod
    def _of(cls, x0: Array, u: Array, dt: Array, columns: tuple[str, ...] | None) -> Experiments:
        """Points whose parts are known to be valid."""
        points = cls.__new__(cls)
        points.x0, points.u, points.dt, points.columns = x0, u, dt, columns
        for array in (x0, u, dt):
            array.flags.writeable = False
        return points

    @staticmethod
    def join(parts: Sequence[Experiments]) -> Experiments:
        """Return the points of all parts, one after the other."""
        parts = as_parts(parts, Experiments)
        check_alike([(part.x0.shape[1], part.u.shape[1]) for part in parts], "states and inputs")
        x0, u, dt = (np.concatenate([getattr(part, name) for part in parts]) for name in ("x0", "u", "dt"))
        return Experiments._of(x0, u, dt, parts[0].columns)

    def __iter__(self) -> Iterator[Experiments]:
        return (self[k] for k in range(len(self)))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Experiments) and all(
            np.array_equal(a, b) for a, b in zip((self.x0, self.u, self.dt), (other.x0, other.u, other.dt), strict=True)
        )

    __hash__ = None  # type: ignore[assignment]  # arrays

    def __repr__(self) -> str:
        return f"Experiments({len(self)} points, {self.x0.shape[1]} states, {self.u.shape[1]} inputs)"

    def _in_notebook(self) -> Report:
        names = self.columns or (*numbered("x0", self.x0), *numbered("u", self.u))
        axes = np.column_stack([self.x0, self.u])
        lasting = {"dt": self.dt} if self.x0.shape[1] else {}
        return Report(repr(self), [first_rows(len(self), {**dict(zip(names, axes.T, strict=True)), **lasting})])

    @property
    def table(self) -> Array:
        """All numbers, one row per point: x0, u, dt; shape (K, n_x + n_u + 1)."""
        return np.column_stack([self.x0, self.u, self.dt])

    def starting(self, x0: Array) -> Experiments:
        """Return these points with other starts (K, n_x)."""
        return Experiments(x0, self.u, self.dt, columns=self.columns)

    @classmethod
    def of_table(cls, model: Model, table: Array) -> Experiments:
        """Points of `model` from such rows; dt may be left out where there is no state."""
        n_x, n = len(model.states), len(model.states) + len(model.inputs)
        return cls(table[:, :n_x], table[:, n_x:n], table[:, n] if table.shape[1] > n else None, columns=columns_of(model))

    def to_csv(self, path: str | Path, model: Model | None = None) -> None:
        """Write one row per point under a header of the state and input names and dt; every digit is kept.

        Points without a state have no column dt. The file appears whole or not at all.
        """
        write_whole(path, points_csv(self, model))

    @classmethod
    def from_csv(cls, path: str | Path, model: Model) -> Experiments:
        """Read points of `model`; columns are found by name (or by place where written without a model).

        Entries may be separated by semicolons or tabs, then with decimal commas too, and headers may have units, as ``q [mm]``.
        What else a file of measurements has, such as outputs and a column ``comment``, is not read.

        Raises
        ------
        OSError
            Where the file cannot be read.
        ValueError
            Where a column is missing or unknown, or an entry is no number; the message names row and column.
        """
        check_type(model, Model, "model")
        return cls._of_table(DataTable(as_path(path, "path")), model)

    @classmethod
    def _of_table(cls, table: DataTable, model: Model, ignored: Iterable[str] = ()) -> Experiments:
        """Read points of a table in which further columns are not read."""
        names, n_x, n_u = names_of(model.axes), len(model.states), len(model.inputs)
        places = (*place_names(n_x, n_u), *names[n_x + n_u :])
        columns = places if places[0] in table and names[0] not in table else names
        if "dt" in table and "dt" not in columns:
            columns = (*columns, "dt")
        if not set(columns) <= set(table.names):
            raise ValueError(f"{table.path}: expected the columns {listed(names)}; given {listed(table.names)}")
        besides = {*columns, *(f"x0_{name}" for name in names[:n_x]), "status", *BOOKKEEPING, *ignored}
        besides.update(name for output in names_of(model.outputs) for name in (output, f"y_{output}"))
        if unknown := [name for name in table.names if name not in besides]:
            raise ValueError(
                f"{table.path}: expected the columns {listed(names)}, and besides outputs, status or {listed(BOOKKEEPING)}; "
                f"given the unknown {listed(unknown)}"
            )
        table.read_decimal_commas(columns)
        quantities = (*model.states, *model.inputs, DURATION)
        numbers = [table.complete(quantity, name) for quantity, name in zip(quantities, columns, strict=False)]
        return cls.of_table(model, np.column_stack(numbers))


def points_csv(points: Experiments, model: Model | None) -> str:
    """The text of a file of points; see `Experiments.to_csv`."""
    given = points.x0.shape[1], points.u.shape[1]
    if model is not None:
        check_type(model, Model, "model")
        check_alike([(len(model.states), len(model.inputs)), given], "states and inputs", "model")
    columns = columns_of(model) if model is not None else points.columns
    if columns is None:
        columns = place_names(*given)
    header = (*columns, "dt") if given[0] else columns
    return csv_text(header, points.table[:, : len(header)].tolist())


def checked_columns(given: tuple[str, ...], count: int) -> tuple[str, ...]:
    """Names of `count` columns."""
    columns = as_sequence(given, "columns", "names")
    if len(columns) != count:
        raise ValueError(f"columns: expected {count} names, given {len(columns)}")
    return tuple(check_name(name, "columns") for name in columns)


def columns_of(model: Model) -> tuple[str, ...]:
    """Names of the states and inputs."""
    return (*names_of(model.states), *names_of(model.inputs))


def place_names(n_x: int, n_u: int) -> tuple[str, ...]:
    """Names of the columns of points without names."""
    return (*(f"x0_{i}" for i in range(n_x)), *(f"u_{i}" for i in range(n_u)))
