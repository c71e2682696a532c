"""Simulate experiment points and runs, with and without sensitivities."""

from __future__ import annotations

from collections.abc import Mapping

from numpy.typing import ArrayLike

from ..basics.checks import check_type
from ..models import Model
from .natural_sizes import warn_of_small_states
from .run_trajectories import checked_run_sensitivities, checked_run_trajectories
from .runs import Points, as_runs
from .settings import checked_arguments
from .trajectories import Sensitivities, Trajectories
from .unstable import warn_of_unstable


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
    Where the status is not ok they are zero.
    """
    check_type(model, Model, "model")
    theta = model.theta(theta)
    arguments = checked_arguments(model, points, theta, rtol, threads, kinks, jumps, method)
    runs = as_runs(points)
    result = checked_run_sensitivities(model, runs, theta, arguments)
    warn_of_small_states(model, "the trajectories keep", points.x0, result.x)
    warn_of_unstable(model, theta, result.x, result.dx_dtheta)
    return result if points is runs else result.of_points()
