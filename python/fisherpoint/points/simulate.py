"""Simulate experiment points and runs, with and without sensitivities."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from ..basics.checks import check_type
from ..basics.messages import stacklevel_of_user
from ..basics.values import Array, IntArray
from ..models import Model
from .natural_sizes import warn_of_small_states
from .points_or_runs import Points, as_runs
from .run_trajectories import checked_run_sensitivities, checked_run_trajectories
from .runs import Runs
from .settings import Integration, checked_arguments
from .status import Status
from .trajectories import Sensitivities, Trajectories, counted_statuses


def simulate(
    model: Model,
    points: Points,
    theta: Mapping[str, float] | ArrayLike,
    *,
    rtol: float = 1e-6,
    threads: int | None = None,
    kinks: str = "cross",
    jumps: str = "cross",
    method: str | None = None,
) -> Trajectories:
    """Simulate experiment points, (14) and (15), or runs.

    Parameters
    ----------
    model : Model
    points : Experiments or Runs
        K points, or runs.
    theta : mapping by name, or array_like (p,) or (K, p)
        Parameters in SI units, one set for all points or runs, or one each.
    rtol : float
        Tolerance of x(dt), in units of the states' natural sizes (`Quantity.scale`).
    threads : int, optional
        Number of threads; the default is every core. The result does not depend on it.
    kinks : {"cross", "exclude"}
        Whether a kink is crossed by ending a step on it, or ends the trajectory as `Status.met_kink`.
    jumps : {"cross", "exclude"}
        Whether a jump is crossed, or ends the trajectory as `Status.met_jump`, the strict reading of (21). Behind a jump that is
        crossed the trajectory goes on, or slides along it, as a piston that sticks does. Jumps at times that depend on no
        parameter are crossed in any case; jumps that are not in `model.crossable` never are.
    method : {"RK45", "DOP853", "Radau"}, optional
        The Runge-Kutta method. The default is DOP853, the fastest one at every tolerance that was tried, until its steps turn out
        to be limited by stability: the trajectory then goes on by Radau, which is implicit.

    Returns
    -------
    Trajectories

    Raises
    ------
    ValueError
        For misuse, and for a point that starts on a switching surface, which is named.
    """
    check_type(model, Model, "model")
    theta = model.theta(theta)
    arguments = checked_arguments(model, points, theta, rtol, threads, kinks, jumps, method)
    runs = as_runs(points)
    result = checked_run_trajectories(model, runs, theta, arguments)
    warn_of_small_states(model, "the trajectories keep", points.x0, result.x)
    return result if points is runs else result.of_points()


def sensitivities(
    model: Model,
    points: Points,
    theta: Mapping[str, float] | ArrayLike,
    *,
    rtol: float = 1e-6,
    threads: int | None = None,
    kinks: str = "cross",
    jumps: str = "cross",
    method: str | None = None,
) -> Sensitivities:
    """Simulate experiment points, or runs, with the sensitivities of states and outputs, (8) and (9).

    Arguments and errors are those of `simulate`. The sensitivities take part in the error control, each column by its own size.
    Where the status is not ok they are zero. `dx_dtheta` of points may be computed only when it is read, for these arguments.
    """
    check_type(model, Model, "model")
    theta = model.theta(theta)
    arguments = checked_arguments(model, points, theta, rtol, threads, kinks, jumps, method)
    runs = as_runs(points)
    result = checked_run_sensitivities(model, runs, theta, arguments, states_later=True)
    warn_of_small_states(model, "the trajectories keep", points.x0, result.x)
    if len(result.dx_dtheta) == len(result.status):
        warn_of_unstable(model, theta, result.x, result.dx_dtheta)
    else:
        result = result.with_states(partial(_states_too, model, runs, theta.copy(), arguments, result.x, result.status))
        if grown(result.y, result.dy_dtheta, theta).max(initial=0.0) > SUSPECT:
            _ = result.dx_dtheta  # which warns
    return result if points is runs else result.of_points()


def _states_too(model: Model, runs: Runs, theta: Array, settings: Integration, x: Array, status: IntArray) -> Array:
    """dx_dtheta (K, 1, n_x, p) of points with a known dy_dtheta; zero where the status is not ok."""
    ok = np.flatnonzero(status == Status.ok)
    found = checked_run_sensitivities(model, runs[ok], theta[ok] if theta.ndim == 2 else theta, settings)
    dx = np.zeros((len(status), *found.dx_dtheta.shape[1:]))
    dx[ok] = found.dx_dtheta
    if found.status.any():
        warnings.warn(
            f"dx_dtheta: expected derivatives of all states where those of the outputs are known, set to zero, as they cannot be"
            f" computed: {counted_statuses(found.status)}",
            RuntimeWarning,
            stacklevel=stacklevel_of_user(),
        )
    warn_of_unstable(model, theta, x, dx)
    return dx


GROWN = 1e6
"""Relative change of a state over that of a parameter, from which on errors of 1e-6 grow as large as the state."""

SUSPECT = 1e3
"""That of an output, of its largest value, from which on the states are looked at."""


def grown(values: Array, slopes: Array, theta: Array, least: float | Array = 0.0) -> Array:
    """Largest relative changes (n, p) of values (K, ..., n) with slopes (K, ..., n, p), over relative ones of parameters."""
    size = np.maximum(least, np.abs(values).reshape(-1, values.shape[-1]).max(axis=0, initial=np.finfo(float).tiny))
    changes = np.atleast_2d(theta).reshape(-1, *(1,) * (slopes.ndim - 2), slopes.shape[-1])
    with np.errstate(over="ignore"):
        return np.asarray((np.abs(slopes * changes) / size[:, np.newaxis]).reshape(-1, *slopes.shape[-2:]).max(axis=0, initial=0.0))


def warn_of_unstable(model: Model, theta: Array, x: Array, dx_dtheta: Array) -> None:
    """Warn of the state that changes most with a parameter, where that is too much for tolerances to mean something.

    Parameters
    ----------
    model : Model
    theta : (p,) or (K, p)
    x : (K, ..., n_x)
    dx_dtheta : (K, ..., n_x, p)
    """
    if not dx_dtheta.size:
        return
    scales = np.array([quantity.scale or 1.0 for quantity in model.states])
    share = grown(x, dx_dtheta, theta, scales)
    i, j = np.unravel_index(int(share.argmax()), share.shape)
    if share[i, j] > GROWN:
        state, parameter = model.states[int(i)].name, model.parameters[int(j)].name
        warnings.warn(
            f"{state}: expected trajectories that small changes leave nearly as they are, found one that changes"
            f" {share[i, j]:.1g} times as much as {parameter}: rtol holds for each step, and such errors grow until the end."
            " Shorter durations are more informative",
            RuntimeWarning,
            stacklevel=stacklevel_of_user(),
        )
