"""Runs: a start, then segments with held inputs; some of their ends are measured. A run of one segment is an experiment point."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..basics.checks import as_floats, as_index, as_parts, as_path, check_alike, check_known, check_type
from ..basics.files import write_whole
from ..basics.messages import shown
from ..basics.quantity import names_of
from ..basics.table import DataTable
from ..basics.values import Array
from ..models import Model
from ..show.section import Report
from ..show.table_preview import InNotebooks, first_rows, numbered
from .experiments import Experiments, checked_columns, columns_of
from .rest import Rest, Rests, any_rests, as_rests, joined_rests
from .run_checks import Flags as Flags
from .run_checks import as_flags, check_segments, inputs_before, of_outputs, of_segments
from .run_files import read_runs, runs_csv
from .sample_clock import SampleClock, as_every
from .sampling import divided

_PARTS = ("x0", "u", "dt", "measured", "columns", "rests", "before", "by_output")


class Runs(InNotebooks):
    """A sequence of K runs of N segments, or fewer: from x0 the inputs u[k, n] are held for dt[k, n], one segment after the other.

    Parameters
    ----------
    x0 : array_like, (K, n_x)
        Start states, SI units.
    u : array_like, (K, N, n_u)
        Inputs of every segment; (K, N) is taken for a single input.
    dt : array_like, (K, N), or (N,) or a number for all runs
        Durations of the segments, s. A run of fewer segments has zeros behind its last one.
    measured : array_like of bool, (K, N), or (N,) for all runs, or (K, N, n_y), optional
        Segments at whose ends the outputs are measured, or which outputs are. Default: all.
    rest : Rest, or a sequence of K, optional
        Starts that are found where the plant is at rest, by parameters; x0 is the guess then. None stands for a run that is not.
    before : array_like, (K, n_u), or (n_u,) for all runs, optional
        Inputs before the start, SI units, which equations with a dead time still read at first: see `fisherpoint.math.delay`. A row
        of NaN stands for the default: those of the rest of a run that starts at rest, else those of the first segment.
    columns : tuple of str, optional
        Names of the states and inputs, for files; the model's, where the runs come from one.

    Attributes
    ----------
    measured : ndarray of bool, (K, N)
        Segments at whose ends an output is measured: a sample.
    by_output : ndarray of bool, (K, N, n_y), or None
        Which outputs are; None where all outputs are measured in each sample.

    Raises
    ------
    ValueError
        For wrong shapes, numbers that are not finite, a duration that is negative or zero between others, and a run without
        a segment or a sample.
    """

    kind: ClassVar[str] = "run"
    """Word for one of them."""

    def __init__(
        self,
        x0: ArrayLike,
        u: ArrayLike,
        dt: ArrayLike,
        measured: ArrayLike | None = None,
        *,
        rest: Rest | Sequence[Rest | None] | None = None,
        before: ArrayLike | None = None,
        columns: tuple[str, ...] | None = None,
    ) -> None:
        self.x0, self.u = as_floats(x0, "x0"), as_floats(u, "u")
        if self.x0.ndim != 2:
            raise ValueError(f"x0: expected shape (K, n_x), given {self.x0.shape}")
        count = len(self.x0)
        if self.u.ndim == 2:
            self.u = self.u[:, :, None]
        if self.u.ndim != 3 or len(self.u) != count:
            raise ValueError(f"u: expected shape ({count}, N, n_u), given {self.u.shape}")
        shape = self.u.shape[:2]
        if not shape[1]:
            raise ValueError("u: expected at least one segment, given none")
        self.dt = of_segments(as_floats(dt, "dt"), shape, "dt")
        flags, there = as_flags(measured), self.dt > 0
        self.by_output: Flags | None = None
        if flags.ndim == 3:
            self.by_output = of_outputs(flags, shape) & there[:, :, None]
            flags = np.asarray(self.by_output.any(axis=2))
        self.measured: Flags = of_segments(flags, shape, "measured") & there
        check_segments(self.dt, self.measured)
        self.columns = None if columns is None else checked_columns(columns, self.x0.shape[1] + self.u.shape[2])
        self.rests = as_rests(rest, count)
        self.before = inputs_before(before, (count, self.u.shape[2]))
        self._keep()

    @classmethod
    def of_points(cls, points: Experiments) -> Runs:
        """Return experiment points as runs of one segment."""
        check_type(points, Experiments, "points")
        dt = points.dt[:, None]
        return cls._of(points.x0, points.u[:, None], dt, np.ones(dt.shape, dtype=bool), points.columns)

    @staticmethod
    def join(parts: Sequence[Runs]) -> Runs:
        """Return the runs of all parts, one after the other."""
        parts = as_parts(parts, Runs)
        check_alike([(part.x0.shape[1], part.u.shape[2]) for part in parts], "states and inputs")
        longest = max(part.dt.shape[1] for part in parts)

        def padded(array: NDArray[Any], mode: str) -> NDArray[Any]:
            width = [(0, 0), (0, longest - array.shape[1]), *[(0, 0)] * (array.ndim - 2)]
            return np.pad(array, width, mode="edge") if mode == "edge" else np.pad(array, width)

        outputs = max(part.readings.shape[2] for part in parts)
        check_alike([part.by_output.shape[2] for part in parts if part.by_output is not None], "outputs")
        readings = [np.broadcast_to(part.readings, (*part.dt.shape, outputs)) for part in parts]
        return Runs._of(
            np.concatenate([part.x0 for part in parts]),
            np.concatenate([padded(part.u, "edge") for part in parts]),
            np.concatenate([padded(part.dt, "zero") for part in parts]),
            np.concatenate([padded(part.measured, "zero") for part in parts]),
            parts[0].columns,
            joined_rests([(part.rests, len(part)) for part in parts]),
            None if all(part.before is None for part in parts) else np.concatenate([part._before for part in parts]),
            np.concatenate([padded(part, "zero") for part in readings]),
        )

    @classmethod
    def _of(
        cls,
        x0: Array,
        u: Array,
        dt: Array,
        measured: Flags,
        columns: tuple[str, ...] | None,
        rests: Rests | None = None,
        before: Array | None = None,
        by_output: Flags | None = None,
    ) -> Runs:
        """Runs whose parts are known to be valid."""
        runs = cls.__new__(cls)
        runs.x0, runs.u, runs.dt, runs.measured, runs.columns, runs.rests, runs.before = x0, u, dt, measured, columns, rests, before
        runs.by_output = by_output
        runs._keep()
        return runs

    def _with(self, **changes: Any) -> Runs:
        """These runs with some of their parts changed."""
        return Runs._of(**{name: getattr(self, name) for name in _PARTS} | changes)

    def _keep(self) -> None:
        if self.by_output is not None and (self.by_output == self.measured[:, :, None]).all():
            self.by_output = None
        for array in (self.x0, self.u, self.dt, self.measured, self.rests, self.before, self.by_output):
            if array is not None:
                array.flags.writeable = False

    def _arguments(self) -> dict[str, Any]:
        rest, measured = (
            None if self.rests is None else tuple(self.rests),
            self.measured if self.by_output is None else self.by_output,
        )
        parts = {name: getattr(self, name) for name in ("x0", "u", "dt", "before", "columns")}
        return parts | {"measured": measured, "rest": rest}

    def __len__(self) -> int:
        return len(self.x0)

    def __getitem__(self, index: int | slice | Sequence[int] | NDArray[Any]) -> Runs:
        rows = as_index(index, len(self), "runs")
        try:
            rests = None if self.rests is None else any_rests(self.rests[rows])
            before = None if self.before is None else self.before[rows]
            some = {name: getattr(self, name)[rows] for name in ("x0", "u", "dt", "measured")}
            by_output = None if self.by_output is None else self.by_output[rows]
            return self._with(**some, rests=rests, before=before, by_output=by_output)
        except IndexError as error:
            raise IndexError(f"runs: expected indices below {len(self)}, or as many flags; given {shown(index)}") from error

    def __iter__(self) -> Iterator[Runs]:
        return (self[k] for k in range(len(self)))

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Runs)
            and (len(self), self.x0.shape[1], self.u.shape[2]) == (len(other), other.x0.shape[1], other.u.shape[2])
            and all(self._samples(k) == other._samples(k) for k in range(len(self)))
        )

    __hash__ = None  # type: ignore[assignment]  # arrays

    def __reduce__(self) -> tuple[Any, ...]:
        return Runs._of, tuple(getattr(self, name) for name in _PARTS)

    def __repr__(self) -> str:
        lengths = np.unique(self.segments)
        segments = f"{lengths[0]}" if len(lengths) == 1 else f"up to {lengths.max(initial=0)}"
        resting = sum(one is not None for one in self.rest)
        at_rest = f", {'all' if resting == len(self) else resting} from rest" if resting else ""
        rates = "" if self.by_output is None else f" of {' and '.join(map(str, self.by_output.sum(axis=(0, 1))))} readings"
        return f"Runs({len(self)} of {segments} segments, {self.measured.sum()} samples{rates}, {self.u.shape[2]} inputs{at_rest})"

    def _in_notebook(self) -> Report:
        n_x = self.x0.shape[1]
        names = self.columns or (*numbered("x0", self.x0), *numbered("u", self.u[:, 0]))
        run, segment = np.nonzero(self.dt)
        starts = first_rows(len(self), {"run": list(map(str, range(len(self)))), **dict(zip(names[:n_x], self.x0.T, strict=True))})
        held = dict(zip(names[n_x:], self.u[run, segment].T, strict=True))
        places = {"run": list(map(str, run)), "segment": list(map(str, segment))}
        flags = self.readings[run, segment]
        heads = ["measured"] if self.by_output is None else [f"measured y[{j}]" for j in range(flags.shape[1])]
        measured = {head: ["yes" if one else "" for one in of] for head, of in zip(heads, flags.T, strict=True)}
        table = first_rows(len(run), {**places, **held, "dt": self.dt[run, segment], **measured})
        return Report(repr(self), [replace(starts, title="Starts"), replace(table, title="Segments")])

    @property
    def rest(self) -> tuple[Rest | None, ...]:
        """For each run how it starts at rest; None where it starts as x0 says."""
        return (None,) * len(self) if self.rests is None else tuple(self.rests)

    @property
    def _before(self) -> Array:
        return np.full((len(self), self.u.shape[2]), np.nan) if self.before is None else self.before

    @property
    def readings(self) -> Flags:
        """Which outputs are measured at the ends of segments: (K, N, n_y), or (K, N, 1) where all are in each sample."""
        return self.measured[:, :, None] if self.by_output is None else self.by_output

    @property
    def controlled(self) -> Flags:
        """Whether each run starts where a controller holds the plant, (K,)."""
        return np.array([one is not None and bool(one.solve) for one in self.rest], dtype=bool)

    @property
    def segments(self) -> NDArray[np.intp]:
        """Number of segments of each run, (K,)."""
        return np.asarray(np.count_nonzero(self.dt, axis=1), dtype=np.intp)

    @property
    def t(self) -> Array:
        """Times at which the segments end, from the runs' starts, (K, N)."""
        return np.cumsum(self.dt, axis=1)

    @property
    def starts(self) -> Experiments:
        """The first segments, as points; where a run starts at rest, x0 is the guess of that."""
        return Experiments._of(self.x0, self.u[:, 0], self.dt[:, 0], self.columns)

    def key(self, run: int, segments: int | None = None) -> Hashable:
        """Key of what is done to the plant in the first `segments` of a run, or in all: equal keys, equal trajectories.

        It has the start and how that is found, the inputs and the durations, where -0.0 is 0.0; not which segments are measured,
        and nothing behind the last segment.
        """
        n = int(np.count_nonzero(self.dt[run])) if segments is None else segments
        held = (np.ravel(part) + 0.0 for part in (self.x0[run], self.u[run, :n], self.dt[run, :n], self._before[run]))
        return n, *(part.tobytes() for part in held), None if self.rests is None else self.rests[run]

    def distinct(self, *, sampled_alike: bool = True) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Replicates: the first of the runs that are the same (D,), and for each run the place of its kind among these (K,).

        Parameters
        ----------
        sampled_alike : bool
            Whether runs are the same only where the same segments are measured.
        """
        there = self.dt > 0
        parts = [self.x0, np.where(there[:, :, None], self.u, 0.0).reshape(len(self), -1), self.dt]
        parts += [self.readings.reshape(len(self), -1)] if sampled_alike else []
        parts += [] if self.before is None else [np.where(np.isnan(self.before), np.inf, self.before)]
        if self.rests is not None:
            numbers: dict[Rest | None, int] = {}
            parts.append(np.array([[numbers.setdefault(one, len(numbers))] for one in self.rests]))
        table = np.column_stack(parts) + 0.0  # -0.0 is 0.0
        _, first, of = np.unique(table, axis=0, return_index=True, return_inverse=True)
        return first, np.asarray(of.reshape(-1), dtype=np.intp)

    def _samples(self, run: int) -> Hashable:
        """Key of what is done in a run: its segments, those that are measured, and their outputs where these are not all."""
        flags, all_of = self.readings[run], self.measured[run]
        alike = bool((flags == all_of[:, None]).all())
        return self.key(run), np.flatnonzero(all_of).tobytes(), b"" if alike else np.flatnonzero(flags).tobytes()

    def first_difference(self, other: Runs, own: NDArray[np.intp]) -> NDArray[np.intp]:
        """Number of segments that each run has in common with other[own], from the start on; 0 where their starts differ."""
        n, common = self.dt.shape[1], min(self.dt.shape[1], other.dt.shape[1])
        differs = np.ones(self.dt.shape, dtype=bool)
        differs[:, :common] = (self.u[:, :common] != other.u[own, :common]).any(axis=2) | (
            self.dt[:, :common] != other.dt[own, :common]
        )
        first = np.where(differs.any(axis=1), np.argmax(differs, axis=1), n)
        away = (self.x0 != other.x0[own]).any(axis=1)
        if self.rests is not None or other.rests is not None:
            rests = np.full(len(other), None) if other.rests is None else other.rests
            away |= [a is not b and a != b for a, b in zip(self.rest, rests[own], strict=True)]
        if self.before is not None or other.before is not None:
            away |= ~np.isclose(self._before, other._before[own], rtol=0.0, atol=0.0, equal_nan=True).all(axis=1)
        return np.where(away, 0, first)

    def ending(self, samples: Flags) -> Runs:
        """The runs up to the last of their `samples` (K, N); each has one at least, and these are measured."""
        needed = np.maximum.accumulate(samples[:, ::-1], axis=1)[:, ::-1]
        longest = slice(int(needed.sum(axis=1).max(initial=0)))
        by_output = None if self.by_output is None else (self.by_output & samples[:, :, None])[:, longest]
        dt = np.where(needed, self.dt, 0.0)[:, longest]
        return self._with(u=self.u[:, longest], dt=dt, measured=samples[:, longest], by_output=by_output)

    def starting(self, x0: Array, before: Array | None = None) -> Runs:
        """Return these runs with known starts (K, n_x), which need not be found, and inputs before them (K, n_u)."""
        return self._with(x0=x0, rests=None, before=self.before if before is None else before)

    def divided(self, at: ArrayLike) -> Runs:
        """Return these runs with every segment divided at shares of its duration; the last one is 1, its part ends as before."""
        parts = np.diff(np.asarray(at), prepend=0.0)
        dt = (self.dt[:, :, None] * parts).reshape(len(self.dt), -1)
        last = np.tile(np.arange(1, len(parts) + 1) == len(parts), self.dt.shape[1])
        u, measured = (np.repeat(of, len(parts), axis=1) for of in (self.u, self.measured))
        by_output = None if self.by_output is None else np.repeat(self.by_output, len(parts), axis=1) & last[:, None]
        return self._with(u=u, dt=dt, measured=measured & last, by_output=by_output)

    def sampled(self, every: Any, *, model: Model | None = None) -> Runs:
        """Return these runs with outputs that are measured at given instants, whatever the segments are.

        Segments are divided at the instants, which are measured, and their other ends are not. An instant that is the end of a
        segment but for rounding, a billionth of the shortest segment or step, is that end.

        Parameters
        ----------
        every : float, (float, unit), text such as "1 ms", or (S,), or a mapping of output to these
            The period of the samples, s: all of its multiples up to the end of each run. Or a table of instants from the start, s,
            which may end with a unit; those behind the end of a shorter run are left out.
        model : Model, optional
            Whose outputs a mapping names. Each is measured at instants of its own; outputs that are not named are not measured.

        Returns
        -------
        Runs
            K runs; `by_output` (K, N, n_y) has which outputs are measured where, if that differs.

        Raises
        ------
        TypeError, ValueError
            For a mapping without a model, unknown outputs, instants that do not increase, and where an output has no instant in
            one of the runs, one behind all of them, or more than a million.
        """
        if not len(self):
            return self
        ends = self.dt.sum(axis=1)
        shortest, longest = float(ends.min()), float(ends.max())
        if isinstance(every, Mapping):
            if model is None:
                raise TypeError("model: expected the model whose outputs have instants of their own, given None")
            check_type(model, Model, "model")
            check_known(every, names_of(model.outputs), "every", "names of outputs,")
        names = () if model is None else names_of(model.outputs)
        clock = SampleClock.of(as_every(every, "every", shortest, longest), longest, names)
        return self.sampled_by(clock, clock.counts(self.dt))[0]

    def sampled_by(self, clock: SampleClock, counts: NDArray[np.intp]) -> tuple[Runs, NDArray[np.intp]]:
        """Return these runs measured at the first `counts` (K,) instants of a clock, and where each of their segments ends, (K, N).

        What is later than the end of a run prolongs its last segment.
        """
        dt, of, measured, ends = divided(self.dt, clock.times(counts), clock.every)
        u, by_output = self.u[np.arange(len(self))[:, None], of], None if clock.outputs is None else clock.readings(measured)
        return self._with(u=u, dt=np.array(dt), measured=np.array(measured), by_output=by_output), ends

    def holding(self, u: Array, dt: Array, measured: Flags) -> Runs:
        """Return these runs with other segments: inputs (K, N, n_u), durations (K, N), s, and which are measured (K, N)."""
        return self._with(u=u, dt=dt, measured=measured, by_output=None)

    def measuring(self, flags: Flags) -> Runs:
        """Return these runs with other segments (K, N) measured at their ends, all outputs or those that are measured there."""
        there = flags & (self.dt > 0)
        return self._with(measured=there, by_output=None if self.by_output is None else self.by_output & there[:, :, None])

    @property
    def points(self) -> Experiments | None:
        """The runs as experiment points; None where one has more than a segment, starts at rest, or leaves outputs out."""
        bare = self.rests is None and self.before is None and self.by_output is None
        return self.starts if self.dt.shape[1] == 1 and bare else None

    def to_csv(self, path: str | Path, model: Model | None = None) -> None:
        """Write one row per segment: run, segment, the start in the run's first row, the inputs, dt, and measured (1 or 0).

        Where runs start at rest, their first rows say so: the column rest names the states ("all", or several with blanks
        between), and rest_u, of an input u, has the held input. The states then are the guess. Where a controller holds runs there,
        rest_hold and rest_solve name states and inputs as `Rest` has them, and rest_y_q has the output q.
        Inputs before the start stand in before_u, of an input u, where they are given.
        Runs of 60 segments or more that are sampled at a period, four times or more in each hold on average, have one row for each
        hold, and the period in the column sample_every of their first row; their durations are read back to rounding. Where outputs
        are measured at instants of their own, those of an output q have sample_every_q, or flags in measured_q, 1 or 0.
        Every digit is kept, and the file appears whole or not at all. `Runs.from_csv` reads it back.
        """
        write_whole(path, runs_csv(self, model))

    @classmethod
    def from_csv(cls, path: str | Path, model: Model) -> Runs:
        """Read runs of `model`, as `to_csv` writes them; headers may have units, as ``q [mm]``.

        Raises
        ------
        OSError
            Where the file cannot be read.
        ValueError
            Where a column is missing or unknown, an entry is no number, or rows are not in the order of runs and segments; the
            message names row and column.
        """
        check_type(model, Model, "model")
        return cls._of_table(DataTable(as_path(path, "path")), model)

    @classmethod
    def _of_table(cls, table: DataTable, model: Model, ignored: Collection[str] = ()) -> Runs:
        """Read runs of a table in which further columns are not read."""
        *parts, rest, before = read_runs(table, model, ignored)
        return cls(*parts, rest=rest, before=before, columns=columns_of(model))
