"""Trajectories of records: pieces with constant input, one after the other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..basics.checks import as_float, as_floats_of_shape, by_name, check_type, in_order
from ..basics.quantity import names_of
from ..basics.values import Array, IntArray
from ..models import Model
from ..points.late_outputs import LateEnds, late_places
from ..points.natural_sizes import warn_of_small_states
from ..points.schedule import Earlier, Schedule, scheduled
from ..points.settings import Integration, check_rtol
from ..points.status import Status
from ..show.numbers import counted
from ..show.section import Report, to_html
from ..show.table_preview import first_rows, numbered
from .held_inputs import checked_times, held_inputs


class RecordTrajectory(NamedTuple):
    """States x (N, n_x) and outputs y (N, n_y) at the samples, the status, and the last sample that was reached.

    Behind that sample x and y are those of the state at which the trajectory ended; a y without a finite value is zero.
    """

    x: Array
    y: Array
    status: Status
    reached: int

    def __repr__(self) -> str:
        sizes = f"{counted(len(self.x), 'sample')}, {counted(self.x.shape[1], 'state')}, {counted(self.y.shape[1], 'output')}"
        return f"RecordTrajectory({sizes}; status: {self.status}, {self.reached} reached)"

    def _repr_html_(self) -> str:
        return to_html(Report(repr(self), [first_rows(len(self.x), {**numbered("x", self.x), **numbered("y", self.y)})]))


def simulate_record(
    model: Model,
    t: ArrayLike,
    u: ArrayLike,
    theta: Mapping[str, float] | ArrayLike,
    x0: Mapping[str, float] | ArrayLike = (),
    *,
    before: Mapping[str, float] | ArrayLike | None = None,
    rtol: float = 1e-6,
) -> RecordTrajectory:
    """Simulate one long trajectory under inputs that are held from sample to sample.

    Parameters
    ----------
    model : Model
        Kinks and jumps are crossed.
    t : array_like, (N,)
        Times of the samples, s, increasing; where equations read the time, it is that since t[0].
    u : array_like, (N, n_u)
        u[n] is held from t[n] to t[n+1]; (N,) is taken for a single input.
    theta : mapping by name, or array_like (p,)
        Parameters, SI units.
    x0 : mapping by name, or array_like (n_x,)
        State at t[0], SI units; none for a model without states.
    before : mapping by name, or array_like (n_u,), optional
        Inputs before t[0], SI units, which equations with a dead time still read at first. Default: u[0].
    rtol : float
        Tolerance of each piece between two samples, in units of the states' natural sizes.

    Returns
    -------
    RecordTrajectory
        x, y[n] = g(x(t[n]), u[n], theta), status, reached.

    Raises
    ------
    ValueError
        For wrong shapes or names, and a theta with which the model has no value.
    """
    check_type(model, Model, "model")
    rtol = check_rtol(rtol)
    p, names = len(model.parameters), names_of(model.states)
    theta = as_floats_of_shape(model.theta(theta), (p,), "theta")
    times = checked_times(t)
    inputs = held_inputs(u, len(times))
    if inputs.shape[1] != len(model.inputs):
        raise ValueError(f"u: expected shape ({len(times)}, {len(model.inputs)}), given {inputs.shape}")
    start = in_order(x0, names, "x0") if isinstance(x0, Mapping) else as_floats_of_shape(x0, (len(names),), "x0")
    held = RecordInputs(times - times[0], inputs, _before(before, inputs[0], names_of(model.inputs)))
    x, y, status, reached = record_trajectories(model, theta[None], start[None], held, Integration(rtol))
    warn_of_small_states(model, "the trajectory keeps", x[0, : reached[0] + 1])
    return RecordTrajectory(x[0], y[0], Status(int(status[0])), int(reached[0]))


def _before(given: Mapping[str, float] | ArrayLike | None, first: Array, names: tuple[str, ...]) -> Array:
    if given is None:
        return first
    if isinstance(given, Mapping):
        return np.array(list(by_name({**dict(zip(names, first, strict=True)), **given}, names, "before", as_float).values()))
    return as_floats_of_shape(given, (len(names),), "before")


class RecordInputs(NamedTuple):
    """Times t (N,) of f, the inputs u (N, n_u) that are held from them on, those `before` (n_u,), and those in between."""

    t: Array
    u: Array
    before: Array
    earlier: Earlier | None = None

    def scheduled(self, model: Model, theta: Array, slopes: bool = False) -> tuple[Schedule, Array]:
        """Segments between all switches for parameters (B, p), up to the last sample, and inputs (B, N, n_u) at the samples."""
        count, row, dt = len(theta), np.arange(len(theta))[:, None], np.diff(self.t)
        dt = np.append(dt, dt[-1:] if len(dt) else 1.0)  # which shows what switches at the last sample
        u, before = (np.broadcast_to(of, (count, *of.shape)) for of in (self.u, self.before))
        every, since = np.broadcast_to(dt, (count, len(dt))), float(self.t[0])
        found = scheduled(model, u, every, before, theta, self.earlier, since, slopes)
        ends = found.ends[:, :-1]
        first = np.concatenate([np.zeros((count, 1), dtype=np.intp), ends + 1], axis=1)
        late = np.arange(found.dt.shape[1]) >= first[:, -1:]
        length = int(first.max(initial=1)) if len(self.t) > 1 else 1
        moved = np.where(late[:, :, None], np.int32(-1), found.moved)
        of_late = LateEnds(*(of[:, :-1] for of in found.late))
        some = found._replace(dt=np.where(late, 0.0, found.dt), ends=ends, moved=moved, late=of_late)
        return some.until(length), found.u[row, first]


def record_trajectories(
    model: Model, theta: Array, x0: Array, held: RecordInputs, settings: Integration
) -> tuple[Array, Array, IntArray, IntArray]:
    """x (B, N, n_x), y (B, N, n_y), status (B,) and last sample reached (B,) for B starts and parameter sets."""
    t, u = held.t, held.u
    count, samples = len(theta), len(t)
    inputs, past = np.tile(u, (count, 1)), dict[int, Array]()
    if not model.states:
        rows = np.repeat(theta, samples, axis=0)
        none, ones = np.empty((count * samples, 0)), np.ones(count * samples)
        _, y, ended, _ = model.kernels.simulate(model.core, none, inputs, ones, rows, *settings)
        x, failed = np.empty((count, samples, 0)), ended.reshape(count, samples)
        status, reached = first_failure(failed), np.full(count, samples - 1)
    elif model.divides_segments:
        found, at_samples = held.scheduled(model, theta)
        given = model.at(x0, t[0]), found.u, found.dt
        x, status, reached = model.kernels.simulate_runs(model.core, *given, theta, *settings, **found.of_states())
        past = _late_outputs(model, found, x, u[0], theta, t[0])
        x = x[np.arange(count)[:, None], np.concatenate([np.zeros_like(found.ends[:, :1]), found.ends + 1], axis=1)[:, :samples]]
        reached, inputs = (found.ends < reached[:, None]).sum(axis=1), at_samples.reshape(len(inputs), -1)
    else:
        x, status, reached = model.kernels.simulate_runs(model.core, model.at(x0, t[0]), u[:-1], np.diff(t), theta, *settings)
    if model.states:
        states = model.at(x, t).reshape(count * samples, -1)
        y = model.core.output(states, inputs, np.repeat(theta, samples, axis=0))
        failed = np.zeros((count, samples), dtype=np.int32)
    y = y.reshape(count, samples, -1)
    for i, values in past.items():
        y[:, 1:, i] = values
    failed[(failed == Status.ok) & ~(np.isfinite(y).all(axis=2) & np.isfinite(x).all(axis=2))] = Status.not_finite
    status = np.where(status == Status.ok, first_failure(failed), status)
    reached = np.minimum(reached, np.argmax(failed != Status.ok, axis=1) - 1, out=reached, where=failed.any(axis=1))
    return np.where(np.isfinite(x), x, 0.0), np.where(np.isfinite(y), y, 0.0), status, np.maximum(reached, 0)


def _late_outputs(model: Model, found: Schedule, x: Array, u: Array, theta: Array, since: float) -> dict[int, Array]:
    """By their places late outputs (B, N - 1) behind the first sample, of states x (B, S + 1, n_x) at the ends of parts."""
    shown, row = {}, np.arange(len(x))[:, None]
    t = since + np.concatenate([np.zeros((len(x), 1)), np.cumsum(found.dt, axis=1)], axis=1)
    for i, _, g in late_places(model):
        at = found.late.ends[:, :, g] + 1
        states = model.at(x[row, at], t[row, at]).reshape(at.size, -1)
        values = model.core.output(states, np.tile(u, (at.size, 1)), np.repeat(theta, at.shape[1], axis=0))
        shown[i] = np.asarray(values).reshape(*at.shape, -1)[..., i]
    return shown


def first_failure(status: IntArray) -> IntArray:
    """Return the first status of each row (B, n) that is not ok."""
    if not status.shape[1]:
        return np.zeros(len(status), dtype=np.int32)
    return np.take_along_axis(status, np.argmax(status != Status.ok, axis=1)[:, None], axis=1)[:, 0]
