"""A record: one long trajectory under inputs that are held from sample to sample, the classical coherent experiment."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ..models import Model
from ..quantity import Array, FrozenMapping, as_float, as_floats, names_of


@dataclass(frozen=True, eq=False)
class Record:
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

    Raises
    ------
    ValueError
        For wrong shapes, times that do not increase, numbers that are not finite, or no measured number at all.
    """

    t: Array
    u: Array
    y: Array
    x0: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        t = checked_times(self.t)
        arrays = {"t": t, "u": held_inputs(self.u, len(t)), "y": _outputs(self.y, len(t))}
        for name, array in arrays.items():
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        known = {name: as_float(value, f"x0[{name!r}]") for name, value in (self.x0 or {}).items()}
        object.__setattr__(self, "x0", FrozenMapping(known))

    def __len__(self) -> int:
        return len(self.t)

    def __getitem__(self, samples: slice) -> Record:
        """Return the samples from one to another, without a gap; the start stays known only where the first one is among them."""
        if not isinstance(samples, slice):
            raise TypeError(f"samples: expected a slice, given {samples!r:.60}")
        first, last, step = samples.indices(len(self))
        if step != 1 or not first < last:
            raise ValueError(f"samples: expected a slice of following samples, at least one, given {samples}")
        return Record(self.t[first:last], self.u[first:last], self.y[first:last], self.x0 if first == 0 else {})

    def __repr__(self) -> str:
        measured = int(np.isfinite(self.y).sum())
        sizes = f"{self.u.shape[1]} inputs, {self.y.shape[1]} outputs, {measured} of {self.y.size} numbers"
        return (
            f"Record({len(self)} samples over {self.t[-1] - self.t[0]:g} s, {sizes}, known start of {', '.join(self.x0) or 'none'})"
        )

    def check(self, model: Model) -> None:
        """Raise unless inputs, outputs and the known start are those of `model`."""
        for name, array, quantities in (("u", self.u, model.inputs), ("y", self.y, model.outputs)):
            if array.shape[1] != len(quantities):
                columns = ", ".join(names_of(quantities)) or "none"
                raise ValueError(f"{name}: expected {len(quantities)} columns, {columns}; given {array.shape[1]}")
        for name in self.x0:
            if name not in names_of(model.states):
                raise ValueError(f"x0: expected names of states, {', '.join(names_of(model.states)) or 'none'}; given {name!r}")

    def to_csv(self, path: str | Path, model: Model) -> None:
        """Write one row per sample: t, the inputs, and the outputs as ``y_<name>``, empty where not measured. x0 is not written."""
        self.check(model)
        with Path(path).open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(["t", *names_of(model.inputs), *(f"y_{name}" for name in names_of(model.outputs))])
            for row in np.column_stack([self.t, self.u, self.y]).tolist():
                writer.writerow(["" if np.isnan(value) else repr(value) for value in row])

    @classmethod
    def from_csv(cls, path: str | Path, model: Model, x0: Mapping[str, float] | None = None) -> Record:
        """Read a record of `model` from a file with the columns t, its inputs, and its measured outputs.

        Parameters
        ----------
        path : str or Path
            The column of an output is called ``y_<name>``, or as the output where no state or input has that name. Outputs may
            be left out, or single entries empty: these were not measured.
        model : Model
        x0 : mapping of state name to float, optional
            Start values that are known.

        Raises
        ------
        OSError
            Where the file cannot be read.
        ValueError
            Where a column is missing or unknown, or an entry is no number; the message names row and column.
        """
        try:
            with Path(path).open(newline="", encoding="utf-8-sig") as file:
                header, *rows = [row for row in csv.reader(file) if row] or [[]]
        except (UnicodeDecodeError, csv.Error) as error:
            raise ValueError(f"{path}: expected a CSV text file, given {error}") from error
        header = [name.strip() for name in header]
        inputs, place = names_of(model.inputs), _places(header, model, path)
        if not rows:
            raise ValueError(f"{path}: expected at least one row of samples, given none")
        table = np.full((len(rows), 1 + len(inputs) + len(model.outputs)), np.nan)
        for n, row in enumerate(rows):
            if len(row) != len(header):
                raise ValueError(f"{path}: row {n + 1}: expected {len(header)} entries, given {len(row)}")
            for column, text in enumerate(row):
                if text.strip() or place[column] <= len(inputs):
                    table[n, place[column]] = _number(text, f"{path}: row {n + 1}, column {header[column]}")
        record = cls(table[:, 0], table[:, 1 : 1 + len(inputs)], table[:, 1 + len(inputs) :], x0 or {})
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
    u = as_floats(values, "u")
    if u.ndim == 1 and len(u) == count:
        u = u.reshape(count, 1)
    if u.ndim != 2 or len(u) != count:
        raise ValueError(f"u: expected shape ({count}, n_u), given {u.shape}")
    return u


def _outputs(values: ArrayLike, count: int) -> Array:
    try:
        if np.iscomplexobj(values):
            raise TypeError("complex numbers")
        y = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"y: expected numbers, given {values!r:.80}") from error
    if y.ndim == 1 and len(y) == count:
        y = y.reshape(count, 1)
    if y.ndim != 2 or len(y) != count:
        raise ValueError(f"y: expected shape ({count}, n_y), given {y.shape}")
    if np.isinf(y).any():
        n, i = np.argwhere(np.isinf(y))[0].tolist()
        raise ValueError(f"y: expected finite numbers, or NaN for what was not measured; given {y[n, i]} at index {(n, i)}")
    if np.isnan(y).all():
        raise ValueError("y: expected at least one measured number, given none")
    return y


def _places(header: list[str], model: Model, path: str | Path) -> list[int]:
    """For each column of a file its place in the table of t, inputs and outputs."""
    inputs, outputs = names_of(model.inputs), names_of(model.outputs)
    taken = {"t", *inputs, *names_of(model.states)}
    known = {name: place for place, name in enumerate(("t", *inputs))}
    for i, name in enumerate(outputs):
        known |= {column: 1 + len(inputs) + i for column in (name, f"y_{name}") if column not in taken}
    places = [known.get(name, -1) for name in header]
    measured = {place for place in places if place > len(inputs)}
    if -1 in places or len(set(places)) < len(places) or not {0, *range(1 + len(inputs))} <= set(places) or not measured:
        expected = ", ".join(("t", *inputs, *(f"y_{name}" for name in outputs)))
        raise ValueError(f"{path}: expected the columns {expected}, of outputs those measured; given {', '.join(header) or 'none'}")
    return places


def _number(text: str, place: str) -> float:
    try:
        value = float(text)
    except ValueError as error:
        raise ValueError(f"{place}: expected a number, given {text!r:.60}") from error
    if not np.isfinite(value):
        raise ValueError(f"{place}: expected a finite number, given {text!r:.60}")
    return value
