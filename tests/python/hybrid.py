"""Trajectories that are set anew at events, with their sensitivities, by SciPy: independent of the package.

Both are integrated together from event to event. With h the surface that is met, t* the time of that and x+ = r(x, theta),

    S+ = r_x S- + r_theta + (r_x f- - f+) dt*/dtheta,    dt*/dtheta = -(h_x S- + h_theta) / (h_x f-).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

Array = np.ndarray
TOGETHER = 1e-9
"""Events that follow one another within this share of the duration pile up."""


class PilesUpError(Exception):
    """There are more and more events in ever shorter times."""


@dataclass(frozen=True)
class Event:
    """h(x, theta) falls through zero in these modes; behind it there are other states, and another mode."""

    modes: tuple[int, ...]
    height: Callable[[Array, Array], float]
    gradients: Callable[[Array, Array], tuple[Array, Array]]  # h_x, h_theta
    reset: Callable[[Array, Array], tuple[Array, Array, Array]]  # r, r_x, r_theta
    mode: int


@dataclass(frozen=True)
class Hybrid:
    """f(x, theta, u, mode) with f_x and f_theta, and events."""

    rates: Callable[[Array, Array, Array, int], tuple[Array, Array, Array]]
    events: Sequence[Event]
    start: Callable[[Array, Array], int]

    def __call__(self, x0: Array, u: Array, dt: float, theta: Array) -> tuple[Array, Array, int]:
        """x and S at the end, and how many events there were."""
        n, p = len(x0), len(theta)
        x, s, mode, t, count = np.array(x0, float), np.zeros((n, p)), self.start(x0, theta), 0.0, 0
        met: Event | None = None

        while True:

            def both(_: float, z: Array, mode: int = mode) -> Array:
                f, f_x, f_theta = self.rates(z[:n], theta, u, mode)
                return np.concatenate([f, (f_x @ z[n:].reshape(n, p) + f_theta).ravel()])

            watched = [event for event in self.events if mode in event.modes]
            # The event that has just been has its own surface behind it only when it has risen off it.
            functions = []
            for event in watched:

                def height(time: float, z: Array, event: Event = event, since: float = t, again: bool = event is met) -> float:
                    return 1.0 if again and time <= since + 1e-10 * dt else event.height(z[:n], theta)

                height.terminal, height.direction = True, -1.0  # type: ignore[attr-defined]
                functions.append(height)
            done = solve_ivp(
                both, (t, dt), np.concatenate([x, s.ravel()]), "DOP853", events=functions, rtol=1e-12, atol=1e-13, max_step=dt / 50
            )
            z = done.y[:, -1]
            x, s = z[:n], z[n:].reshape(n, p)
            if done.status == 0:
                return x, s, count
            met = next(event for event, times in zip(watched, done.t_events, strict=True) if len(times))
            if done.t[-1] - t < TOGETHER * dt:
                raise PilesUpError
            t, count = done.t[-1], count + 1
            before = self.rates(x, theta, u, mode)[0]
            h_x, h_theta = met.gradients(x, theta)
            shift = -(h_x @ s + h_theta) / (h_x @ before)
            x, r_x, r_theta = met.reset(x, theta)
            mode = met.mode
            after = self.rates(x, theta, u, mode)[0]
            s = r_x @ s + r_theta + np.outer(r_x @ before - after, shift)
