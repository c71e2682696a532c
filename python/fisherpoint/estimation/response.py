"""Predicted outputs of runs and records and their derivatives, for many sets of unknowns at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.checks import check_type
from ..basics.quantity import names_of
from ..basics.values import Array, IntArray
from ..data.record import Record
from ..data.record_trajectory import first_failure, record_trajectories
from ..models import Model
from ..points.late_outputs import Along, late_places
from ..points.parameter_checks import sensible
from ..points.run_trajectories import checked_run_sensitivities, checked_run_trajectories
from ..points.runs import Runs
from ..points.schedule import Schedule
from ..points.settings import Integration, check_rtol, resolve_threads
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
    """The response of the S samples of K runs, run after run, to parameters theta (B, p), or (B, K, p), by those in `columns`.

    Settings are known to be good. A sample just at a jump has no derivative: it is zero there.
    """
    count, (n_runs, segments), n_y = len(theta), runs.dt.shape, len(model.outputs)
    n_samples, each = int(runs.measured.sum()), max(1, MOST_SEGMENTS // (n_runs * segments))
    y, dy = np.empty((count, n_samples, n_y)), np.empty((count, n_samples, n_y, len(columns)))
    status = np.empty((count, n_runs), dtype=np.int32)
    for first in range(0, count, each):
        rows = theta[first : first + each]
        many, values = runs[np.tile(np.arange(n_runs), len(rows))], _of_runs(rows, n_runs)
        done = checked_run_sensitivities(model, many, values, settings, outputs_alone=True)
        if len(beside := np.flatnonzero(done.status == Status.on_jump)):  # no derivative, yet an output where there is a trajectory
            along = checked_run_trajectories(model, many[beside], values[beside], settings)
            done.y[beside], done.status[beside], done.dy_dtheta[beside] = along.y, along.status, 0.0
        some = slice(first, first + len(rows))
        y[some] = done.y[many.measured].reshape(len(rows), n_samples, n_y)
        dy[some] = done.dy_dtheta[many.measured][..., columns].reshape(len(rows), n_samples, n_y, -1)
        status[some] = done.status.reshape(len(rows), n_runs)
    return Response(y, dy, first_failure(status))


def _of_runs(theta: Array, n_runs: int) -> Array:
    return np.repeat(theta, n_runs, axis=0) if theta.ndim == 2 else theta.reshape(-1, theta.shape[2])


_BLOCK = 1 << 14
"""Pieces whose sensitivities are held at a time."""

_MOST = 1 << 23
"""Numbers of S that are held at a time where records are followed in one."""


_ON_JUMP, _AHEAD = 1e-12, 1e-3
"""Value below which a start is on a jump, and the share of a segment after which it is seen whether it has left that."""


class RecordResponse:
    """The response of a record for many sets of unknowns at once.

    The states come first, piece after piece. Then every piece between two samples is an experiment point of its own, which starts
    where the last one ended, so that the pieces of all records run side by side: they give Gamma_n = dx_{n+1}/dtheta and
    Phi_n = dx_{n+1}/dx_n. With S_n = dx_n/d(theta, start) the chain rule carries them along the record,

        S_{n+1} = Phi_n S_n + Gamma_n,    dy_n = g_x S_n + g_theta,

    from S_0 = 0 in the columns of parameters, and the identity's in those of unknown starts. Where a piece ends next to a jump, the
    pieces by themselves do not know which of them passes it; such a record is followed in one.

    Parameters
    ----------
    model : Model
        A jump that is not in `Model.crossable` ends a record as `Status.met_jump`.
    record : Record
    columns : sequence of int
        Places, among the model's parameters, of those by which to differentiate.
    rtol : float
        Tolerance of each piece.
    threads : int, optional
        Number of threads; the default is every core.

    Attributes
    ----------
    starts : tuple of str
        States whose start is not known, in the model's order.

    Raises
    ------
    ValueError
        Where the record is not one of the model.
    """

    def __init__(
        self, model: Model, record: Record, columns: Sequence[int], rtol: float = 1e-6, threads: int | None = None
    ) -> None:
        check_type(model, Model, "model")
        check_type(record, Record, "record")
        rtol = check_rtol(rtol)
        record.check(model)
        self.model, self.record = model, record
        self.columns = np.array(columns, dtype=np.intp).reshape(-1)
        p = len(model.parameters)
        if len(set(self.columns.tolist())) < len(self.columns) or not ((self.columns >= 0) & (self.columns < p)).all():
            raise ValueError(f"columns: expected different indices below {p}, given {self.columns.tolist()}")
        self._free = np.array([i for i, name in enumerate(names_of(model.states)) if name not in record.x0], dtype=np.intp)
        self.starts = tuple(names_of(model.states)[i] for i in self._free)
        self._settings = Integration(rtol, threads=resolve_threads(threads))

    def __call__(self, theta: Array, x0: Array) -> Response:
        """Respond to B sets of unknowns.

        Parameters
        ----------
        theta : ndarray, (B, p)
            All parameters of the model.
        x0 : ndarray, (B, n_x)
            The full state at the first sample.

        Returns
        -------
        Response
            y (B, N, n_y), dy (B, N, n_y, P) and status (B,), with P = len(columns) + len(starts) and the starts last.
        """
        count, (n_x, p) = len(theta), (len(self.model.states), len(self.model.parameters))
        for name, array, width in (("theta", theta, p), ("x0", x0, n_x)):
            if array.shape != (count, width):
                raise ValueError(f"{name}: expected shape ({count}, {width}), given {array.shape}")
        sizes = (count, len(self.record), len(self.model.outputs))
        y, dy = np.zeros(sizes), np.zeros((*sizes, len(self.columns) + len(self.starts)))
        status = self._sense(theta, x0)
        rows = np.flatnonzero(status == Status.ok)
        if len(rows):
            x, y[rows], status[rows], _ = record_trajectories(self.model, theta[rows], x0[rows], self.record.inputs, self._settings)
            kept = status[rows] == Status.ok
            rows, x = rows[kept], x[kept]
        if len(rows):
            # What is remembered, set anew between pieces, or shown later.
            whole = self.model.latches or self.model.updates or self.model.late_outputs
            follow = self._static if not n_x else self._in_one if whole else self._carried
            dy[rows], status[rows] = follow(theta[rows], x)
        finite = np.isfinite(dy).all(axis=(1, 2, 3))
        status[(status == Status.ok) & ~finite] = Status.not_finite
        y[status != Status.ok], dy[status != Status.ok] = 0.0, 0.0
        return Response(y, dy, status)

    def _sense(self, theta: Array, x0: Array) -> IntArray:
        """Statuses of rows that need no trajectory to be refused."""
        status = np.where(np.isfinite(theta).all(axis=1) & np.isfinite(x0).all(axis=1), Status.ok, Status.not_finite)
        rows = np.flatnonzero(status == Status.ok)
        status[rows[~sensible(self.model, theta[rows])]] = Status.left_domain
        return status.astype(np.int32)

    def _static(self, theta: Array, _: Array) -> tuple[Array, IntArray]:
        """Derivatives of the outputs of a model without states, each sample a point of its own."""
        count, samples = len(theta), len(self.record)
        none, ones = np.empty((count * samples, 0)), np.ones(count * samples)
        points = (none, np.tile(self.record.u, (count, 1)), ones, np.repeat(theta, samples, axis=0))
        _, _, _, dy, status = self.model.kernels.sensitivities(self.model.core, *points, *self._settings, outputs_alone=True)
        dy = dy[..., self.columns].reshape(count, samples, dy.shape[1], len(self.columns))
        return dy, first_failure(status.reshape(count, samples))

    def _in_one(self, theta: Array, x: Array) -> tuple[Array, IntArray]:
        """Derivatives by whole trajectories, some records at a time: slower, where a record is long."""
        model, (count, samples, n_x), p = (
            self.model.free_start(*self.starts) if self.starts else self.model,
            x.shape,
            theta.shape[1],
        )
        columns = np.concatenate([self.columns, p + np.arange(len(self.starts))])
        dy, status = np.empty((count, samples, len(model.outputs), len(columns))), np.empty(count, dtype=np.int32)
        given = np.column_stack([theta, np.zeros((count, len(self.starts)))])
        parts = samples * (4 if model.late_outputs else 1)
        each = max(1, _MOST // (parts * n_x * given.shape[1]))
        for first in range(0, count, each):
            rows = slice(first, min(first + each, count))
            values, n = given[rows], rows.stop - first
            u, dt = (np.repeat(of[None], n, axis=0) for of in (self.record.u[:-1], np.diff(self.record.t)))
            at_samples, options = np.tile(self.record.u, (n, 1)), {"s": np.empty(0), "doubts": True}
            measured = np.zeros(dt.shape, dtype=bool)
            if scheduled := model.divides_segments:
                found, inputs = self.record.inputs.scheduled(model, values, slopes=True)
                u, dt, at_samples, options = found.u, found.dt, inputs.reshape(len(at_samples), -1), options | found.options()
                measured = found.late.flags(np.ones(found.ends.shape, dtype=bool), dt.shape[1])
            start = model.at(x[rows, 0], self.record.since[0])
            whole_x, y, dx, past, status[rows], _ = model.kernels.run_sensitivities(
                model.core, start, u, dt, values, *self._settings, measured=measured, **options
            )
            dx = dx[np.arange(n)[:, None], found.ends] if scheduled else dx
            s = np.concatenate([np.zeros((n, 1, n_x, dx.shape[3])), dx], axis=1)[..., columns]
            s[..., self._free, len(self.columns) + np.arange(len(self.starts))] += 1.0
            states = self._shifted.at(x[rows], self.record.since)
            points = states.reshape(n * samples, -1), at_samples, np.repeat(values, samples, axis=0)
            offsets = np.column_stack([points[2][:, :p], np.zeros((len(points[2]), n_x))])
            g = self._shifted.core.output_jacobian(*points[:2], offsets).reshape(n, samples, -1, p + n_x)
            doubtful = np.isnan(s)
            with np.errstate(all="ignore"):  # what overflows is given a status
                dy[rows] = g[..., p:] @ np.where(doubtful, 0.0, s)
                dy[rows, ..., : len(self.columns)] += g[..., self.columns]
            # A sample whose outputs feel a jump that is met in its instant has no derivative, and adds no information.
            felt = ((g[..., p:] != 0).astype(float) @ doubtful).any(axis=(-2, -1))
            dy[rows][felt] = 0.0
            if model.late_outputs:
                late = found.late.values(model, np.zeros((n, samples - 1, *past.shape[2:])), past, np.zeros(past[:, 0].shape))
                along = Along(whole_x, y, u, dt, values, self.record.since[0])
                late = found.late.moved(model, late, along)[..., columns]
                for i, _, of in late_places(model):
                    begins = (found.late.ends[:, :, of] < 0)[..., None]
                    dy[rows, 1:, i] = np.where(begins, dy[rows, :1, i], late[:, :, i])
        return dy, status

    @cached_property
    def _shifted(self) -> Model:
        """The model with offsets of all states as further parameters: by these its derivatives are those by the state."""
        return self.model.free_start(*names_of(self.model.states))

    def _pieces(self, theta: Array) -> tuple[Callable[[slice], Array], Callable[..., tuple[Array, IntArray]]]:
        """Functions of samples: the inputs there, and of the pieces from them on dx and statuses; records of a sample together."""
        model, count = self._shifted, len(theta)
        if not model.delays:
            u, dt = self.record.u, np.diff(self.record.t)

            def of_points(at: slice, *rows: Array) -> tuple[Array, IntArray]:
                states, inputs, parameters = rows
                _, _, slopes, _, ended = model.kernels.sensitivities(
                    model.core, states, inputs, np.repeat(dt[at], count), parameters, *self._settings, whole_first=True
                )
                return slopes, ended

            return lambda at: np.repeat(u[at], count, axis=0), of_points

        # A piece is a run of as many segments as there are between the switches in it.
        found, inputs = self.record.inputs.scheduled(model, theta)
        first = np.concatenate([np.zeros_like(found.ends[:, :1]), found.ends[:, :-1] + 1], axis=1)

        def of_runs(at: slice, states: Array, _: Array, parameters: Array) -> tuple[Array, IntArray]:
            last = (found.ends - first)[:, at].T.reshape(-1)
            lane, number = np.tile(np.arange(count), len(last) // count)[:, None], np.arange(last.max(initial=0) + 1)
            places = np.minimum(first[:, at].T.reshape(-1, 1) + number, found.dt.shape[1] - 1)
            dt = np.where(number <= last[:, None], found.dt[lane, places], 0.0)
            options: dict[str, Any] = {
                "measured": np.zeros(dt.shape, dtype=bool),
                "s": np.empty(0),
                "doubts": True,
                "whole_first": True,
            }
            options |= found.options((lane, places))
            _, _, dx, _, ended, _ = model.kernels.run_sensitivities(
                model.core, states, found.u[lane, places], dt, parameters, *self._settings, **options
            )
            slopes = dx[np.arange(len(last)), last]
            unsure = np.isnan(slopes).any(axis=(1, 2))
            if at.start == 0:
                unsure[:count] |= self._leaves_jump(found, states[:count], parameters[:count])
            return slopes, np.where((ended == Status.ok) & unsure, np.int32(Status.on_jump), ended)

        return lambda at: inputs[:, at].swapaxes(0, 1).reshape(-1, inputs.shape[2]), of_runs

    def _leaves_jump(self, found: Schedule, x: Array, theta: Array) -> NDArray[np.bool_]:
        """Whether records (B,) start on a jump where their input switches, off which that before would move them."""
        model, jumps = self._shifted, len(self._shifted.jumps)
        leaves = np.zeros(len(x), dtype=bool)
        if not jumps or not found.moved.size:
            return leaves
        for moved, before in zip(found.moved[:, 0].T, found.moved_u[:, 0].swapaxes(0, 1), strict=True):
            rows = np.flatnonzero(moved >= 0)
            given = x[rows], before[rows], theta[rows]
            on = np.abs(np.asarray(model.core.switching(*given))[:, :jumps]) < _ON_JUMP
            ahead, _, _, _ = model.kernels.simulate(model.core, *given[:2], _AHEAD * found.dt[rows, 0], given[2], *self._settings)
            off = np.abs(np.asarray(model.core.switching(model.at(ahead, self.record.since[0]), *given[1:]))[:, :jumps]) > _ON_JUMP
            leaves[rows] |= (on & off).any(axis=1)
        return leaves

    def _carried(self, theta: Array, x: Array) -> tuple[Array, IntArray]:
        """dy (B, N, n_y, P) along trajectories x (B, N, n_x), and statuses."""
        (count, samples, n_x), p, unknowns = x.shape, theta.shape[1], len(self.columns)
        model = self._shifted
        offsets = np.column_stack([theta, np.zeros((count, n_x))])
        u, slopes_of = self._pieces(offsets)
        status = np.zeros(count, dtype=np.int32)
        dy = np.empty((count, samples, len(model.outputs), unknowns + len(self.starts)))
        s = np.zeros((count, n_x, dy.shape[3]))
        s[:, self._free, unknowns + np.arange(len(self.starts))] = 1.0
        length = max(_BLOCK // count, 1)
        for first in range(0, samples, length):
            at = slice(first, min(first + length, samples))
            n, pieces = at.stop - first, min(at.stop, samples - 1) - first
            # In time's order, all records of a sample together.
            states = model.at(x[:, at], self.record.since[at]).swapaxes(0, 1).reshape(n * count, -1)
            rows = states, u(at), np.tile(offsets, (n, 1))
            g = model.core.output_jacobian(*rows).reshape(n, count, -1, p + n_x)
            slopes, ended = slopes_of(slice(first, first + pieces), *(of[: pieces * count] for of in rows))
            ended, slopes = ended.reshape(pieces, count), slopes.reshape(pieces, count, n_x, p + n_x)
            status = np.where(status == Status.ok, first_failure(ended.T), status)
            gamma, phi = slopes[..., self.columns], np.ascontiguousarray(slopes[..., p:]) + np.eye(n_x)
            along = np.empty((n, *s.shape))
            with np.errstate(all="ignore"):  # what overflows is given a status
                for k in range(n):
                    along[k] = s
                    if k < pieces:
                        s = phi[k] @ s
                        s[..., :unknowns] += gamma[k]
                slope = g[..., p:] @ along
            slope[..., :unknowns] += g[..., self.columns]
            dy[:, at] = slope.swapaxes(0, 1)
        unsure = np.flatnonzero(status if self.model.delays else status == Status.on_jump)
        if len(unsure):
            dy[unsure], status[unsure] = self._in_one(theta[unsure], x[unsure])
        return dy, status
