"""The limit that ended a trajectory: one of the model's domain, or one along the way."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..basics.checks import check_type
from ..basics.values import Array, IntArray
from ..models import Model
from .experiments import Experiments
from .run_trajectories import checked_run_trajectories
from .runs import Runs
from .settings import Integration, checked_arguments
from .status import Status

HALVINGS = 30
"""Number of halvings of the duration, to find the last time at which the trajectory is still inside."""


def broken_limits(
    model: Model,
    points: Experiments | Runs,
    theta: Mapping[str, float] | ArrayLike,
    *,
    rtol: float = 1e-6,
    threads: int | None = None,
    kinks: str = "cross",
    jumps: str = "cross",
    method: str | None = None,
) -> tuple[str | None, ...]:
    """Return the limit that each point or run with `Status.left_domain` reached first; arguments are those of `simulate`.

    Returns
    -------
    tuple of str or None
        A limit of `model.domain` as what it asks for, such as "h > 0", or a limit along the way as it was written; with " at the
        start" where the start breaks it. None where the trajectory ends otherwise.

    Raises
    ------
    TypeError, ValueError
        As `simulate`.
    """
    check_type(model, Model, "model")
    values = model.theta(theta)
    return checked_broken_limits(
        model, points, values, checked_arguments(model, points, values, rtol, threads, kinks, jumps, method)
    )


def checked_broken_limits(
    model: Model, points: Experiments | Runs, theta: Array, settings: Integration, named: Model | None = None
) -> tuple[str | None, ...]:
    """Return what `broken_limits` does, for checked arguments; `named` has the same limits and names them."""
    if isinstance(points, Runs):
        done = checked_run_trajectories(model, points, theta, settings)
        rows = np.flatnonzero(done.status == Status.left_domain)
        n = np.minimum(done.reached[rows], points.dt.shape[1] - 1)
        given, first, status = (done.x[rows, n], points.u[rows, n], points.dt[rows, n]), n == 0, done.status
        since = np.cumsum(points.dt, axis=1)[rows, n] - points.dt[rows, n]
    else:
        status = model.kernels.simulate(model.core, points.x0, points.u, points.dt, theta, *settings)[2]
        rows = np.flatnonzero(status == Status.left_domain)
        given, first = (points.x0[rows], points.u[rows], points.dt[rows]), np.ones(len(rows), dtype=bool)
        since = np.zeros(len(rows))
    limits: list[str | None] = [None] * len(status)
    if len(rows):
        of_rows = np.array(np.broadcast_to(theta, (len(status), theta.shape[-1]))[rows])
        places, outside = _first_limits(model, *given, since, of_rows, settings)
        for row, place, at_start in zip(rows.tolist(), places.tolist(), (outside & first).tolist(), strict=True):
            limits[row] = (named or model).limit_text(place) + " at the start" * at_start
    return tuple(limits)


def statuses_in_words(
    model: Model, points: Experiments | Runs, theta: Array, settings: Integration, status: IntArray, rows: Sequence[int]
) -> list[str]:
    """Names of the statuses of some points or runs, with the limit that ended them."""
    given = points[np.array(rows, dtype=np.intp)]
    of_rows = theta[list(rows)] if theta.ndim == 2 else theta
    limits = (
        checked_broken_limits(model, given, of_rows, settings)
        if (status[list(rows)] == Status.left_domain).any()
        else [None] * len(rows)
    )
    return [
        Status(status[k]).name + (f": {limit}" if limit and status[k] == Status.left_domain else "")
        for k, limit in zip(rows, limits, strict=True)
    ]


def _first_limits(
    model: Model, x: Array, u: Array, dt: Array, since: Array, theta: Array, settings: Integration
) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Places (n,) of the limits that trajectories reach first, and whether they start outside; `since` (n,) is the time of x."""
    values, poles = _values(model, model.at(x, since), u, theta), len(model.poles)
    side = np.where(np.arange(values.shape[1]) < poles, np.sign(values), 1.0)
    broken = ~(side * values > 0)
    outside = broken.any(axis=1)
    low, high, inside = np.zeros_like(dt), dt.copy(), x.copy()
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        end, _, status, _ = model.kernels.simulate(model.core, model.at(x, since), u, middle, theta, *settings)
        ok = status == Status.ok
        low, high = np.where(ok, middle, low), np.where(ok, high, middle)
        inside[ok] = np.asarray(end)[ok]
    # The time in which each limit is reached from there, straight on.
    with np.errstate(all="ignore"):
        rates = np.asarray(model.core.rhs(model.at(inside, since + low), u, theta)).reshape(inside.shape)
        here = side * _values(model, model.at(inside, since + low), u, theta)
        step = 1e-6 * dt[:, None]
        before = side * _values(model, model.at(inside - step * rates, since + low - step[:, 0]), u, theta)
        time = np.where(before > here, here * step / (before - here), np.inf)
    time[~np.isfinite(time)] = np.inf
    nearest = np.where(
        np.isfinite(time).any(axis=1), np.argmin(time, axis=1), np.argmin(np.abs(here / np.where(values, values, 1.0)), axis=1)
    )
    return np.where(outside, np.argmax(broken, axis=1), nearest), np.asarray(outside)


def _values(model: Model, x: Array, u: Array, theta: Array) -> Array:
    return np.asarray(model.core.limits(x, u, theta)).reshape(len(x), len(model.domain))
