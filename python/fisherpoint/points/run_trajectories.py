"""Trajectories and sensitivities of runs, computed by the core."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..basics.values import Array, IntArray
from ..models import Model
from .runs import Runs
from .settings import Settings
from .status import Status, only_finite


class RunTrajectories(NamedTuple):
    """States x (K, N + 1, n_x) at the start and the segments' ends, outputs y (K, N, n_y) at the ends, and status (K,).

    y[k, n] is that of the input of segment n, which has been held up to its end. `reached` (K,) counts the segments that were
    completed. Behind them x is the last state that was reached, and y zero.
    """

    x: Array
    y: Array
    status: IntArray
    reached: IntArray


class RunSensitivities(NamedTuple):
    """As `RunTrajectories`, with dx_dtheta (K, N, n_x, p) and dy_dtheta (K, N, n_y, p) at the ends, per SI unit of each parameter.

    Where the status is not ok they are zero from the segment on that was not completed.
    """

    x: Array
    y: Array
    dx_dtheta: Array
    dy_dtheta: Array
    status: IntArray
    reached: IntArray


def checked_run_trajectories(model: Model, runs: Runs, theta: Array, settings: Settings) -> RunTrajectories:
    """Simulate runs, of arguments that are known to be good."""
    points, (count, segments) = runs.points, runs.dt.shape
    if points is not None:
        end, y, status = model.kernels.simulate(model.core, points.x0, points.u, points.dt, theta, *settings)
        return RunTrajectories(np.stack([points.x0, end], axis=1), y[:, None], status, (status == Status.ok).astype(np.int64))
    x, status, reached = model.kernels.simulate_runs(model.core, runs.x0, runs.u, runs.dt, theta, *settings)
    y = np.zeros((count, segments, len(model.outputs)))
    k, n = np.nonzero(np.arange(segments) < reached[:, None])
    rows = theta[k] if theta.ndim == 2 else np.broadcast_to(theta, (len(k), len(theta)))
    y[k, n] = np.asarray(model.core.output(x[k, n + 1], runs.u[k, n], np.ascontiguousarray(rows))).reshape(len(k), y.shape[2])
    return RunTrajectories(x, y, only_finite(status, x, y), reached)


def checked_run_sensitivities(
    model: Model, runs: Runs, theta: Array, settings: Settings, outputs_alone: bool = False
) -> RunSensitivities:
    """The same with sensitivities; with `outputs_alone` without dx_dtheta, which may take less time."""
    points = runs.points
    if points is not None:
        given = (points.x0, points.u, points.dt, theta, *settings)
        end, y, dx, dy, status = model.kernels.sensitivities(model.core, *given, outputs_alone=outputs_alone)
        x = np.stack([points.x0, end], axis=1)
        return RunSensitivities(x, y[:, None], dx[:, None], dy[:, None], status, (status == Status.ok).astype(np.int64))
    given = (runs.x0, runs.u, runs.dt, theta, *settings)
    return RunSensitivities(
        *model.kernels.run_sensitivities(model.core, *given, measured=runs.measured, s=np.empty(0), outputs_alone=outputs_alone)
    )
