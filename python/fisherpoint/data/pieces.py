"""Pieces: windows of a record as runs, each from the states that were measured at its first sample."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..basics.checks import as_index, as_numbers, as_positive, by_name, check_positive_int, check_type
from ..basics.messages import shown, with_counts
from ..basics.quantity import names_of
from ..basics.values import Array, FrozenMapping
from ..models import Model
from ..points.experiments import columns_of
from ..points.runs import Runs
from .measurements import Measurements
from .record import Record

Places = NDArray[np.intp]

LEAST_LENGTH = 2
"""A window has a sample to start from, and one that is predicted."""


class Pieces:
    """K windows of `length` samples of a record, held as the record itself: runs and outputs are made of the requested ones.

    The first sample of a window is its start, the others are measured. Windows whose first samples are `length` apart, or more,
    share none. `pieces[rows]` are `Measurements` of some of them, as `estimate` takes them.

    Attributes
    ----------
    record : Record
    model : Model
    length, every : int
        Samples in a window, and from the first sample of a window to that of the next.
    first : ndarray of int, (K,)
        The first sample of each window, increasing.
    measured_by : mapping of state name to output name or None
        Output that measures the start of each state; None where a column of its own does.
    left_out : mapping of reason to int
        Windows that are none, and why.
    """

    def __init__(
        self,
        record: Record,
        model: Model,
        length: int,
        every: int,
        states: Mapping[str, Array],
        longest_step: float | None,
    ) -> None:
        self.record, self.model, self.length, self.every = record, model, length, every
        shown_by = model.shown_states
        names, outputs = names_of(model.states), names_of(model.outputs)
        for missing in (name for name in names if name not in states and name not in shown_by):
            raise ValueError(f"states: expected a column for {missing!r}, which is no output of the model, given none")
        self.measured_by: Mapping[str, str | None] = FrozenMapping(
            {name: None if name in states else shown_by[name] for name in names}
        )
        self._x = np.column_stack([states[n] if n in states else record.y[:, outputs.index(shown_by[n])] for n in names])
        self._y = _held_outputs(record, model)
        self.first, self.left_out = self._windows(longest_step)
        self.first.flags.writeable = False

    def _windows(self, longest_step: float | None) -> tuple[Places, Mapping[str, int]]:
        first = np.arange(0, len(self.record) - self.length + 1, self.every)
        last = first + self.length - 1
        seen = np.cumsum(np.isfinite(self._y).any(axis=1))
        reasons = {"start not measured": ~np.isfinite(self._x[first]).all(axis=1), "nothing measured": seen[last] == seen[first]}
        if longest_step is not None:
            late = np.concatenate([[0], np.cumsum(np.diff(self.record.t) > longest_step)])
            reasons["a longer step"] = late[last] > late[first]
        counts, kept = dict[str, int](), np.ones(len(first), dtype=bool)
        for reason, there in reasons.items():
            counts[reason] = int((kept & there).sum())
            kept &= ~there
        left_out = FrozenMapping({reason: count for reason, count in counts.items() if count})
        if not kept.any():
            listed = with_counts(left_out)
            raise ValueError(f"record: expected a window with a measured start and a measured output, given none: {listed}")
        return first[kept], left_out

    def __len__(self) -> int:
        return len(self.first)

    def __getitem__(self, rows: int | slice | Sequence[int] | NDArray[Any]) -> Measurements:
        """The chosen windows, at least one, with what was measured in them."""
        runs, y = self.cut(rows)
        return Measurements(runs, y)

    def cut(self, rows: int | slice | Sequence[int] | NDArray[Any]) -> tuple[Runs, Array]:
        """The chosen windows as runs, of a segment from each sample to the next, and their outputs (K, length - 1, n_y).

        NaN where nothing was measured; segments are measured where an output is.
        """
        index = as_index(rows, len(self), "pieces")
        try:
            first = self.first[index]
        except IndexError as error:
            raise IndexError(f"pieces: expected indices below {len(self)}, or as many flags; given {shown(rows)}") from error
        if not len(first):
            raise ValueError("pieces: expected at least one window, given none")
        at = first[:, None] + np.arange(self.length)
        y, u, dt = self._y[at[:, 1:]], self.record.u[at[:, :-1]], np.diff(self.record.t[at], axis=1)
        return Runs(self._x[first], u, dt, np.isfinite(y).any(axis=2), columns=columns_of(self.model)), y

    def __repr__(self) -> str:
        return f"Pieces({len(self)} windows of {self.length} samples, of a record of {len(self.record)})"


def pieces(
    record: Record,
    model: Model,
    *,
    length: int,
    every: int | None = None,
    states: Mapping[str, ArrayLike] | None = None,
    longest_step: float | None = None,
) -> Pieces:
    """Cut a record into windows, each a run that starts from the states that were measured at its first sample.

    Parameters
    ----------
    record : Record
        With outputs of every state that `states` does not have: a window starts where all of them were measured. Outputs may be
        NaN elsewhere. The start `record.x0` takes no part.
    model : Model
        With equations: a state that is an output is found in them. An output that reads an input jumps with it, and is a
        measurement of the run only where the input was held at its sample.
    length : int
        Samples in a window, its first one, at which it starts, among them.
    every : int, optional
        A window begins at each so many samples. Default: `length`, windows that share no sample. Fewer give more to choose from.
    states : mapping of state name to array_like, (N,), optional
        States as they were measured or computed otherwise, SI units, NaN where they are not known. They come before outputs.
    longest_step : float, optional
        Windows in which a sample comes more than so many seconds after the one before are left out: the log had stopped there.

    Returns
    -------
    Pieces
        Their memory is that of the record, however many there are.

    Raises
    ------
    TypeError, ValueError
        For a record or column that is not of the model, a model with the time in its equations, a state that nothing measures,
        a length or step that leaves no window, and a record of which no window has a measured start.
    """
    check_type(record, Record, "record")
    record.check(model)
    if not model.states:
        raise ValueError(f"model: expected one with states, given {model.name}")
    if model.clock is not None:
        raise ValueError(
            f"model: expected one without the time {model.clock} in its equations, which would begin anew with each window, given"
            f" {model.name}: write it as an input, or as a state with the rate 1"
        )
    if model.latches:
        raise ValueError(
            f"model: expected one without latch(), which would remember nothing at the start of each window, given {model.name}:"
            " set a state of your own by resets"
        )
    if model.updates:
        raise ValueError(
            f"model: expected one without updates, as windows do not know the time since the last one, given {model.name}: estimate"
            " from the record, or from parts of it, record[first:last]"
        )
    if model.delays:
        raise ValueError(
            f"model: expected one without delay(), as windows do not know the inputs before their starts, given {model.name}:"
            " estimate from the record, or from parts of it, record[first:last]"
        )
    if model.late_outputs:
        raise ValueError(
            f"model: expected one without late outputs, as windows do not know the states before their starts, given {model.name}:"
            " estimate from the record, or from parts of it, record[first:last]"
        )
    length = check_positive_int(length, "length", LEAST_LENGTH)
    if length > len(record):
        raise ValueError(f"length: expected at most the {len(record)} samples of the record, given {length}")
    every = length if every is None else check_positive_int(every, "every", most=len(record))
    columns = by_name(states, names_of(model.states), "states", lambda values, name: _column(values, len(record), name))
    step = None if longest_step is None else as_positive(longest_step, "longest_step", "step in s")
    return Pieces(record, model, length, every, columns, step)


def _column(values: ArrayLike, count: int, name: str) -> Array:
    column = as_numbers(values, name)
    if column.shape != (count,):
        raise ValueError(f"{name}: expected shape ({count},), given {column.shape}")
    if np.isinf(column).any():
        raise ValueError(f"{name}: expected finite numbers, or NaN for what is not known; given {column[np.isinf(column)][0]}")
    return column


def _held_outputs(record: Record, model: Model) -> Array:
    """Outputs as runs have them: with the input that was held up to the sample, where a record has the one from there on."""
    inputs = names_of(model.inputs)
    changed = np.concatenate([np.zeros((1, len(inputs)), dtype=bool), record.u[1:] != record.u[:-1]])
    y = record.y
    for i, name in enumerate(names_of(model.outputs)):
        read = [inputs.index(u) for u in model.direct_inputs[name]]
        jumped = changed[:, read].any(axis=1)
        if jumped.any():
            y = y.copy() if y is record.y else y
            y[jumped, i] = np.nan
    return y
