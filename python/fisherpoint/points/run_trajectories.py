"""Trajectories and sensitivities of runs, computed by the core."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.quantity import names_of
from ..basics.values import Array, IntArray
from ..models import Model
from ..show.text import to_html
from .rest_starts import RunStarts, starts_of
from .runs import Runs
from .settings import Integration
from .shown_trajectories import of_runs, summary
from .status import Status, named, only_finite


class RunTrajectories(NamedTuple):
    """States x (K, N + 1, n_x) at the start and the segments' ends, outputs y (K, N, n_y) at the ends, and status (K,).

    y[k, n] is that of the input of segment n, which has been held up to its end. `reached` (K,) counts the segments that were
    completed. Behind them x is the last state that was reached, and y zero.
    """

    x: Array
    y: Array
    status: IntArray
    reached: IntArray

    @property
    def statuses(self) -> tuple[Status, ...]:
        """The statuses by their names, such as Status.met_jump."""
        return named(self.status)

    def __repr__(self) -> str:
        return summary("RunTrajectories", self.x, self.y, self.status, "run")

    def _repr_html_(self) -> str:
        return to_html(of_runs(repr(self), self.x, self.y, self.status, self.reached))


class RunSensitivities(NamedTuple):
    """As `RunTrajectories`, with dx_dtheta (K, N, n_x, p) and dy_dtheta (K, N, n_y, p) at the ends, per SI unit of each parameter.

    Where the status is not ok they are zero from the segment on that was not completed. dy_dtheta is zero at a sample in the very
    instant of a jump that its outputs feel: there is no derivative.
    """

    x: Array
    y: Array
    dx_dtheta: Array
    dy_dtheta: Array
    status: IntArray
    reached: IntArray

    @property
    def statuses(self) -> tuple[Status, ...]:
        """The statuses by their names, such as Status.met_jump."""
        return named(self.status)

    def __repr__(self) -> str:
        return summary("RunSensitivities", self.x, self.y, self.status, "run", self.dy_dtheta.shape[-1])

    def _repr_html_(self) -> str:
        return to_html(of_runs(repr(self), self.x, self.y, self.status, self.reached))


def checked_run_trajectories(model: Model, runs: Runs, theta: Array, settings: Integration) -> RunTrajectories:
    """Simulate runs, of arguments that are known to be good."""
    points, (count, segments) = runs.points, runs.dt.shape
    if points is not None:
        end, y, status, _ = model.kernels.simulate(model.core, points.x0, points.u, points.dt, theta, *settings)
        return RunTrajectories(np.stack([points.x0, end], axis=1), y[:, None], status, (status == Status.ok).astype(np.int64))
    start = starts_of(model, runs, theta, tangents=False)
    rows, values = _resting(start.status, theta)
    given = start.x0[rows], runs.u[rows], runs.dt[rows], values
    x, status, reached = _whole(start, rows, segments, *model.kernels.simulate_runs(model.core, *given, *settings))
    y = np.zeros((count, segments, len(model.outputs)))
    k, n = np.nonzero(np.arange(segments) < reached[:, None])
    of_ends = theta[k] if theta.ndim == 2 else np.broadcast_to(theta, (len(k), len(theta)))
    ends = model.at(x[k, n + 1], np.cumsum(runs.dt, axis=1)[k, n])
    y[k, n] = np.asarray(model.core.output(ends, runs.u[k, n], np.ascontiguousarray(of_ends))).reshape(len(k), y.shape[2])
    return RunTrajectories(x, y, only_finite(status, x, y), reached)


def checked_run_sensitivities(
    model: Model, runs: Runs, theta: Array, settings: Integration, outputs_alone: bool = False
) -> RunSensitivities:
    """Trajectories with sensitivities; with `outputs_alone` without dx_dtheta, which may take less time."""
    points = runs.points
    if points is not None:
        given = (points.x0, points.u, points.dt, theta, *settings)
        end, y, dx, dy, status = model.kernels.sensitivities(model.core, *given, outputs_alone=outputs_alone)
        x = np.stack([points.x0, end], axis=1)
        return RunSensitivities(x, y[:, None], dx[:, None], dy[:, None], status, (status == Status.ok).astype(np.int64))
    start = starts_of(model, runs, theta)
    rows, values = _resting(start.status, theta)
    s = start.s[rows] if start.s.size else start.s
    compute = _by_kernel if runs.rests is None or not runs.controlled.any() else _from_controlled
    x, y, dx, dy, status, reached = compute(model, runs[rows], start.x0[rows], s, values, settings, outputs_alone)
    x, status, reached, y, dy = _whole(start, rows, runs.dt.shape[1], x, status, reached, y, dy)
    dx = dx if outputs_alone else _spread(dx, rows, len(runs))
    return RunSensitivities(x, y, dx, dy, status, reached)


def _by_kernel(
    model: Model, runs: Runs, x0: Array, s: Array, theta: Array, settings: Integration, outputs_alone: bool
) -> tuple[Any, ...]:
    """x, y, dx, dy, status and reached of runs from known starts x0, which move with theta by s."""
    options = {"measured": runs.measured, "s": s, "outputs_alone": outputs_alone}
    return tuple(model.kernels.run_sensitivities(model.core, x0, runs.u, runs.dt, theta, *settings, **options))


def _from_controlled(
    model: Model, runs: Runs, x0: Array, s: Array, theta: Array, settings: Integration, outputs_alone: bool
) -> tuple[Any, ...]:
    """Sensitivities where a controller makes starts depend on parameters that the states do not depend on, as a valve's on leakage.

    A kernel knows which states depend on which parameters, and keeps these derivatives alone. So starts are parameters of their
    own, and what they do is multiplied by s.
    """
    p, states = len(model.parameters), names_of(model.states)
    names = tuple(dict.fromkeys(name for rest in runs.rest if rest is not None and rest.solve for name in rest.found(states)))
    places = [states.index(name) for name in names]
    by, left = s[:, places], s.copy()  # by is (K, m, p)
    left[:, places] = 0.0
    free = np.zeros((len(runs), len(names)))
    values = np.column_stack([np.broadcast_to(theta, (len(runs), p)), free])
    left = np.concatenate([left, np.zeros((*s.shape[:2], len(names)))], axis=2)
    x, y, dx, dy, status, reached = _by_kernel(_freed(model, names), runs, x0, left, values, settings, outputs_alone)
    dy = dy[..., :p] + dy[..., p:] @ by[:, None]
    if not outputs_alone:
        dx = dx[..., :p] + dx[..., p:] @ by[:, None]
        dx[:, :, places] += np.where((np.arange(dx.shape[1]) < reached[:, None])[:, :, None, None], by[:, None], 0.0)
    return x, y, dx, dy, status, reached


@lru_cache(maxsize=64)
def _freed(model: Model, names: tuple[str, ...]) -> Model:
    return model.free_start(*names)


def _resting(status: IntArray, theta: Array) -> tuple[slice | NDArray[np.intp], Array]:
    """Rows of the runs that have a start, and their parameters."""
    if not status.any():
        return slice(None), theta
    rows = np.flatnonzero(status == Status.ok)
    return rows, theta[rows] if theta.ndim == 2 else theta


def _whole(
    start: RunStarts, rows: slice | NDArray[np.intp], segments: int, x: Array, status: IntArray, reached: IntArray, *others: Array
) -> tuple[Any, ...]:
    """Results of all runs, of those of the ones that have a start."""
    if isinstance(rows, slice):
        return x, status, reached, *others
    all_x = np.repeat(start.x0[:, None], segments + 1, axis=1)
    all_x[rows] = x
    found = start.status.copy()
    found[rows] = status
    count = len(found)
    return all_x, found, _spread(reached, rows, count), *(_spread(other, rows, count) for other in others)


def _spread(part: NDArray[Any], rows: slice | NDArray[np.intp], count: int) -> NDArray[Any]:
    """Results of some rows, with zeros in the others."""
    if isinstance(rows, slice):
        return part
    whole = np.zeros((count, *part.shape[1:]), dtype=part.dtype)
    whole[rows] = part
    return whole
