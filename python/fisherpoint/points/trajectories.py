"""Trajectories and sensitivities of points and runs: what was computed, and how it shows itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from ..basics.values import Array, IntArray
from ..show.numbers import counted
from ..show.section import Report, to_html
from ..show.table_preview import MOST, first_rows, numbered
from .status import Status, failures_of, named


class Trajectories(NamedTuple):
    """States, outputs and statuses.

    Attributes
    ----------
    x : ndarray, (K, n_x), or (K, N + 1, n_x) of runs
        States after dt; of runs at the start and at the segments' ends. Where the status is not ok, the last state that was
        reached, or zero where that overflows.
    y : ndarray, (K, n_y), or (K, N, n_y) of runs
        Outputs after dt; of runs at the segments' ends, with the input that was held up to there. Where the status is not ok, those
        of the last state; of runs, zero behind the segments that were completed.
    status : ndarray of int, (K,)
        `Status` values.
    reached : ndarray of int, (K,)
        Number of segments that were completed; a point has one.
    """

    x: Array
    y: Array
    status: IntArray
    reached: IntArray

    @property
    def statuses(self) -> tuple[Status, ...]:
        """The statuses by their names, such as Status.met_jump."""
        return named(self.status)

    def of_points(self) -> Trajectories:
        """Return those of runs of one segment as those of points."""
        return self._replace(x=self.x[:, 1], y=self.y[:, 0])

    def __repr__(self) -> str:
        return summary("Trajectories", self.x, self.y, self.status)

    def _repr_html_(self) -> str:
        return to_html(preview(repr(self), self.x, self.y, self.status, self.reached))


class Later:
    """An array that is computed when it is read, once."""

    def __init__(self, compute: Callable[[], Array]) -> None:
        self._compute = compute
        self._array: Array | None = None

    @property
    def array(self) -> Array:
        if self._array is None:
            self._array = self._compute()
        return self._array


class _Fields(NamedTuple):
    x: Array
    y: Array
    dx_dtheta: Array
    dy_dtheta: Array
    status: IntArray
    reached: IntArray


class Sensitivities(_Fields):
    """States, outputs and statuses as of `Trajectories`, with derivatives per SI unit of each parameter.

    Attributes
    ----------
    x, y, status, reached
        As of `Trajectories`.
    dx_dtheta : ndarray, (K, n_x, p), or (K, N, n_x, p) of runs
        Derivatives of the states after dt; of runs at the segments' ends. Where the status is not ok, zero; of runs, from the
        segment on that was not completed. Of points of a model with few outputs beside its parameters they are computed when they
        are first read, as dy_dtheta takes less time without them.
    dy_dtheta : ndarray, (K, n_y, p), or (K, N, n_y, p) of runs
        Derivatives of the outputs. Of runs of several segments they are zero too at a sample in the very instant of a jump that its
        outputs feel: there is no derivative.
    """

    __slots__ = ()

    @property
    def dx_dtheta(self) -> Array:
        return self[2]

    def __getitem__(self, index: Any) -> Any:
        found = super().__getitem__(index)
        return tuple(map(_read, found)) if isinstance(found, tuple) else _read(found)

    def __iter__(self) -> Iterator[Any]:
        return map(_read, super().__iter__())

    def __reduce__(self) -> tuple[Any, ...]:
        return Sensitivities, tuple(self)

    @property
    def statuses(self) -> tuple[Status, ...]:
        """The statuses by their names, such as Status.met_jump."""
        return named(self.status)

    def with_states(self, compute: Callable[[], Array]) -> Sensitivities:
        """Return the same with another dx_dtheta, which `compute` returns when it is read."""
        dx: Any = Later(compute)
        return Sensitivities(self.x, self.y, dx, self.dy_dtheta, self.status, self.reached)

    def of_points(self) -> Sensitivities:
        """Return those of runs of one segment as those of points."""
        dx: Any = Later(lambda: self.dx_dtheta[:, 0])
        return Sensitivities(self.x[:, 1], self.y[:, 0], dx, self.dy_dtheta[:, 0], self.status, self.reached)

    def __repr__(self) -> str:
        return summary("Sensitivities", self.x, self.y, self.status, self.dy_dtheta.shape[-1])

    def _repr_html_(self) -> str:
        return to_html(preview(repr(self), self.x, self.y, self.status, self.reached))


def _read(field: Any) -> Any:
    return field.array if isinstance(field, Later) else field


def counted_statuses(status: IntArray) -> str:
    """How many trajectories ended how, by the names of their statuses: 3 ok, 1 met_jump."""
    ok = int((np.asarray(status) == Status.ok).sum())
    return ", ".join([*([f"{ok} ok"] if ok else []), *(f"{count} {name}" for name, count in failures_of(status).items())]) or "none"


def summary(name: str, x: Array, y: Array, status: IntArray, parameters: int | None = None) -> str:
    """One line, as `repr` shows it."""
    kind, of = "point" if y.ndim == 2 else "run", "" if parameters is None else f" by {counted(parameters, 'parameter')}"
    sizes = f"{counted(len(status), kind)}, {counted(x.shape[-1], 'state')}, {counted(y.shape[-1], 'output')}{of}"
    return f"{name}({sizes}; status: {counted_statuses(status)})"


def preview(headline: str, x: Array, y: Array, status: IntArray, reached: IntArray) -> Report:
    """States and outputs of the first points, or at the ends of the segments of the first runs that were completed."""
    names = [one.name for one in named(status[:MOST])]
    if y.ndim == 2:
        return Report(headline, [first_rows(len(status), {**numbered("x", x), **numbered("y", y), "status": names})])
    run, segment = np.nonzero(np.arange(y.shape[1]) < reached[:, None])
    shown = run[:MOST], segment[:MOST]
    ends = {"run": [str(k) for k in shown[0]], "segment": [str(n) for n in shown[1]]}
    table = first_rows(len(run), {**ends, **numbered("x", x[shown[0], shown[1] + 1]), **numbered("y", y[shown])})
    runs = [str(k) for k in range(min(MOST, len(status)))]
    how = first_rows(len(status), {"run": runs, "completed segments": [str(n) for n in reached[:MOST]], "status": names})
    return Report(headline, [how, table])
