"""Trajectories and sensitivities of experiment points and of runs, computed by the core."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, overload

from numpy.typing import ArrayLike

from ..basics.checks import check_type
from ..basics.values import Array, IntArray
from ..models import Model
from ..show.text import to_html
from .experiments import Experiments
from .natural_sizes import warn_of_small_states
from .run_trajectories import RunSensitivities, RunTrajectories, checked_run_sensitivities, checked_run_trajectories
from .runs import Runs
from .settings import Integration, checked_arguments
from .shown_trajectories import of_points, summary
from .status import Status, named
from .unstable import warn_of_unstable


class Trajectories(NamedTuple):
    """States x (K, n_x) and outputs y (K, n_y) after dt, and status (K,) as `Status` values.

    Where the status is not ok, x and y are those of the last state that was reached, or zero where they overflow.
    """

    x: Array
    y: Array
    status: IntArray

    @property
    def statuses(self) -> tuple[Status, ...]:
        """The statuses by their names, such as Status.met_jump."""
        return named(self.status)

    def __repr__(self) -> str:
        return summary("Trajectories", self.x, self.y, self.status, "point")

    def _repr_html_(self) -> str:
        return to_html(of_points(repr(self), self.x, self.y, self.status))


class Sensitivities(NamedTuple):
    """As `Trajectories`, with dx_dtheta (K, n_x, p) and dy_dtheta (K, n_y, p) per SI unit of each parameter."""

    x: Array
    y: Array
    dx_dtheta: Array
    dy_dtheta: Array
    status: IntArray

    @property
    def statuses(self) -> tuple[Status, ...]:
        """The statuses by their names, such as Status.met_jump."""
        return named(self.status)

    def __repr__(self) -> str:
        return summary("Sensitivities", self.x, self.y, self.status, "point", self.dy_dtheta.shape[-1])

    def _repr_html_(self) -> str:
        return to_html(of_points(repr(self), self.x, self.y, self.status))


@overload
def simulate(
    model: Model,
    points: Experiments,
    theta: Mapping[str, float] | ArrayLike,
    *,
    rtol: float = ...,
    threads: int | None = ...,
    kinks: str = ...,
    jumps: str = ...,
    method: str | None = ...,
) -> Trajectories: ...
@overload
def simulate(
    model: Model,
    points: Runs,
    theta: Mapping[str, float] | ArrayLike,
    *,
    rtol: float = ...,
    threads: int | None = ...,
    kinks: str = ...,
    jumps: str = ...,
    method: str | None = ...,
) -> RunTrajectories: ...
def simulate(
    model: Model,
    points: Experiments | Runs,
    theta: Mapping[str, float] | ArrayLike,
    *,
    rtol: float = 1e-6,
    threads: int | None = None,
    kinks: str = "cross",
    jumps: str = "cross",
    method: str | None = None,
) -> Trajectories | RunTrajectories:
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
    Trajectories, or RunTrajectories of runs

    Raises
    ------
    ValueError
        For misuse, and for a point that starts on a switching surface, which is named.
    """
    check_type(model, Model, "model")
    theta = model.theta(theta)
    arguments = checked_arguments(model, points, theta, rtol, threads, kinks, jumps, method)
    result: Trajectories | RunTrajectories
    if isinstance(points, Runs):
        result = checked_run_trajectories(model, points, theta, arguments)
    else:
        x, y, status, _ = model.kernels.simulate(model.core, points.x0, points.u, points.dt, theta, *arguments)
        result = Trajectories(x, y, status)
    warn_of_small_states(model, "the trajectories keep", points.x0, result.x)
    return result


@overload
def sensitivities(
    model: Model,
    points: Experiments,
    theta: Mapping[str, float] | ArrayLike,
    *,
    rtol: float = ...,
    threads: int | None = ...,
    kinks: str = ...,
    jumps: str = ...,
    method: str | None = ...,
) -> Sensitivities: ...
@overload
def sensitivities(
    model: Model,
    points: Runs,
    theta: Mapping[str, float] | ArrayLike,
    *,
    rtol: float = ...,
    threads: int | None = ...,
    kinks: str = ...,
    jumps: str = ...,
    method: str | None = ...,
) -> RunSensitivities: ...
def sensitivities(
    model: Model,
    points: Experiments | Runs,
    theta: Mapping[str, float] | ArrayLike,
    *,
    rtol: float = 1e-6,
    threads: int | None = None,
    kinks: str = "cross",
    jumps: str = "cross",
    method: str | None = None,
) -> Sensitivities | RunSensitivities:
    """Simulate experiment points, or runs, with the sensitivities of states and outputs, (8) and (9).

    Arguments and errors are those of `simulate`. The sensitivities take part in the error control, each column by its own size.
    Where the status is not ok they are zero.
    """
    check_type(model, Model, "model")
    theta = model.theta(theta)
    arguments = checked_arguments(model, points, theta, rtol, threads, kinks, jumps, method)
    result: Sensitivities | RunSensitivities
    if isinstance(points, Runs):
        result = checked_run_sensitivities(model, points, theta, arguments)
    else:
        result = checked_sensitivities(model, points, theta, arguments)
    warn_of_small_states(model, "the trajectories keep", points.x0, result.x)
    warn_of_unstable(model, theta, result.x, result.dx_dtheta)
    return result


def checked_sensitivities(
    model: Model, points: Experiments, theta: Array, arguments: Integration, outputs_alone: bool = False
) -> Sensitivities:
    """As `sensitivities`, of arguments that are known to be good; with `outputs_alone` sooner and without dx_dtheta."""
    given = (points.x0, points.u, points.dt, theta, *arguments)
    return Sensitivities(*model.kernels.sensitivities(model.core, *given, outputs_alone=outputs_alone))
