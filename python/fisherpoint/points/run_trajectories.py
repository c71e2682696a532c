"""Trajectories and sensitivities, computed by the core, of arguments that are known to be good.

A point is a run of one segment. The search for points calls the core for points by itself, thousands of times.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..basics.quantity import names_of
from ..basics.values import Array, IntArray
from ..models import Model
from .experiments import Experiments
from .rest_starts import RunStarts, starts_of
from .runs import Runs
from .schedule import Schedule, folded, has_schedule, scheduled_runs
from .settings import Integration
from .status import Status, only_finite
from .trajectories import Sensitivities, Trajectories

_OK = np.int32(Status.ok)  # to compare an array with the enum itself takes six times as long
_Result = TypeVar("_Result", Trajectories, Sensitivities)


def checked_sensitivities(
    model: Model, points: Experiments, theta: Array, settings: Integration, outputs_alone: bool = False, states_later: bool = False
) -> Sensitivities:
    """Sensitivities of points; sooner without dx_dtheta: with `outputs_alone`, and with `states_later` where it is."""
    if model.updates or model.late_outputs:
        done = checked_run_sensitivities(model, Runs.of_points(points), theta, settings, outputs_alone)
        dx = done.dx_dtheta[:, 0] if done.dx_dtheta.size else done.dx_dtheta
        return done._replace(x=done.x[:, -1], y=done.y[:, 0], dx_dtheta=dx, dy_dtheta=done.dy_dtheta[:, 0])
    given = (points.x0, points.u, points.dt, theta, *settings)
    x, y, dx, dy, status = model.kernels.sensitivities(model.core, *given, outputs_alone=outputs_alone, states_later=states_later)
    return Sensitivities(x, y, dx, dy, status, _completed(status))


def _completed(status: IntArray) -> IntArray:
    return np.equal(status, _OK).astype(np.int32)


def checked_run_trajectories(model: Model, runs: Runs, theta: Array, settings: Integration) -> Trajectories:
    """Trajectories of runs."""
    if has_schedule(model, runs):
        parts, found = scheduled_runs(model, runs, theta)
        return folded(model, runs, theta, found, plain_trajectories(model, parts, theta, settings, found))
    return plain_trajectories(model, runs, theta, settings)


def plain_trajectories(
    model: Model, runs: Runs, theta: Array, settings: Integration, found: Schedule | None = None
) -> Trajectories:
    """Trajectories of runs whose inputs switch at the ends of segments, whatever dead times the model has; as `found`, if given."""
    points, (count, segments) = None if found else runs.points, runs.dt.shape
    if points is not None:
        end, y, status, _ = model.kernels.simulate(model.core, points.x0, points.u, points.dt, theta, *settings)
        return Trajectories(np.stack([points.x0, end], axis=1), y[:, None], status, _completed(status))
    if not model.states:
        return _of_segments(runs, plain_trajectories(model, *_separate(runs, theta), settings))
    start = starts_of(model, runs, theta, tangents=False)
    rows, values = _resting(start.status, theta)
    given = start.x0[rows], runs.u[rows], runs.dt[rows], values
    options = found.of_states(rows) if found else {}
    x, status, reached = _whole(start, rows, segments, *model.kernels.simulate_runs(model.core, *given, *settings, **options))
    y = np.zeros((count, segments, len(model.outputs)))
    k, n = np.nonzero(np.arange(segments) < reached[:, None])
    of_ends = theta[k] if theta.ndim == 2 else np.broadcast_to(theta, (len(k), len(theta)))
    ends = model.at(x[k, n + 1], np.cumsum(runs.dt, axis=1)[k, n])
    y[k, n] = np.asarray(model.core.output(ends, runs.u[k, n], np.ascontiguousarray(of_ends))).reshape(len(k), y.shape[2])
    return Trajectories(x, y, only_finite(status, x, y), reached)


def checked_run_sensitivities(
    model: Model, runs: Runs, theta: Array, settings: Integration, outputs_alone: bool = False, states_later: bool = False
) -> Sensitivities:
    """Trajectories of runs with sensitivities; with `outputs_alone` without dx_dtheta, which may take less time.

    With `states_later` points are without dx_dtheta where that takes less time, and have the statuses of those that have one.
    """
    if has_schedule(model, runs):
        parts, found = scheduled_runs(model, runs, theta, slopes=True)
        return folded(model, runs, theta, found, _run_sensitivities(model, parts, theta, settings, outputs_alone, moved=found))
    return _run_sensitivities(model, runs, theta, settings, outputs_alone, states_later)


def _run_sensitivities(
    model: Model,
    runs: Runs,
    theta: Array,
    settings: Integration,
    outputs_alone: bool,
    states_later: bool = False,
    moved: Schedule | None = None,
) -> Sensitivities:
    points = None if moved else runs.points
    if points is not None:
        done = checked_sensitivities(model, points, theta, settings, outputs_alone, states_later)
        x = np.stack([points.x0, done.x], axis=1)
        return done._replace(x=x, y=done.y[:, None], dx_dtheta=done.dx_dtheta[:, None], dy_dtheta=done.dy_dtheta[:, None])
    if not model.states:
        return _of_segments(runs, _run_sensitivities(model, *_separate(runs, theta), settings, outputs_alone))
    start = starts_of(model, runs, theta)
    rows, values = _resting(start.status, theta)
    s = start.s[rows] if start.s.size else start.s
    compute = _by_kernel if runs.rests is None or not runs.controlled.any() else _from_controlled
    options: dict[str, Any] = {"s": s, "outputs_alone": outputs_alone} | (moved.options(rows) if moved else {})
    x, y, dx, dy, status, reached = compute(model, runs[rows], start.x0[rows], values, settings, **options)
    x, status, reached, y, dy = _whole(start, rows, runs.dt.shape[1], x, status, reached, y, dy)
    dx = dx if outputs_alone else _spread(dx, rows, len(runs))
    return Sensitivities(x, y, dx, dy, status, reached)


def _separate(runs: Runs, theta: Array) -> tuple[Runs, Array]:
    """The segments of runs of a model without states, each as a run of its own, and their parameters."""
    dt = np.where(runs.dt > 0, runs.dt, 1.0).reshape(-1, 1)
    apart = Runs(np.empty((len(dt), 0)), runs.u.reshape(len(dt), 1, -1), dt)
    return apart, np.repeat(theta, runs.dt.shape[1], axis=0) if theta.ndim == 2 else theta


def _of_segments(runs: Runs, apart: _Result) -> _Result:
    """Results of runs of a model without states, of those of its segments; zero from the first one on that is not ok."""
    shape = runs.dt.shape
    status = np.where(runs.dt > 0, apart.status.reshape(shape), Status.ok)
    good = np.logical_and.accumulate((status == Status.ok) & (runs.dt > 0), axis=1)
    results = {name: getattr(apart, name) for name in apart._fields if name not in ("x", "status", "reached")}
    for name, values in results.items():
        whole = values.reshape(*shape, *values.shape[2:])
        whole[~good] = 0.0
        results[name] = whole
    first = status[np.arange(len(status)), np.argmax(status != Status.ok, axis=1)]
    return apart._replace(
        **results, x=np.empty((shape[0], shape[1] + 1, 0)), status=first.astype(np.int32), reached=good.sum(axis=1)
    )


def _by_kernel(model: Model, runs: Runs, x0: Array, theta: Array, settings: Integration, **options: Any) -> tuple[Any, ...]:
    """x, y, dx, dy, status and reached of runs from known starts x0, which move with theta by the option s."""
    options["measured"] = runs.measured
    return tuple(model.kernels.run_sensitivities(model.core, x0, runs.u, runs.dt, theta, *settings, **options))


def _from_controlled(
    model: Model, runs: Runs, x0: Array, theta: Array, settings: Integration, *, s: Array, outputs_alone: bool, **moved: Any
) -> tuple[Any, ...]:
    """Sensitivities where a controller makes starts depend on parameters that the states do not depend on, as a valve's on leakage.

    A kernel knows which states depend on which parameters, and keeps these derivatives alone. So starts are parameters of their
    own, and what they do is multiplied by s: those of states that a kernel does not have move with all of them.
    """
    p, states = len(model.parameters), names_of(model.states)
    kept = model.states_by_parameters
    missing = (s != 0).any(axis=0) & (True if kept is None else ~kept)
    names = tuple(states[i] for i in np.flatnonzero(missing.any(axis=1)))
    if not names:
        return _by_kernel(model, runs, x0, theta, settings, s=s, outputs_alone=outputs_alone, **moved)
    places = [states.index(name) for name in names]
    by, left = s[:, places], s.copy()  # by is (K, m, p)
    left[:, places] = 0.0
    free = np.zeros((len(runs), len(names)))
    values = np.column_stack([np.broadcast_to(theta, (len(runs), p)), free])
    left = np.concatenate([left, np.zeros((*s.shape[:2], len(names)))], axis=2)
    options = {"s": left, "outputs_alone": outputs_alone} | moved
    x, y, dx, dy, status, reached = _by_kernel(_freed(model, names), runs, x0, values, settings, **options)
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
