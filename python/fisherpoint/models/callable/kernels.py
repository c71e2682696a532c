"""Trajectories, sensitivities and predictive covariances of models that are Python functions."""

from __future__ import annotations

import warnings
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from ...basics.messages import stacklevel_of_user
from ...basics.values import Array, IntArray
from ...engine import _core
from .core import CallableCore
from .integration import NOT_FINITE, OK, STEP_LIMIT, integrate, static_status
from .tangents import rounding, tangents

Settings = tuple[float, bool, bool, str, int]
"""rtol, whether kinks and jumps are crossed, the method, and threads: jumps never are crossed, and there is one thread."""

MOST_ROUNDING = 1e-3
"""Share of a sensitivity that differences may lose."""


def simulate(
    model: CallableCore, x0: Array, u: Array, dt: Array, theta: Array, *settings: *Settings
) -> tuple[Array, Array, IntArray, Array]:
    """x, y, status, and until when a trajectory was followed: not at all where it is not ok."""
    rows = _rows(theta, len(dt))
    x, status = np.array(x0), np.zeros(len(dt), dtype=np.int32)
    for k in range(len(dt)):
        x[k], status[k] = _end(model, x0[k], u[k], dt[k], rows[k], settings)
    y, status = _outputs(model, x, u, rows, status)
    return x, y, status, np.where(status == OK, dt, 0.0)


def sensitivities(
    model: CallableCore,
    x0: Array,
    u: Array,
    dt: Array,
    theta: Array,
    *settings: *Settings,
    whole_first: bool = False,
    outputs_alone: bool = False,
    states_later: bool = False,
) -> tuple[Array, Array, Array, Array, IntArray]:
    """x, y, dx_dtheta, dy_dtheta, status; SciPy chooses the first step, and dx_dtheta comes at no cost."""
    count, n_x, p = len(dt), model.n_x, theta.shape[-1]
    rows = _rows(theta, count)
    by_complex_step = model.takes_complex(x0, u, rows)
    x, status = np.array(x0), np.zeros(count, dtype=np.int32)
    dx, dy = np.zeros((count, n_x, p)), np.zeros((count, model.n_y, p))
    start = perf_counter()
    for k in range(count):
        x[k], dx[k], dy[k], status[k] = _sensed(model, x0[k], dx[k], u[k], dt[k], rows[k], settings, by_complex_step)
    y, status = _outputs(model, x, u, rows, status)
    dx[status != OK], dy[status != OK] = 0.0, 0.0
    if count:
        _warn_of_sensitivities(model, by_complex_step, p, (perf_counter() - start) / count)
    return x, y, dx[: 0 if outputs_alone else count], dy, status


def _sensed(
    model: CallableCore, x0: Array, s0: Array, u: Array, dt: float, theta: Array, settings: Settings, by_complex_step: bool
) -> tuple[Array, Array, Array, int]:
    """x, dx_dtheta, dy_dtheta and status at the end, from a start with dx_dtheta s0 (n_x, p)."""
    n_x, p = s0.shape
    size = np.where(theta != 0, np.abs(theta), 1.0)  # one step along a parameter is relative

    def derivative(z: Array) -> Array:
        state, s = z[:n_x], z[n_x:].reshape(n_x, p)
        rates, along = tangents(model.rhs, state, s, u, theta, size, model.scale, by_complex_step)
        return np.concatenate([rates, along.ravel()])

    path: list[tuple[Array, Array]] = []
    if n_x:
        z0 = np.concatenate([x0, (s0 * size).ravel()])
        z, status = integrate(model, derivative, z0, u, dt, theta, *_steps(settings), path)
        if status == OK and not by_complex_step and _rounded(model, path, u, theta) > MOST_ROUNDING:
            status = STEP_LIMIT
    else:
        z, status = np.empty(0), static_status(model, x0, u, theta)
    x, s = z[:n_x], z[n_x:].reshape(n_x, p)
    if status != OK:
        return x, np.zeros((n_x, p)), np.zeros((model.n_y, p)), status
    _, along = tangents(model.output, x, s, u, theta, size, model.scale, by_complex_step)
    dx, dy = s / size, along / size
    return x, dx, dy, OK if np.isfinite(dx).all() and np.isfinite(dy).all() else NOT_FINITE


