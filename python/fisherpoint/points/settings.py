"""Settings of kernels: tolerance, which surfaces are crossed, the method, threads; and which starts they accept."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.checks import as_float, check_choice, check_positive_int
from ..basics.values import Array
from ..engine.workers import cores
from ..models import Model
from .experiments import Experiments
from .points_or_runs import Points, as_runs
from .rest_starts import checked_starts
from .schedule import scheduled_runs

MAX_THREADS = 4096

FINEST, COARSEST = 1e-13, 0.1
"""The least tolerance that doubles can keep, and the largest that is one."""

FINER = 1e-3
"""Multiple of the tolerance that decides whether a trajectory touches a surface or passes beside it."""


class Integration(NamedTuple):
    """How trajectories are integrated, in the order of the kernels' arguments.

    Attributes
    ----------
    rtol : float
        Relative tolerance of a state, of its natural size.
    cross_kinks, cross_jumps : bool
        Whether trajectories go on behind a kink, and behind a jump.
    method : str
        "RK45", "DOP853", "Radau", or "fastest", which chooses.
    threads : int
    """

    rtol: float
    cross_kinks: bool = True
    cross_jumps: bool = True
    method: str = "fastest"
    threads: int = 1

    def finer(self) -> Integration:
        """With a tolerance that decides whether a trajectory touches a surface or passes beside it."""
        return self._replace(rtol=max(FINER * self.rtol, FINEST))


def resolve_threads(threads: int | None) -> int:
    """Return the number of threads: as given, or the cores that this process may use."""
    return check_threads(threads) or cores()


def check_threads(threads: int | None) -> int | None:
    """Return the number of threads that is given."""
    return None if threads is None else check_positive_int(threads, "threads", most=MAX_THREADS)


def checked_arguments(
    model: Model,
    points: Points,
    theta: Array,
    rtol: float,
    threads: int | None,
    kinks: str,
    jumps: str,
    method: str | None,
) -> Integration:
    """Check points and settings."""
    runs = as_runs(points)
    n_x, n_u = len(model.states), len(model.inputs)
    if points.x0.shape[1] != n_x:
        raise ValueError(f"x0: expected shape (K, {n_x}), given {points.x0.shape}")
    if points.u.shape[-1] != n_u:
        axes = "K" if points.u.ndim == 2 else "K, N"
        raise ValueError(f"u: expected shape ({axes}, {n_u}), given {points.u.shape}")
    if runs.by_output is not None and runs.by_output.shape[2] != len(model.outputs):
        raise ValueError(f"measured: expected shape (K, N, {len(model.outputs)}), given {runs.by_output.shape}")
    if theta.ndim == 2 and len(theta) != len(points):
        raise ValueError(f"theta: expected {len(points)} rows, one for each point, given {len(theta)}")
    rtol = check_rtol(rtol)
    crosses = check_kinks(kinks), check_jumps(jumps)
    starts = scheduled_runs(model, runs, theta)[0].starts if model.delays and runs.points is None else runs.starts
    if runs.rests is not None and theta.ndim == 1:
        starts = starts.starting(checked_starts(model, runs, theta))
    if runs.rests is None or theta.ndim == 1:  # of other starts the status says it
        refuse_starts_on_surfaces(model, starts, theta, crossed_surfaces(model, *crosses))
    if method is not None:
        method = check_choice(method, ("RK45", "DOP853", "Radau"), "method")
    return Integration(rtol, *crosses, method or "fastest", resolve_threads(threads))


def check_rtol(rtol: float) -> float:
    """Return a tolerance that the core can keep."""
    value = as_float(rtol, "rtol")
    if not FINEST <= value <= COARSEST:
        raise ValueError(f"rtol: expected a tolerance between {FINEST:g} and {COARSEST:g}, given {value:g}")
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
    """Return for each divisor, and each switching surface that is not `crossed`, the indices of the points that start on it.

    A point outside of the domain, where a surface may have no value, is on none: its trajectory's status shows it.
    """
    surfaces = (*model.jumps, *model.kinks, *model.poles)
    others = [(m, name) for m, name in enumerate(surfaces) if name not in crossed]
    if not len(points) or not others:
        return {}
    given = points.x0, points.u, np.broadcast_to(theta, (len(points), len(model.parameters)))
    values = np.asarray(model.core.switching(*given))
    if model.poles:
        values = np.column_stack([values, np.asarray(model.core.limits(*given))[:, : len(model.poles)]])
    return {name: np.flatnonzero(values[:, m] == 0) for m, name in others if (values[:, m] == 0).any()}


def refuse_starts_on_surfaces(model: Model, points: Experiments, theta: Array, crossed: Collection[str]) -> None:
    for surface, rows in on_surface(model, points, theta, crossed).items():
        where = f"off {surface} = 0, a divisor of the model or an argument of its roots"
        if surface in (*model.jumps, *model.kinks):
            where = f"off the switching surface {surface} = 0, where the model is not differentiable"
        listed = ", ".join(f"points[{k}]" for k in rows[:5]) + (" ..." if len(rows) > 5 else "")
        raise ValueError(f"points: expected starts {where}; given {surface} = 0 in {listed}")
