"""Trajectories with jumps by SciPy: events at every surface, a restart at each, and sliding where both sides point at one.

Written from the definition alone (A. F. Filippov, Differential equations with discontinuous right-hand sides, 1988) to check the
core, and slow.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import DOP853

Array = np.ndarray[Any, Any]


@dataclass(frozen=True)
class System:
    """x' = f(x, u, p, side), with the surfaces h(x, u, p) whose sides f is told; `jumps` of them are jumps, the rest are kinks.

    `size` are the natural sizes of the states.
    """

    f: Callable[[Array, Array, Array, Array], Any]
    h: Callable[[Array, Array, Array], Any]
    size: Array
    jumps: int


class NoAnswer(Exception):
    """A trajectory that this cannot tell: it grazes a surface, or meets two at once."""


@dataclass
class Course:
    """The state at the end and, in their order, the surfaces that were met with the sides behind them."""

    x: Array
    met: list[tuple[int, int]]
    near: float
    """How near to a surface the end is, as a time and a share of the duration."""


def course(system: System, x0: Sequence[float], u: Sequence[float], p: Sequence[float], dt: float, rtol: float = 1e-12) -> Course:
    """Integrate from x0 over dt; raises `NoAnswer`."""
    return _Run(system, np.array(u, dtype=float), np.array(p, dtype=float), dt, rtol).course(np.array(x0, dtype=float))


class _Run:
    def __init__(self, system: System, u: Array, p: Array, dt: float, rtol: float) -> None:
        self.system, self.u, self.p, self.dt, self.rtol = system, u, p, dt, rtol
        self.side = np.ones(0)

    def h(self, x: Array) -> Array:
        return np.array(self.system.h(x, self.u, self.p), dtype=float)

    def plain(self, x: Array, side: Array) -> Array:
        return np.array(self.system.f(x, self.u, self.p, side), dtype=float)

    def growth(self, m: int, x: Array, rate: Array) -> float:
        """dh/dt where the state moves at this rate, by a central difference along it, exact for surfaces of the second degree."""
        step = 1e-3 / max(float(np.max(np.abs(rate) / self.system.size)), 1e-300)
        return float((self.h(x + step * rate)[m] - self.h(x - step * rate)[m]) / (2 * step))

    def both(self, m: int, x: Array) -> tuple[Array, Array, float, float]:
        up, down = self.side.copy(), self.side.copy()
        up[m], down[m] = 1.0, -1.0
        plus, minus = self.plain(x, up), self.plain(x, down)
        return plus, minus, self.growth(m, x, plus), self.growth(m, x, minus)

    def rate(self, x: Array) -> Array:
        held = np.flatnonzero(self.side == 0)
        if not len(held):
            return self.plain(x, self.side)
        plus, minus, r_plus, r_minus = self.both(int(held[0]), x)
        return np.array(minus + r_minus / (r_minus - r_plus) * (plus - minus))

    def settle(self, m: int, x: Array) -> None:
        """Take the side of jump m that a state on it moves to, or 0."""
        _, _, r_plus, r_minus = self.both(m, x)
        if r_plus > 0 and r_minus > 0:
            self.side[m] = 1.0
        elif r_plus < 0 and r_minus < 0:
            self.side[m] = -1.0
        elif r_plus < 0 < r_minus:
            if (np.delete(self.side, m) == 0).any():
                raise NoAnswer("slides on two")
            self.side[m] = 0.0
        else:
            raise NoAnswer("grazes, or has two continuations")

    def course(self, x: Array) -> Course:
        value = self.h(x)
        self.side = np.where(value < 0, -1.0, 1.0)
        met: list[tuple[int, int]] = []
        for m in np.flatnonzero(value == 0):
            if m < self.system.jumps:
                self.settle(int(m), x)
            else:
                self.side[m] = 1.0 if self.growth(m, x, self.rate(x)) >= 0 else -1.0
        t, off = 0.0, -1
        for _ in range(400):
            t, x, hit = self.piece(t, x, off)
            if hit is None:
                return Course(x, met, self.nearest(x))
            off = hit
            if hit >= self.system.jumps:
                self.side[hit] *= -1
            elif self.side[hit] == 0:
                _, _, r_plus, r_minus = self.both(hit, x)
                self.side[hit] = 1.0 if abs(r_plus) < abs(r_minus) else -1.0
            else:
                before = self.side[hit]
                self.settle(hit, x)
                if self.side[hit] == before:
                    raise NoAnswer("grazes")
                self.check_others(hit, x)
            met.append((hit, int(self.side[hit])))
        raise NoAnswer("too many events")

    def check_others(self, hit: int, x: Array) -> None:
        for m in np.flatnonzero(self.side == 0):
            if m != hit:
                self.settle(int(m), x)

    def watched(self, m: int, x: Array) -> float:
        if self.side[m] == 0:
            _, _, r_plus, r_minus = self.both(m, x)
            return -r_plus * r_minus if r_plus < r_minus else -abs(r_plus * r_minus)
        return float(self.side[m] * self.h(x)[m])

    def piece(self, t: float, x: Array, off: int) -> tuple[float, Array, int | None]:
        """Up to the next surface. Just off one, it counts again once the trajectory is clear of it."""
        size = self.system.size
        solver = DOP853(
            lambda _, z: self.rate(z * size) / size,
            t,
            x / size,
            self.dt,
            rtol=max(self.rtol, 2.3e-14),
            atol=self.rtol,
            max_step=self.dt / 25,
        )
        clear = np.arange(len(self.side)) != off
        while solver.status == "running":
            message = solver.step()
            if message:
                raise NoAnswer(message)
            at = solver.dense_output()
            if hit := self.first_crossed(lambda time, at=at: at(time) * size, solver.t_old, solver.t, clear):
                return hit[0], self.polished(hit[1], at(hit[0]) * size), hit[1]
        return self.dt, solver.y * size, None

    def first_crossed(self, state: Callable[[float], Array], begin: float, end: float, clear: Array) -> tuple[float, int] | None:
        first: tuple[float, int] | None = None
        evenly, off = np.linspace(begin, end, 7), begin + (end - begin) * np.concatenate([[0.0], np.geomspace(1e-6, 1.0, 40)])
        for m in range(len(self.side)):
            for low, high in itertools.pairwise(evenly if clear[m] else off):
                if self.watched(m, state(high)) > 0:
                    clear[m] = True
                elif clear[m]:
                    for _ in range(50):
                        middle = 0.5 * (low + high)
                        low, high = (middle, high) if self.watched(m, state(middle)) > 0 else (low, middle)
                    if first is not None and abs(high - first[0]) < 1e-9 * self.dt:
                        raise NoAnswer("two at once")
                    if first is None or high < first[0]:
                        first = (high, m)
                    break
        return first

    def polished(self, m: int, x: Array) -> Array:
        """Onto the surface, along f."""
        if self.side[m] != 0:
            for _ in range(3):
                rate = self.rate(x)
                growth = self.growth(m, x, rate)
                if growth == 0:
                    raise NoAnswer("grazes")
                x = x - rate * float(self.h(x)[m]) / growth
        return x

    def nearest(self, x: Array) -> float:
        rate, value, shares = self.rate(x), self.h(x), [np.inf]
        for m in range(self.system.jumps):
            if self.side[m] != 0:
                shares.append(abs(value[m]) / max(abs(self.growth(m, x, rate)) * self.dt, 1e-300))
        return min(shares)


def derivatives(
    system: System,
    x0: Sequence[float],
    u: Sequence[float],
    p: Sequence[float],
    dt: float,
    nominal: Course,
    rtol: float = 1e-12,
    follow: Callable[..., Course] = course,
) -> tuple[Array, Array]:
    """dx/dp (n_x, n_p) by extrapolated central differences, and their errors; NaN where neighbours meet other surfaces."""
    n = len(p)
    found, error = np.full((len(nominal.x), n), np.nan), np.full((len(nominal.x), n), np.nan)
    for j in range(n):
        central = []
        for step in (1e-3 * (abs(p[j]) or 1.0) * 2.0**-k for k in range(3)):
            ends = []
            for sign in (1, -1):
                moved = np.array(p, dtype=float)
                moved[j] += sign * step
                end = follow(system, x0, u, moved, dt, rtol)
                if end.met != nominal.met:
                    break
                ends.append(end.x)
            if len(ends) < 2:
                break
            central.append((ends[0] - ends[1]) / (2 * step))
        if len(central) < 3:
            continue
        once = [(4 * b - a) / 3 for a, b in itertools.pairwise(central)]
        twice = (16 * once[1] - once[0]) / 15
        found[:, j], error[:, j] = twice, np.abs(twice - once[1])
    return found, error
