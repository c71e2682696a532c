"""Trajectories and sensitivities of experiment points, computed by the core."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Collection, Mapping
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..basics.checks import as_float, check_choice, check_positive_int
from ..basics.checks import check_type as check_type  # for those who check more than this
from ..basics.values import Array, IntArray
from ..models import Model
from .experiments import Experiments
from .natural_sizes import warn_of_small_states

MAX_THREADS = 4096


class Status(IntEnum):
    """How a trajectory ended."""

    ok = 0
    met_jump = 1
    left_domain = 2
    step_limit = 3
    not_finite = 4
    met_kink = 5
    grazes_jump = 6
    on_jump = 7
    two_jumps = 8
    chatters = 9

    @property
    def advice(self) -> str:
        """What it means and what helps, in one sentence."""
        return _ADVICE[self]


_ADVICE = {
    Status.ok: "The trajectory reached its end.",
    Status.met_jump: (
        "The right-hand side jumps on the way, and jumps='exclude' or the kind of jump (see model.crossable) forbids to cross it: "
        "start further off or sample earlier."
    ),
    Status.left_domain: "The state reached a limit beyond which the model has no value: start further inside or sample earlier.",
    Status.step_limit: "The tolerance requires more or smaller steps than allowed: increase rtol or sample earlier.",
    Status.not_finite: "A rate, an output or what depends on it overflowed: check constants, parameters and standard deviations.",
    Status.met_kink: "The trajectory crosses one of the model's kinks, which kinks='exclude' forbids.",
    Status.grazes_jump: "The trajectory touches a jump along its tangent, and has no derivative: change the start or the duration.",
    Status.on_jump: "The trajectory starts or ends on a jump, where it has no derivative: change the start or the duration.",
    Status.two_jumps: "The trajectory meets two jumps at once: change the start, or sample earlier.",
    Status.chatters: "The trajectory meets jumps again and again in ever shorter times: sample earlier.",
}


def failures_of(status: IntArray) -> Counter[str]:
    """How many trajectories ended otherwise than ok, by the names of their statuses."""
    counts = np.bincount(status, minlength=len(Status))
    return Counter({Status(value).name: int(n) for value, n in enumerate(counts) if n and value != Status.ok})


Settings = tuple[float, bool, bool, str, int]
"""rtol, whether kinks and jumps are crossed, the method and the number of threads, as the kernels take them."""


class Trajectories(NamedTuple):
    """States x (K, n_x) and outputs y (K, n_y) after dt, and status (K,) as `Status` values.

    Where the status is not ok, x and y are those of the last state that was reached, or zero where they overflow.
    """

    x: Array
    y: Array
    status: IntArray


class Sensitivities(NamedTuple):
    """As `Trajectories`, with dx_dtheta (K, n_x, p) and dy_dtheta (K, n_y, p) per SI unit of each parameter."""

    x: Array
    y: Array
    dx_dtheta: Array
    dy_dtheta: Array
    status: IntArray


def simulate(
    model: Model,
    points: Experiments,
    theta: Mapping[str, float] | ArrayLike,
    *,
    rtol: float = 1e-6,
    threads: int | None = None,
    kinks: str = "cross",
    jumps: str = "cross",
    method: str | None = None,
) -> Trajectories:
    """Simulate experiment points, (14) and (15).

    Parameters
    ----------
    model : Model
    points : Experiments
        K points.
    theta : mapping by name, or array_like (p,) or (K, p)
        Parameters in SI units, one set for all points or one each.
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
    result = Trajectories(*model.kernels.simulate(model.core, points.x0, points.u, points.dt, theta, *arguments))
    warn_of_small_states(model, "the trajectories keep", points.x0, result.x)
    return result


def sensitivities(
    model: Model,
    points: Experiments,
    theta: Mapping[str, float] | ArrayLike,
    *,
    rtol: float = 1e-6,
    threads: int | None = None,
    kinks: str = "cross",
    jumps: str = "cross",
    method: str | None = None,
) -> Sensitivities:
    """Simulate experiment points with the sensitivities of states and outputs, (8) and (9).

    Arguments and errors are those of `simulate`. The sensitivities take part in the error control, each column by its own size.
    Where the status is not ok they are zero.
    """
    check_type(model, Model, "model")
    theta = model.theta(theta)
    arguments = checked_arguments(model, points, theta, rtol, threads, kinks, jumps, method)
    result = checked_sensitivities(model, points, theta, arguments)
    warn_of_small_states(model, "the trajectories keep", points.x0, result.x)
    return result


