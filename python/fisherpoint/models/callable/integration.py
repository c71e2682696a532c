"""One trajectory of a model that is a Python function, by `scipy.integrate.solve_ivp`, with its surfaces and limits as events."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from .core import CallableCore

OK, MET_JUMP, LEFT_DOMAIN, STEP_LIMIT, NOT_FINITE, MET_KINK = range(6)
"""The statuses, by the numbers that the compiled kernels give them."""

MAX_EVALUATIONS, MAX_CROSSINGS = 50_000, 1000

LOCAL_SHARE = 0.1
"""Share of the tolerance that each step may use up."""

FLOOR = 1e-3
"""Size of a sensitivity, as a share of the state's natural size, below which its error is absolute."""

BRINK = 1e-4
"""Share of its first value to which a limit has fallen where steps end in front of it; differences reach past it."""


class _TooMany(Exception):
    """More evaluations than allowed."""


def integrate(
    model: CallableCore,
    derivative: Callable[[Array], Array],
    z0: Array,
    u: Array,
    dt: float,
    theta: Array,
    rtol: float,
    cross_kinks: bool,
    method: str,
) -> tuple[Array, int]:
    """Integrate z' = derivative(z) over dt, where z begins with the state; return z and a status.

    A kink is crossed by ending a step on it. Where the status is not ok, z is the last one that was reached.
    """
    from scipy.integrate import solve_ivp

    n_x, u, theta = model.n_x, u[None], theta[None]
    status, side = _at_start(model, z0[None, :n_x], u, theta)
    if status != OK:
        return z0, status
    if not np.isfinite(derivative(z0)).all():
        return z0, NOT_FINITE
    local = max(LOCAL_SHARE * rtol, 3e-14)
    size = np.concatenate([model.scale, FLOOR * np.repeat(model.scale, len(z0) // n_x - 1)])
    chosen: Any = "RK45" if method == "RK45" else "DOP853"
    calls = 0

    def counted(_: float, z: Array) -> Array:
        nonlocal calls
        calls += 1
        if calls > MAX_EVALUATIONS:
            raise _TooMany
        return derivative(z)

    def solve(t: float, end: float, z: Array, events: list[Callable[[float, Array], float]], **options: Any) -> Any:
        return solve_ivp(counted, (t, end), z, chosen, rtol=local, atol=local * size, events=events or None, **options)

    t, z, first = 0.0, z0, model.limits(z0[None, :n_x], u, theta)[0]
    for _ in range(MAX_CROSSINGS):
        try:
            found = solve(t, dt, z, [_event(model, m, side[m], t, u, theta) for m in range(len(side))])
            t, z = float(found.t[-1]), found.y[:, -1]
            if found.status == 0:
                return z, OK
            if found.status < 0:
                return z, _stuck(model, derivative, z, u, theta, first)
            m = next(m for m, times in enumerate(found.t_events) if len(times))
            if m >= model.n_surfaces:
                return z, LEFT_DOMAIN
            if m < model.n_jumps:
                return z, MET_JUMP
            if not cross_kinks:
                return z, MET_KINK
            side[m] = -side[m]
            if t > found.t[-2]:  # once more, with a step that ends here: the last one reached past the kink
                z = solve(found.t[-2], t, found.y[:, -2], [], first_step=t - found.t[-2]).y[:, -1]
        except _TooMany:
            return z, STEP_LIMIT
    return z, STEP_LIMIT


def static_status(model: CallableCore, x: Array, u: Array, theta: Array) -> int:
    """The status of a point without a trajectory."""
    return _at_start(model, x[None], u[None], theta[None])[0]


def _at_start(model: CallableCore, x: Array, u: Array, theta: Array) -> tuple[int, NDArray[np.float64]]:
    """Status, and the side of each surface and limit on which the state is."""
    side = np.sign(np.hstack([model.switching(x, u, theta), model.limits(x, u, theta)])[0].real)
    if not (side[model.n_surfaces :] > 0).all():
        return LEFT_DOMAIN, side
    if (side[: model.n_jumps] == 0).any():
        return MET_JUMP, side
    return OK, np.where(side == 0, 1.0, side)


def _event(model: CallableCore, m: int, side: float, start: float, u: Array, theta: Array) -> Callable[[float, Array], float]:
    """Surface or limit m as an event.

    At the start, which may lie on it, the side counts on which the state is going to be; so it does while it rests on a surface.
    """
    at_rest = side if m < model.n_surfaces else 0.0

    def value(t: float, z: Array) -> float:
        return side if t <= start else model.boundary(m, z[None, : model.n_x], u, theta) or at_rest

    value.terminal = True  # type: ignore[attr-defined]
    return value


def _stuck(model: CallableCore, derivative: Callable[[Array], Array], z: Array, u: Array, theta: Array, first: Array) -> int:
    """Why no step is small enough: past a limit f has no value, so steps end in front of it."""
    if (model.limits(z[None, : model.n_x], u, theta)[0] <= BRINK * first).any():
        return LEFT_DOMAIN
    return STEP_LIMIT if np.isfinite(derivative(z)).all() else NOT_FINITE
