"""The limit that ended a trajectory: one of the model's domain, or one along the way."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..basics.checks import check_type
from ..basics.values import Array, IntArray
from ..models import Model
from .points_or_runs import Points, as_runs
from .run_trajectories import plain_trajectories
from .runs import Runs
from .schedule import has_schedule, scheduled_runs
from .settings import Integration, checked_arguments
from .status import NoTrajectory, Status

HALVINGS = 30
"""Number of halvings of the duration, to find the last time at which the trajectory is still inside."""


def broken_limits(
    model: Model,
    points: Points,
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
        A limit of `model.domain` as its condition, such as "h > 0", or a limit along the way as it was written; with " at the
        start" where the start breaks it. None where the trajectory ends otherwise.

    Raises
    ------
    TypeError, ValueError
        As `simulate`.
    """
    check_type(model, Model, "model")
    values = model.theta(theta)
    settings = checked_arguments(model, points, values, rtol, threads, kinks, jumps, method)
    return checked_broken_limits(model, as_runs(points), values, settings)


def checked_broken_limits(
    model: Model, runs: Runs, theta: Array, settings: Integration, named: Model | None = None
) -> tuple[str | None, ...]:
    """Return what `broken_limits` does, for checked arguments; `named` has the same limits and names them."""
    found = None
    if has_schedule(model, runs):
        runs, found = scheduled_runs(model, runs, theta)
    done = plain_trajectories(model, runs, theta, settings, found)
    status, rows = done.status, np.flatnonzero(done.status == Status.left_domain)
    n = np.minimum(done.reached[rows], runs.dt.shape[1] - 1)
    x, u, since = done.x[rows, n], runs.u[rows, n], runs.t[rows, n] - runs.dt[rows, n]
    limits: list[str | None] = [None] * len(status)
    if len(rows):
        of_rows = np.array(np.broadcast_to(theta, (len(status), theta.shape[-1]))[rows])
        if found and found.updates.size:
            which = found.updates[rows, n]
            for one in np.unique(which[which > 0]):
                here = which == one
                x[here] = model.core.updated(model.at(x[here], since[here]), u[here], of_rows[here], one)[:, : x.shape[1]]
        places, outside = _first_limits(model, x, u, runs.dt[rows, n], since, of_rows, settings)
        for row, place, at_start in zip(rows.tolist(), places.tolist(), (outside & (n == 0)).tolist(), strict=True):
            limits[row] = (named or model).limit_text(place) + " at the start" * at_start
    return tuple(limits)


def statuses_in_words(
    model: Model, runs: Runs, theta: Array, settings: Integration, status: IntArray, rows: Sequence[int]
) -> list[str]:
    """Names of the statuses of some runs, with the limit that ended them."""
    given = runs[np.array(rows, dtype=np.intp)]
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


def refuse_failures(model: Model, runs: Runs, theta: Array, settings: Integration, status: IntArray) -> None:
    """Raise NoTrajectory where a status is not ok, with the first of these points or runs, and what ended them."""
    bad = np.flatnonzero(status != Status.ok)
    if not len(bad):
        return
    rows, name = bad[:5].tolist(), "runs" if runs.points is None else "points"
    words = statuses_in_words(model, runs, theta, settings, status, rows)
    given = ", ".join(f"{name}[{k}] ({word})" for k, word in zip(rows, words, strict=True)) + " ..." * (len(bad) > 5)
    raise NoTrajectory(f"{name}: expected trajectories that are ok, given {given}. {Status(status[bad[0]]).advice}")


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
