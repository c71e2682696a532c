"""Predicted outputs of points and their derivatives by parameters, for many sets of unknowns at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..basics.values import Array, IntArray
from ..data.record_trajectory import first_failure
from ..models import Model
from ..points.experiments import Experiments
from ..points.run_trajectories import checked_run_sensitivities
from ..points.runs import Runs
from ..points.settings import Integration
from ..points.status import Status

MOST_POINTS = 200_000
"""Points, or segments, that the engine is given at once, so that memory stays bounded."""


class Response(NamedTuple):
    """For B sets of P unknowns and N samples: outputs y (B, N, n_y), derivatives dy (B, N, n_y, P) in SI units, status (B,).

    The status is that of the first trajectory that is not ok; y and dy are zero then.
    """

    y: Array
    dy: Array
    status: IntArray


def measurements_response(model: Model, points: Experiments, theta: Array, columns: list[int], settings: Integration) -> Response:
    """The response of K points to parameters theta (B, p), by those in `columns`; settings are known to be good.

    A sample just at a jump has no derivative: it is zero there.
    """
    count, n_points = len(theta), len(points)
    n_y, each = len(model.outputs), max(1, MOST_POINTS // n_points)
    y, dy = np.empty((count, n_points, n_y)), np.empty((count, n_points, n_y, len(columns)))
    status = np.empty((count, n_points), dtype=np.int32)
    for first in range(0, count, each):
        rows = theta[first : first + each]
        many = points[np.tile(np.arange(n_points), len(rows))]
        result = model.kernels.sensitivities(
            model.core, many.x0, many.u, many.dt, np.repeat(rows, n_points, axis=0), *settings, outputs_alone=True
        )
        _, found, _, derivatives, codes = result
        if len(beside := np.flatnonzero(codes == Status.on_jump)):  # no derivative, yet an output where there is one trajectory
            given = many[beside]
            _, found[beside], codes[beside], _ = model.kernels.simulate(
                model.core, given.x0, given.u, given.dt, np.repeat(rows, n_points, axis=0)[beside], *settings
            )
            derivatives[beside] = 0.0
        some = slice(first, first + len(rows))
        y[some] = found.reshape(len(rows), n_points, n_y)
        dy[some] = derivatives[..., columns].reshape(len(rows), n_points, n_y, -1)
        status[some] = codes.reshape(len(rows), n_points)
    return Response(y, dy, first_failure(status))


def runs_response(model: Model, runs: Runs, theta: Array, columns: list[int], settings: Integration) -> Response:
    """Response of the S samples of K runs, run after run."""
    count, (n_runs, segments), n_y = len(theta), runs.dt.shape, len(model.outputs)
    n_samples, each = int(runs.measured.sum()), max(1, MOST_POINTS // (n_runs * segments))
    y, dy = np.empty((count, n_samples, n_y)), np.empty((count, n_samples, n_y, len(columns)))
    status = np.empty((count, n_runs), dtype=np.int32)
    for first in range(0, count, each):
        rows = theta[first : first + each]
        many = runs[np.tile(np.arange(n_runs), len(rows))]
        found = checked_run_sensitivities(model, many, np.repeat(rows, n_runs, axis=0), settings, outputs_alone=True)
        some = slice(first, first + len(rows))
        y[some] = found.y[many.measured].reshape(len(rows), n_samples, n_y)
        dy[some] = found.dy_dtheta[many.measured][..., columns].reshape(len(rows), n_samples, n_y, -1)
        status[some] = found.status.reshape(len(rows), n_runs)
    return Response(y, dy, first_failure(status))