def _rounded(model: CallableCore, path: list[tuple[Array, Array]], u: Array, theta: Array) -> float:
    """What differences have lost of the sensitivities along a trajectory."""
    t, z = np.concatenate([t for t, _ in path]), np.hstack([z for _, z in path]).T
    x, s = z[:, : model.n_x], z[:, model.n_x :].reshape(len(z), model.n_x, -1)
    rates = np.asarray(model.rhs(x, _rows(u, len(z)), _rows(theta, len(z))), dtype=np.float64)
    return rounding(t, x, s, rates, model.scale)


def _warn_of_sensitivities(model: CallableCore, by_complex_step: bool, p: int, seconds: float) -> None:
    kind = "complex step" if by_complex_step else "central differences (the functions do not take complex numbers)"
    what = (
        f"1 integration of {model.n_x * (p + 1)} states per point, with {(p if by_complex_step else 2 * p) + 1} rows per evaluation"
    )
    _warn(model, f"sensitivities by {kind}", what, seconds)


def simulate_runs(
    model: CallableCore, x0: Array, u: Array, dt: Array, theta: Array, *settings: *Settings
) -> tuple[Array, IntArray, NDArray[np.int64]]:
    """x (K, N + 1, n_x), status, segments that were completed."""
    count, segments = len(x0), dt.shape[-1]
    rows = _rows(theta, count)
    u, dt = np.broadcast_to(u, (count, *u.shape[-2:])), np.broadcast_to(dt, (count, segments))
    x, status = np.repeat(x0[:, None], segments + 1, axis=1), np.zeros(count, dtype=np.int32)
    reached = np.zeros(count, dtype=np.int64)
    for k in range(count):
        for n in range(np.count_nonzero(dt[k])):
            x[k, n + 1 :], status[k] = _end(model, x[k, n], u[k, n], dt[k, n], rows[k], settings)
            if status[k] != OK:
                break
            reached[k] += 1
    return x, status, reached


def run_sensitivities(
    model: CallableCore,
    x0: Array,
    u: Array,
    dt: Array,
    theta: Array,
    *settings: *Settings,
    measured: NDArray[np.bool_],
    s: Array,
    outputs_alone: bool = False,
    doubts: bool = False,
) -> tuple[Array, Array, Array, Array, IntArray, NDArray[np.int64]]:
    """x (K, N + 1, n_x), y, dx_dtheta and dy_dtheta (K, N, ...) at the segments' ends, status, segments that were completed.

    Nothing is crossed, so that there are no `doubts` of it.
    """
    count, segments, n_x, p = len(x0), dt.shape[-1], model.n_x, theta.shape[-1]
    rows = _rows(theta, count)
    u, dt = np.broadcast_to(u, (count, *u.shape[-2:])), np.broadcast_to(dt, (count, segments))
    by_complex_step = model.takes_complex(x0, u[:, 0], rows) if segments else True
    x, y = np.repeat(x0[:, None], segments + 1, axis=1), np.zeros((count, segments, model.n_y))
    dx, dy = np.zeros((count, segments, n_x, p)), np.zeros((count, segments, model.n_y, p))
    status, reached = np.zeros(count, dtype=np.int32), np.zeros(count, dtype=np.int64)
    start = perf_counter()
    for k in range(count):
        along = s[k] if s.size else np.zeros((n_x, p))
        for n in range(np.count_nonzero(dt[k])):
            end, along, of_y, ended = _sensed(model, x[k, n], along, u[k, n], dt[k, n], rows[k], settings, by_complex_step)
            x[k, n + 1 :] = end
            output, now = _outputs(model, end[None], u[k, n : n + 1], rows[k : k + 1], np.array([ended], dtype=np.int32))
            y[k, n], status[k] = output[0], now[0]
            if status[k] != OK:
                break
            dx[k, n], dy[k, n] = along, of_y
            reached[k] += 1
    if reached.any():
        _warn_of_sensitivities(model, by_complex_step, p, (perf_counter() - start) / int(reached.sum()))
    return x, y, dx[:, : 0 if outputs_alone else segments], dy, status, reached


