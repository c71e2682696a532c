"""Predicted outputs of runs and their derivatives by parameters, for many sets of unknowns at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..basics.values import Array, IntArray
from ..data.record_trajectory import first_failure
from ..models import Model
from ..points.run_trajectories import checked_run_sensitivities, checked_run_trajectories
from ..points.runs import Runs
from ..points.settings import Integration
from ..points.status import Status

MOST_SEGMENTS = 200_000
"""Segments that the engine is given at once, so that memory stays bounded."""


class Response(NamedTuple):
    """For B sets of P unknowns and N samples: outputs y (B, N, n_y), derivatives dy (B, N, n_y, P) in SI units, status (B,).

    The status is that of the first trajectory that is not ok; y and dy are zero then.
    """

    y: Array
    dy: Array
    status: IntArray


def response_of_runs(model: Model, runs: Runs, theta: Array, columns: list[int], settings: Integration) -> Response:
    """The response of the S samples of K runs, run after run, to parameters theta (B, p), by those in `columns`.

    Settings are known to be good. A sample just at a jump has no derivative: it is zero there.
    """
    count, (n_runs, segments), n_y = len(theta), runs.dt.shape, len(model.outputs)
    n_samples, each = int(runs.measured.sum()), max(1, MOST_SEGMENTS // (n_runs * segments))
    y, dy = np.empty((count, n_samples, n_y)), np.empty((count, n_samples, n_y, len(columns)))
    status = np.empty((count, n_runs), dtype=np.int32)
    for first in range(0, count, each):
        rows = theta[first : first + each]
        many, values = runs[np.tile(np.arange(n_runs), len(rows))], np.repeat(rows, n_runs, axis=0)
        done = checked_run_sensitivities(model, many, values, settings, outputs_alone=True)
        if len(beside := np.flatnonzero(done.status == Status.on_jump)):  # no derivative, yet an output where there is a trajectory
            along = checked_run_trajectories(model, many[beside], values[beside], settings)
            done.y[beside], done.status[beside], done.dy_dtheta[beside] = along.y, along.status, 0.0
        some = slice(first, first + len(rows))
        y[some] = done.y[many.measured].reshape(len(rows), n_samples, n_y)
        dy[some] = done.dy_dtheta[many.measured][..., columns].reshape(len(rows), n_samples, n_y, -1)
        status[some] = done.status.reshape(len(rows), n_runs)
    return Response(y, dy, first_failure(status))
