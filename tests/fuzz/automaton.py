"""Trajectories of equations that are written out mode by mode, by SciPy: what kinds of equations (kinds.py) are compared with.

A mode has rates without branches, and guards that are positive in it. Where one becomes zero the step ends, and it goes on in
another mode: in the one that the guard names, with states set anew if it says so, or in the only one whose guards all hold from
there on. It shares no code with the package, and no text: kinds write their modes by hand.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

from reading import Floats

RTOL, ATOL = 1e-12, 1e-13
LONGEST = 1 / 12  # of a step, as a share of the duration
EVENLY, CLOSELY = np.linspace(0, 1, 7)[1:], np.geomspace(1e-7, 1.0, 30)  # places in a step that are looked at
ON = 1e-11  # a guard is zero within this, as all quantities of kinds are of the order of one
THROUGH = 1e-9  # and below this it is certainly not
DEFINITE = 1e-7  # a rate of a guard that is zero
TOGETHER = 1e-9  # shares of the duration: events that follow one another sooner pile up
MOST_EVENTS = 200
STEPS = (4e-4, 2e-4)  # of a parameter, for differences
OTHER_STEPS = (5.3e-4, 2.65e-4)

NAMES: dict[str, Any] = {name: getattr(math, name) for name in ("sqrt", "sin", "cos", "exp", "log", "tanh")} | {"abs": abs}


class NoAnswer(Exception):
    """It touches a surface and does not cross it, or it is not determined how it goes on."""


class PilesUp(Exception):
    """There are more and more events in ever shorter times."""


@dataclass(frozen=True)
class Guard:
    """What is positive in a mode; and where it becomes zero, the mode behind it, if named, and the states that are set anew."""

    height: str
    to: str = ""
    reset: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Mode:
    """Rates of all states. Those named in `roots` are integrated as their square roots: rates and guards are written in these."""

    rates: Sequence[str]
    guards: Sequence[Guard] = ()
    roots: Sequence[str] = ()


@dataclass(frozen=True)
class Ended:
    """Where a trajectory ends, in which mode, and after how many events."""

    x: Floats
    mode: str
    events: int


class Automaton:
    """Modes by their names. With a memory several modes may hold at a start, and the first is taken."""

    def __init__(
        self,
        states: Sequence[str],
        inputs: Sequence[str],
        parameters: Sequence[str],
        modes: Mapping[str, Mode],
        memory: bool = False,
    ) -> None:
        self.states, self.modes, self.memory = list(states), dict(modes), memory
        places = {"_x": states, "_u": inputs, "_p": parameters}
        self._unpack = "".join(f"({', '.join(names)},) = {of}; " for of, names in places.items() if names)
        self._rates = {name: self.function(mode.rates) for name, mode in modes.items()}
        self._guards = {name: self.function([guard.height for guard in mode.guards]) for name, mode in modes.items()}
        self._roots = {name: [self.states.index(root) for root in mode.roots] for name, mode in modes.items()}

    def function(self, texts: Sequence[str]) -> Callable[..., list[float]]:
        space: dict[str, Any] = dict(NAMES)
        exec(f"def function(_x, _u, _p): {self._unpack}return [{', '.join(texts)}]", space)
        function: Callable[..., list[float]] = space["function"]
        return function

    def course(self, x0: Sequence[float], u: Sequence[float], p: Sequence[float], dt: float, mode: str = "") -> Ended:
        """From x0 over dt, in a mode if one is given; raises `NoAnswer`, or `PilesUp`."""
        return _Walk(self, [float(v) for v in u], [float(v) for v in p], float(dt)).run(np.array(x0, dtype=float), mode)


class _Walk:
    def __init__(self, of: Automaton, u: list[float], p: list[float], dt: float) -> None:
        self.of, self.u, self.p, self.dt = of, u, p, dt
        self.mode = ""

    # z are states as a mode integrates them

    def rates(self, mode: str, z: Floats) -> Floats:
        return np.array(self.of._rates[mode](z.tolist(), self.u, self.p))

    def guards(self, mode: str, z: Floats) -> Floats:
        return np.array(self.of._guards[mode](z.tolist(), self.u, self.p))

    def inward(self, mode: str, x: Floats) -> Floats:
        z = x.copy()
        for i in self.of._roots[mode]:
            z[i] = math.sqrt(max(z[i], 0.0))
        return z

    def outward(self, mode: str, z: Floats) -> Floats:
        x = z.copy()
        x[self.of._roots[mode]] **= 2
        return x

    def growth(self, mode: str, z: Floats) -> Floats:
        """Rates of the guards."""
        f, step = self.rates(mode, z), 1e-6
        return (self.guards(mode, z + step * f) - self.guards(mode, z - step * f)) / (2 * step)

    def holds(self, mode: str, x: Floats) -> bool:
        z = self.inward(mode, x)
        value = self.guards(mode, z)
        if (value < -ON).any():
            return False
        return bool((self.growth(mode, z)[value <= ON] > DEFINITE).all())

    def settle(self, x: Floats) -> str:
        found = [mode for mode in self.of.modes if self.holds(mode, x)]
        if not found or (len(found) > 1 and not self.of.memory):
            raise NoAnswer(f"{len(found)} modes hold")
        return found[0]

    def run(self, x: Floats, mode: str) -> Ended:
        self.mode = mode or self.settle(x)
        t, last = 0.0, -math.inf
        for events in range(MOST_EVENTS):
            hit = self.left_at_once(x)
            if hit is None:
                t, x, hit = self.piece(t, x)
                if hit is None:
                    return Ended(x, self.mode, events)
                if t - last < TOGETHER * self.dt and self.of.modes[self.mode].guards[hit].reset:
                    raise PilesUp
                last = t
            guard = self.of.modes[self.mode].guards[hit]
            if guard.reset:
                anew = self.of.function(list(guard.reset.values()))(x.tolist(), self.u, self.p)
                x[[self.of.states.index(name) for name in guard.reset]] = anew
            self.mode = guard.to or self.settle(x)
        raise PilesUp

    def left_at_once(self, x: Floats) -> int | None:
        """A guard that is zero and falls, where a mode was entered by name."""
        z = self.inward(self.mode, x)
        value = self.guards(self.mode, z)
        for m in np.flatnonzero(value <= ON).tolist():
            if value[m] < -1e-7 or self.growth(self.mode, z)[m] < -DEFINITE:
                return int(m)
        return None

    def piece(self, t: float, x: Floats) -> tuple[float, Floats, int | None]:
        """Up to the next event, or to the end."""
        mode = self.mode
        z = self.inward(mode, x)
        watched, clear = self.of._guards[mode], (self.guards(mode, z) > ON).tolist()
        solver = self.solver(mode, t, z, self.dt)
        first = True
        while solver.status == "running":
            if message := solver.step():
                raise NoAnswer(message)
            at, begin, length = solver.dense_output(), solver.t_old, solver.t - solver.t_old
            shares = EVENLY if all(clear) or not first else CLOSELY
            before, first = begin, False
            for now, looked in zip((begin + length * shares).tolist(), at(begin + length * shares).T.tolist(), strict=True):
                value = watched(looked, self.u, self.p)
                if min(value, default=1.0) <= ON:  # else there is nothing near
                    if any(height < -THROUGH for height, seen in zip(value, clear, strict=True) if not seen):
                        self.lost(mode, value)
                    met = [m for m, height in enumerate(value) if height <= 0 and clear[m]]
                    if met:
                        times = {m: self.zero(mode, m, at, before, now) for m in met}
                        return self.met(mode, min(times, key=times.__getitem__), solver.t_old, solver.y_old, min(times.values()))
                if not all(clear):
                    clear = [seen or height > ON for seen, height in zip(clear, value, strict=True)]
                before = now
        return self.dt, self.outward(mode, solver.y), None

    def lost(self, mode: str, value: Sequence[float]) -> None:
        """A guard falls that has not risen since it was zero."""
        again = any(guard.reset for guard, height in zip(self.of.modes[mode].guards, value, strict=True) if height < -THROUGH)
        raise PilesUp if again else NoAnswer("grazes")

    def solver(self, mode: str, t: float, z: Floats, end: float) -> DOP853:
        function, u, p = self.of._rates[mode], self.u, self.p
        return DOP853(
            lambda _, x: function(x.tolist(), u, p), t, z, end, rtol=RTOL, atol=ATOL, max_step=max(LONGEST * self.dt, 1e-300)
        )

    def zero(self, mode: str, m: int, at: Callable[[float], Floats], low: float, high: float) -> float:
        def along(time: float) -> float:
            return float(self.guards(mode, at(time))[m])

        if along(low) <= 0:
            return low
        return float(brentq(along, low, high, xtol=1e-16, rtol=9e-16, disp=False))

    def met(self, mode: str, m: int, t: float, z: Floats, at: float) -> tuple[float, Floats, int]:
        """The event itself, by a step from t that ends there: dense output is less exact."""
        for _ in range(3):
            solver = self.solver(mode, t, z, max(at, t + 1e-15))
            while solver.status == "running":
                if message := solver.step():
                    raise NoAnswer(message)
            rate = float(self.growth(mode, solver.y)[m])
            if not abs(rate) > DEFINITE:
                raise NoAnswer("grazes")
            at = max(at - float(self.guards(mode, solver.y)[m]) / rate, t)
        return min(at, self.dt), self.outward(mode, solver.y), m


@dataclass(frozen=True)
class Slopes:
    """Derivatives by the parameters (n, p) of what ends a trajectory, their errors, and whether there are two sides of them."""

    value: Floats
    error: Floats
    bent: np.ndarray[Any, np.dtype[np.bool_]]


def slopes(end: Callable[[Floats], Floats], theta: Floats, steps: tuple[float, float] = STEPS) -> Slopes:
    """By extrapolated central differences.

    A bend that falls less than in proportion to the step is a kink of the end at these very parameters, or a root.
    """
    middle, values, errors, bends = end(theta), [], [], []
    for j in range(len(theta)):
        central, bend = [], []
        size = abs(theta[j]) or 1.0
        for share in steps:
            move = share * size * (np.arange(len(theta)) == j)
            up, down = end(theta + move), end(theta - move)
            central.append((up - down) / (2 * share * size))
            bend.append(np.abs(up + down - 2 * middle) / (2 * share * size))
        best = (4 * central[1] - central[0]) / 3
        noise = 3 * RTOL * (1 + np.abs(middle)) / (steps[-1] * size)
        values.append(best)
        errors.append(np.abs(central[1] - central[0]) + noise)  # where they do not converge as they should, too
        bends.append((bend[1] > 0.6 * bend[0]) & (bend[1] > 1e-6 * (1 + np.abs(best)) + 10 * noise))
    stack = [np.array(rows).T for rows in (values, errors, bends)]
    return Slopes(stack[0], stack[1], stack[2].astype(bool))


def by_sides(rates: Sequence[str], heights: Sequence[str]) -> dict[str, Mode]:
    """Modes of which each is one side of every height; in the rates S0 is the sign of the first one, and U0 1 above it, 0 below."""
    modes = {}
    for signs in itertools.product((1, -1), repeat=len(heights)):
        texts = list(rates)
        for m, sign in enumerate(signs):
            texts = [text.replace(f"S{m}", f"({sign})").replace(f"U{m}", str(int(sign > 0))) for text in texts]
        guards = [Guard(f"{sign}*({height})") for sign, height in zip(signs, heights, strict=True)]
        modes["".join("+" if sign > 0 else "-" for sign in signs)] = Mode(texts, guards)
    return modes


def with_more(modes: Mapping[str, Mode], before: Sequence[str], after: Sequence[str]) -> dict[str, Mode]:
    """Modes of a larger system, in which other states stand before and after these."""
    return {name: replace(mode, rates=[*before, *mode.rates, *after]) for name, mode in modes.items()}