def predictive_covariance(
    model: CallableCore,
    x0: Array,
    u: Array,
    dt: Array,
    theta: Array,
    nodes: _core.PriorNodes,
    *settings: *Settings,
    max_lost: float = 0.0,
) -> tuple[Array, IntArray, NDArray[np.int64], Array, Array]:
    """covariance (K, n_y, n_y), status, nodes that were redone, no outputs, lost weight; as the compiled kernels have them."""
    count, n_y = len(dt), model.n_y
    _, nominal_y, status, _ = simulate(model, x0, u, dt, theta, *settings)
    at, weights = nodes.nodes()
    covariance, lost = np.zeros((count, n_y, n_y)), np.ones(count)
    start = perf_counter()
    for k in np.flatnonzero(status == OK):
        y, ended = _over_nodes(model, x0[k], u[k], dt[k], at, settings, stop=max_lost == 0)
        bad = ended != OK
        first = int(ended[np.argmax(bad)]) if bad.any() else OK
        if max_lost == 0 and bad.any():
            status[k] = first
            continue
        lost[k] = np.abs(weights[bad]).sum() / np.abs(weights).sum()
        total = weights[~bad].sum()
        if lost[k] > max_lost or not total > 0:
            status[k] = first or NOT_FINITE
            continue
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is given a status
            deviation = y[~bad] - nominal_y[k]
            spread = (weights[~bad, None] * deviation).T @ deviation / total
        if np.isfinite(spread).all():
            covariance[k] = spread
        else:
            status[k] = NOT_FINITE
    if count:
        _warn(model, "predictive covariances", f"{len(at)} integrations per point", (perf_counter() - start) / count)
    return covariance, status, np.zeros(count, dtype=np.int64), np.empty((0, 0, n_y)), lost


def _over_nodes(
    model: CallableCore, x0: Array, u: Array, dt: float, theta: Array, settings: Settings, stop: bool
) -> tuple[Array, IntArray]:
    """Outputs (R, n_y) and statuses (R,) of one point; with `stop` only up to the first that is not ok."""
    y, status = np.zeros((len(theta), model.n_y)), np.zeros(len(theta), dtype=np.int32)
    for r, row in enumerate(theta):
        x, status[r] = _end(model, x0, u, dt, row, settings)
        y[r : r + 1], status[r : r + 1] = _outputs(model, x[None], u[None], row[None], status[r : r + 1])
        if stop and status[r] != OK:
            break
    return y, status


def _end(model: CallableCore, x0: Array, u: Array, dt: float, theta: Array, settings: Settings) -> tuple[Array, int]:
    if not model.n_x:
        return x0, static_status(model, x0, u, theta)

    def rates(x: Array) -> Array:
        return np.asarray(model.rhs(x[None], u[None], theta[None])[0], dtype=np.float64)

    x, status = integrate(model, rates, x0, u, dt, theta, *_steps(settings))
    return x, status if np.isfinite(x).all() else status or NOT_FINITE


def _outputs(model: CallableCore, x: Array, u: Array, theta: Array, status: IntArray) -> tuple[Array, IntArray]:
    """Outputs and statuses: where an output is not finite it is zero, and the status says so."""
    y = np.asarray(model.output(x, u, theta), dtype=np.float64)
    bad = np.any(~np.isfinite(y), axis=1)
    return np.where(bad.reshape(-1, 1), 0.0, y), np.where(bad & (status == OK), NOT_FINITE, status).astype(np.int32)


def _steps(settings: Settings) -> tuple[float, bool, str]:
    rtol, cross_kinks, _, method, _ = settings
    return rtol, cross_kinks, method


def _rows(theta: Array, count: int) -> Array:
    return np.broadcast_to(theta, (count, theta.shape[-1]))


def _warn(model: CallableCore, what: str, cost: str, seconds: float) -> None:
    """Say once for each kind of result what it costs."""
    kind = what.split(" by ")[0]
    if kind in model.warned:
        return
    model.warned.add(kind)
    advice = "a SymbolicModel is a thousand times faster"
    warnings.warn(
        f"CallableModel {model.name!r}: {what}: {cost}, {1e3 * seconds:.3g} ms per point; {advice}",
        UserWarning,
        stacklevel=stacklevel_of_user(),
    )