def checked_sensitivities(
    model: Model, points: Experiments, theta: Array, arguments: Settings, outputs_alone: bool = False
) -> Sensitivities:
    """As `sensitivities`, of arguments that are known to be good; with `outputs_alone` sooner and without dx_dtheta."""
    given = (points.x0, points.u, points.dt, theta, *arguments)
    return Sensitivities(*model.kernels.sensitivities(model.core, *given, outputs_alone=outputs_alone))


def only_finite(status: IntArray, *results: Array) -> IntArray:
    """Statuses (K,) with `Status.not_finite` where an ok row of a result (K, ...) is not finite; such rows become zero."""
    finite = np.all([np.isfinite(result).all(axis=tuple(range(1, result.ndim))) for result in results], axis=0)
    if finite.all():
        return status
    for result in results:
        result[~finite] = 0.0
    return np.where((status == Status.ok) & ~finite, Status.not_finite, status).astype(np.int32)


def resolve_threads(threads: int | None) -> int:
    """Return the number of threads: as given, or the cores that this process may use."""
    if threads is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return check_positive_int(threads, "threads", most=MAX_THREADS)


def checked_arguments(
    model: Model,
    points: Experiments,
    theta: Array,
    rtol: float,
    threads: int | None,
    kinks: str,
    jumps: str,
    method: str | None,
) -> Settings:
    """Check points and settings; return the settings as the kernels take them."""
    check_type(points, Experiments, "points")
    n_x, n_u = len(model.states), len(model.inputs)
    if points.x0.shape[1] != n_x:
        raise ValueError(f"x0: expected shape (K, {n_x}), given {points.x0.shape}")
    if points.u.shape[1] != n_u:
        raise ValueError(f"u: expected shape (K, {n_u}), given {points.u.shape}")
    if theta.ndim == 2 and len(theta) != len(points):
        raise ValueError(f"theta: expected {len(points)} rows, one for each point, given {len(theta)}")
    rtol = check_rtol(rtol)
    crosses = check_kinks(kinks), check_jumps(jumps)
    refuse_starts_on_surfaces(model, points, theta, crossed_surfaces(model, *crosses))
    if method is not None:
        method = check_choice(method, ("RK45", "DOP853", "Radau"), "method")
    return rtol, *crosses, method or "fastest", resolve_threads(threads)


def check_rtol(rtol: float) -> float:
    """Return a tolerance that the core can keep."""
    value = as_float(rtol, "rtol")
    if not 1e-13 <= value <= 0.1:
        raise ValueError(f"rtol: expected a tolerance between 1e-13 and 0.1, given {value:g}")
    return value


def check_kinks(kinks: str) -> bool:
    """Return whether kinks are crossed."""
    return check_choice(kinks, ("cross", "exclude"), "kinks") == "cross"


def check_jumps(jumps: str) -> bool:
    """Return whether jumps are crossed."""
    return check_choice(jumps, ("cross", "exclude"), "jumps") == "cross"


def crossed_surfaces(model: Model, kinks: bool, jumps: bool) -> tuple[str, ...]:
    """Names of the surfaces that trajectories cross, and may start on."""
    return (model.kinks if kinks else ()) + (model.crossable if jumps else ())


def on_surface(model: Model, points: Experiments, theta: Array, crossed: Collection[str] = ()) -> dict[str, NDArray[np.intp]]:
    """Return for each divisor, and each switching surface that is not `crossed`, the indices of the points that start on it."""
    if not len(points):
        return {}
    surfaces, values = (*model.jumps, *model.kinks, *model.poles), model.switching(points.x0, points.u, theta)
    if model.poles:
        values = np.column_stack([values, model.limits(points.x0, points.u, theta)[:, : len(model.poles)]])
    told = ((m, name) for m, name in enumerate(surfaces) if name not in crossed)
    return {name: np.flatnonzero(values[:, m] == 0) for m, name in told if (values[:, m] == 0).any()}


def refuse_starts_on_surfaces(model: Model, points: Experiments, theta: Array, crossed: Collection[str]) -> None:
    for surface, rows in on_surface(model, points, theta, crossed).items():
        where = f"off {surface} = 0, a divisor of the model or an argument of its roots"
        if surface in (*model.jumps, *model.kinks):
            where = f"off the switching surface {surface} = 0, where the model is not differentiable"
        listed = ", ".join(f"points[{k}]" for k in rows[:5]) + (" ..." if len(rows) > 5 else "")
        raise ValueError(f"points: expected starts {where}; given {surface} = 0 in {listed}")
