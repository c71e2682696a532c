"""One trajectory of a model that is a Python function, by `scipy.integrate.solve_ivp`, with its surfaces and limits as events."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from .core import CallableCore
from .implicit import radau_in_sight
from .tangents import sizes

OK, MET_JUMP, LEFT_DOMAIN, STEP_LIMIT, NOT_FINITE, MET_KINK = range(6)
"""The statuses, by the numbers that the compiled kernels give them."""

MAX_EVALUATIONS, MAX_CROSSINGS = 50_000, 1000

LOCAL_SHARE = 0.1
"""Share of the tolerance that each step may use up."""

FLOOR = 1e-3
"""Size of a sensitivity, as a share of the state's natural size, below which its error is absolute."""

LOOKS, GAP = 50, 100.0
"""How often per duration f is looked at within long steps, and the error, in units of rtol, from which steps are kept short.

A step over a bump is off by thousands. Of the tests' models, a few trajectories at rtol 1e-9 are above it without need, which costs
them time and nothing else.
"""

BRINK = 1e-4
"""Share of its first value to which a limit has fallen where steps end in front of it; differences reach past it."""


_Step = tuple[float, float, Callable[[Array], Array]]
"""Where a step begins and ends, and the states along it."""


class _TooMany(Exception):
    """More evaluations than allowed."""


class _NoRoot(Exception):
    """SciPy has not found when a surface is met, as can be where its value has a double root."""


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
    path: list[tuple[Array, Array]] | None = None,
) -> tuple[Array, int]:
    """Integrate z' = derivative(z) over dt, where z begins with the state; return z and a status.

    Times (N,) and z (n, N) of the steps are added to the path.

    A kink is crossed by ending a step on it. Where the status is not ok, z is the last one that was reached.

    A step may go over something that none of its stages sees. So f and the surfaces are checked within long steps, and where they
    are not what they were taken for, steps are kept short from then on.
    What takes too many steps by the default method, as stiff models do, is tried again by an implicit one.
    """
    if method == "fastest":
        begun = len(path or ())
        z, status = integrate(model, derivative, z0, u, dt, theta, rtol, cross_kinks, "DOP853", path)
        if status == STEP_LIMIT:
            if path is not None:
                del path[begun:]
            z, status = integrate(model, derivative, z0, u, dt, theta, rtol, cross_kinks, "Radau", path)
        return z, status
    from scipy.integrate import solve_ivp

    n_x, u, theta = model.n_x, u[None], theta[None]
    status, side = _at_start(model, z0[None, :n_x], u, theta)
    if status != OK:
        return z0, status
    if not np.isfinite(derivative(z0)).all():
        return z0, NOT_FINITE
    local = max(LOCAL_SHARE * rtol, 3e-14)
    size = np.concatenate([model.scale, FLOOR * np.repeat(model.scale, len(z0) // n_x - 1)])
    calls, shortest, most, power = 0, dt / LOOKS, np.inf, 1.0
    long_steps: list[_Step] = []
    chosen = _keeping_steps(model, u[0], theta[0], method, shortest, long_steps)

    def counted(_: float, z: Array) -> Array:
        nonlocal calls
        calls += 1
        if calls > MAX_EVALUATIONS:
            raise _TooMany
        return derivative(z)

    def solve(t: float, end: float, z: Array, events: list[Callable[[float, Array], float]], **options: Any) -> Any:
        try:
            return solve_ivp(counted, (t, end), z, chosen, rtol=local, atol=local * size, events=events or None, **options)
        except RuntimeError as error:
            if "Failed to converge" in str(error):
                raise _NoRoot from error
            raise

    t, z, first = 0.0, z0, model.limits(z0[None, :n_x], u, theta)[0]
    for _ in range(MAX_CROSSINGS):
        try:
            events = [_event(model, m, side[m], t, u, theta, power) for m in range(len(side))]
            long_steps.clear()
            found = solve(t, dt, z, events, max_step=most)
            if _gap(model, long_steps, float(found.t[-1]), side, u, theta, shortest) > GAP * rtol:
                most = shortest
                found = solve(t, dt, z, events, max_step=most)
            t, z = float(found.t[-1]), found.y[:, -1]
            if path is not None:
                path.append((found.t, found.y))
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
        except _NoRoot:
            if power < 1:
                return z, STEP_LIMIT
            power = 1 / 3
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


def _keeping_steps(model: CallableCore, u: Array, theta: Array, method: str, shortest: float, steps: list[_Step]) -> Any:
    """A method of SciPy's that puts down its steps that are longer than `shortest`."""
    import scipy.integrate

    base: Any = radau_in_sight(model, u, theta) if method == "Radau" else getattr(scipy.integrate, method)

    class Keeping(base):  # type: ignore[misc]
        def step(self) -> str | None:
            message: str | None = super().step()
            if message is None and self.t - self.t_old > shortest:
                steps.append((self.t_old, self.t, self.dense_output()))
            return message

    return Keeping


def _gap(model: CallableCore, steps: list[_Step], until: float, side: Array, u: Array, theta: Array, spacing: float) -> float:
    """How far, as a share of its size, a state is off by what f is, within steps, other than the slope along them.

    Infinite where a surface or limit is on another side there, or f has no value.
    """
    states, slopes, widths = [], [], []
    for start, end, along in steps:
        length = min(end, until) - start  # the last may reach past a surface
        count = int(np.ceil(length / spacing))
        if count > 0:
            at, near = start + length * (np.arange(count) + 0.5) / count, 1e-3 * spacing
            states.append(along(at)[: model.n_x].T)
            slopes.append((along(at + near) - along(at - near))[: model.n_x].T / (2 * near))
            widths.append(np.full(count, length / count))
    if not states:
        return 0.0
    x = np.vstack(states)
    rows = x, np.repeat(u, len(x), axis=0), np.repeat(theta, len(x), axis=0)
    if (np.hstack([model.switching(*rows), model.limits(*rows)]).real * side < 0).any():
        return np.inf
    off = np.abs(model.rhs(*rows).real - np.vstack(slopes)) / sizes(x, model.scale)
    gap = float(np.max(np.concatenate(widths) @ off))
    return gap if np.isfinite(gap) else np.inf


def _event(
    model: CallableCore, m: int, side: float, start: float, u: Array, theta: Array, power: float
) -> Callable[[float, Array], float]:
    """Surface or limit m as an event, to a power that may be below 1 where it has a double root.

    At the start, which may lie on it, the side counts on which the state is going to be; so it does while it rests on a surface.
    """
    at_rest = side if m < model.n_surfaces else 0.0

    def value(t: float, z: Array) -> float:
        if t <= start:
            return side
        height = model.boundary(m, z[None, : model.n_x], u, theta)
        return float(np.copysign(abs(height) ** power, height)) if height else at_rest

    value.terminal = True  # type: ignore[attr-defined]
    return value


def _stuck(model: CallableCore, derivative: Callable[[Array], Array], z: Array, u: Array, theta: Array, first: Array) -> int:
    """Why no step is small enough: past a limit f has no value, so steps end in front of it."""
    if (model.limits(z[None, : model.n_x], u, theta)[0] <= BRINK * first).any():
        return LEFT_DOMAIN
    return STEP_LIMIT if np.isfinite(derivative(z)).all() else NOT_FINITE
