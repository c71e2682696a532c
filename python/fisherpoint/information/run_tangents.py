"""The sensitivities of runs, and their rows as the Fisher matrix takes them.

F of a run is the sum over its samples, as long as only white sensor noise moves them; `noise.sensors` has the rows of other noise.
What is drawn anew in each run, its start and what `varies`, moves all its samples at once: with H their tangents by it and P its
squared standard deviations, the covariance of what a run measures is one matrix, R_k = I x R + H P H^T, and F = J^T R_k^-1 J. Here
each sample has rows such that F is a sum over samples again: J is multiplied by (I x R)^1/2 R_k^-1/2, so that D = R whitens them as
it does those of points.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array, IntArray
from ..models import Model
from ..noise.common_error import CommonError
from ..points.late_outputs import Along, LateEnds
from ..points.run_trajectories import checked_run_sensitivities
from ..points.runs import Runs
from ..points.schedule import before_all, output_delays, scheduled_runs
from ..points.settings import Integration
from ..points.status import Status, only_finite
from .assumed import Assumed
from .problem import DesignProblem
from .white_rows import white_rows


class RunRows(NamedTuple):
    """Rows of K runs: sensitivities (K, N, n_y, p), standardised and such that D = R whitens them, zero where nothing is measured.

    The statuses are (K,); where one is not ok, all its rows are zero.
    """

    sensitivity: Array
    status: IntArray

    def samples(self, runs: Runs) -> tuple[Array, IntArray]:
        """The rows (S, n_y, p) of the samples, run after run, and their statuses (S,)."""
        run, _ = np.nonzero(runs.measured)
        return self.sensitivity[runs.measured], self.status[run]


class RunTangents(NamedTuple):
    """K runs with their states x (K, N + 1, n_x) and the sensitivities of states and outputs, of the model with what is assumed.

    theta (K, q) are the parameters of that model.
    """

    runs: Runs
    theta: Array
    x: Array
    y: Array  # (K, N, n_y)
    dx: Array  # (K, N, n_x, q), or none
    dy: Array  # (K, N, n_y, q)
    status: IntArray

    def some(self, rows: NDArray[np.intp]) -> RunTangents:
        """Those of some of the runs."""
        x, y, dy, status = self.x[rows], self.y[rows], self.dy[rows], self.status[rows]
        return RunTangents(self.runs[rows], self.theta[rows], x, y, self.dx[rows] if len(self.dx) else self.dx, dy, status)

    def rows(self, problem: DesignProblem, informative: NDArray[np.bool_] | None = None, place: Array | None = None) -> RunRows:
        """The rows as the Fisher matrix takes them; outputs not `informative` (K, N, n_y), or not measured, have no weight.

        With a `place`, uneven readings inform as they do there: see `white_rows`.
        """
        assumed = problem.assumed
        there = informed(self.runs, informative) & problem.measured
        there = there[..., None]
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is given a status
            scaled = np.where(there, problem.standardised(self.dy), 0.0)
            status = only_finite(self.status, scaled)
            if not problem.white_alone:
                times = np.cumsum(self.runs.dt, axis=1)
                scaled, status = white_rows(problem, scaled, self.dy, times, self.y, there[..., 0], status, place)
            elif assumed is not None and assumed.columns:
                moved = np.where(there, self.dy[..., assumed.columns] * assumed.std, 0.0)
                status = only_finite(status, moved)
                noise = np.sqrt(np.diag(problem.noise_covariance))[:, None]
                rows, by = ((array / noise).reshape(len(array), -1, array.shape[3]) for array in (scaled, moved))
                scaled = noise * CommonError.of(by).whitened(rows).reshape(scaled.shape)
                status = only_finite(status, scaled)
        scaled[status != Status.ok] = 0.0
        return RunRows(scaled, status)


def informed(runs: Runs, informative: NDArray[np.bool_] | None) -> NDArray[np.bool_]:
    """Outputs with information, (K, N, n_y) or (K, N, 1) of all: those that are measured, or of these the `informative` ones."""
    if informative is None or runs.by_output is None:
        return runs.readings if informative is None else informative
    return runs.by_output & informative


def run_tangents(
    problem: DesignProblem, runs: Runs, theta: Array, settings: Integration, outputs_alone: bool = False
) -> RunTangents:
    """States and sensitivities along runs."""
    model, values = _extended(problem, theta)
    result = checked_run_sensitivities(model, runs, values, settings, outputs_alone=outputs_alone)
    theta = np.broadcast_to(values, (len(runs), values.shape[-1]))
    return RunTangents(runs, theta, result.x, result.y, result.dx_dtheta, result.dy_dtheta, result.status)


def tangents_from(
    problem: DesignProblem,
    base: RunTangents,
    own: NDArray[np.intp],
    runs: Runs,
    theta: Array,
    settings: Integration,
    outputs_alone: bool = True,
) -> RunTangents:
    """Tangents of runs that equal base.runs[own] up to some segment; they are computed from there on."""
    model, values = _extended(problem, theta)
    n = runs.dt.shape[1]
    first = np.minimum(runs.first_difference(base.runs, own), runs.segments - 1)
    begin = _begin(model, runs, values, first)
    whole = (begin == 0) | (runs.controlled if runs.rests is not None else False)  # how these start, base.dx may not have all of
    x, y, dx, dy = _first(base.x, own, n + 1), _first(base.y, own, n), _first(base.dx, own, n), _first(base.dy, own, n)
    status = base.status[own]
    if model.latches:  # what they remember at a sample is not kept
        whole = np.ones_like(whole)
    whole |= before_all(model, values, len(runs))  # which have no trajectory
    if whole.any():
        done = checked_run_sensitivities(model, runs[whole], values[whole], settings, outputs_alone=outputs_alone)
        x[whole], y[whole], dy[whole], status[whole] = done.x, done.y, done.dy_dtheta, done.status
        if not outputs_alone:
            dx[whole] = done.dx_dtheta
    rest = np.flatnonzero(~whole)
    if len(rest):
        from_segment = begin[rest]
        since = np.cumsum(runs.dt[rest], axis=1)[np.arange(len(rest)), from_segment - 1]
        x0 = model.at(x[rest, from_segment], since)
        s = base.dx[own[rest], from_segment - 1]
        given, number, late, options = _behind(model, runs[rest], values[rest], from_segment)
        new_x, new_y, new_dx, new_dy, status[rest], _ = model.kernels.run_sensitivities(
            model.core, x0, *given, values[rest], *settings, s=s, outputs_alone=outputs_alone, **options
        )
        row, of_ends = np.arange(len(rest))[:, None], np.maximum(number, 0)
        behind = np.arange(n) >= first[rest][:, None]
        k, m = np.nonzero(behind)
        x[rest[k], m + 1] = new_x[k, number[k, m] + 1]
        k, m = np.nonzero(behind & (runs.dt[rest] > 0))
        if not outputs_alone:
            dx[rest[k], m] = new_dx[k, number[k, m]]
        shown, slopes = new_y[row, of_ends], new_dy[row, of_ends]
        if late is not None:
            shown = late.values(model, shown, new_y, shown[:, 0])
            along = Along(new_x, new_y, *given, values[rest], since[:, None])
            slopes = late.moved(model, late.values(model, slopes, new_dy, slopes[:, 0]), along)
        y[rest[k], m], dy[rest[k], m] = shown[k, m], slopes[k, m]
    return RunTangents(runs, values, x, y, dx, dy, status)


def _first(values: Array, own: NDArray[np.intp], n: int) -> Array:
    """Values (K, N, ...) of some rows for the first n segments; those of more segments than there are get values of their own."""
    width = [(0, 0), (0, max(0, n - values.shape[1])), *[(0, 0)] * (values.ndim - 2)]
    return values[own] if values.shape[1] == n else np.pad(values[own, :n], width)


def _begin(model: Model, runs: Runs, theta: Array, first: NDArray[np.intp]) -> NDArray[np.intp]:
    """The segments (K,) from which on runs are computed, so that outputs are known from `first` on: earlier where they are late."""
    if not model.late_outputs:
        return first
    since = np.cumsum(runs.dt, axis=1)
    shown = np.where(first > 0, since[np.arange(len(runs)), first - 1], 0.0) - output_delays(model, theta, len(runs)).max(axis=1)
    return np.asarray(np.minimum(first, np.maximum((since <= shown[:, None]).sum(axis=1) - 1, 0)))


def _behind(
    model: Model, runs: Runs, theta: Array, first: NDArray[np.intp]
) -> tuple[tuple[Array, Array], NDArray[np.intp], LateEnds | None, dict[str, Any]]:
    """Segments u and dt of runs from `first` (K,) on, their numbers (K, N) among these, -1 before, and options of the kernel.

    Where late outputs are known is given by the same numbers.
    """
    found = scheduled_runs(model, runs, theta, slopes=True)[1] if model.divides_segments else None
    u, dt = (runs.u, runs.dt) if found is None else (found.u, found.dt)
    ends = np.broadcast_to(np.arange(runs.dt.shape[1]), runs.dt.shape) if found is None else found.ends
    row = np.arange(len(runs))[:, None]
    begin = ends[row[:, 0], first - 1] + 1
    number = np.where(np.arange(ends.shape[1]) < first[:, None], -1, ends - begin[:, None])
    places = begin[:, None] + np.arange(dt.shape[1])
    there, places = places < dt.shape[1], np.minimum(places, dt.shape[1] - 1)
    flags = runs.measured if found is None else found.measured(model, runs.measured)
    options = {"measured": flags[row, places] & there} | ({} if found is None else found.options((row, places)))
    late = found.late.behind(begin[:, None]) if found is not None and model.late_outputs else None
    return (u[row, places], np.where(there, dt[row, places], 0.0)), number, late, options


def _extended(problem: DesignProblem, theta: Array) -> tuple[Model, Array]:
    """The model with what is assumed among its parameters, and their values (K, q)."""
    assumed = problem.assumed
    return (problem.limited, theta) if assumed is None else (assumed.model, assumed.theta(theta))


def moves_of_runs(assumed: Assumed, runs: Runs, theta: Array, settings: Integration) -> tuple[Array, IntArray]:
    """Moves of outputs with a standard deviation of all that is drawn anew, (K, N, n_y, q), and statuses (K,).

    Zero where nothing is measured, and where the status is not ok; theta is (p,).
    """
    result = checked_run_sensitivities(assumed.model, runs, assumed.theta(theta), settings, outputs_alone=True)
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is given a status
        moved = np.where(runs.readings[..., None], result.dy_dtheta[..., assumed.columns] * assumed.std, 0.0)
    status = only_finite(result.status, moved)
    moved[status != Status.ok] = 0.0
    return moved, status
