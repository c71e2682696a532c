"""Trajectories by SciPy and Python alone: what the campaign takes for the truth.

DOP853 at rtol 1e-10, step after step, with the sides of all surfaces held; every step's dense output is looked at in between, and
where a surface changes its sign the trajectory ends there or goes on from there on the other side.
"""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import numpy as np
from scipy.integrate import DOP853, Radau
from scipy.optimize import brentq, minimize_scalar

from reading import Floats, Reading, side_of

RTOL, FINE = 1e-10, 1e-12  # of states in units of their sizes; for differences
MOST_STEPS, MOST_STIFF_STEPS, MOST_CROSSINGS = 600, 150, 60
LONGEST = 1 / 25  # step of models with surfaces, as a share of dt
LOOKS = 8  # at the dense output of a step
SAME = 1e-8  # relative difference of f up to which its two sides at a surface are the same
ROUNDING = 1e-13  # of the largest rate on the way


class End(Enum):
    """How a trajectory ends."""

    ok = "ok"
    jump = "f jumps on the way"
    domain = "f has no value on the way"
    blow_up = "the state grows past all bounds"
    unknown = "SciPy does not get to the end, or it is too close to tell"


@dataclass
class Course:
    """One trajectory.

    Attributes
    ----------
    x : ndarray, (n_x,)
        At the end; where `end` is not ok, where it happened.
    end : End
    at : float
        Time of what ended it.
    surface : int or None
        Which surface or limit.
    depth : float
        How far it would go past the surface, in units of the states' sizes; infinite where that is not known.
    crossed : list of int
        The kinks on the way, in their order, and surfaces where f does not change at all.
    clearance : dict
        Of every surface and limit, by (kind, place): how near the trajectory comes to it, in units of the states' sizes.
    largest : ndarray, (n_x,)
        The largest size of every state on the way.
    output_lost : bool
        Whether g has no value somewhere on the way, or a divisor of it changes its sign.
    way : list of list
        States on the way.
    steps : int
    stiff : bool
        Whether it took an implicit method, which is less accurate.
    """

    x: Floats
    end: End = End.ok
    at: float = math.inf
    surface: int | None = None
    depth: float = math.inf
    crossed: list[int] = field(default_factory=list)
    clearance: dict[tuple[str, int], float] = field(default_factory=dict)
    largest: Floats = field(default_factory=lambda: np.zeros(0))
    output_lost: bool = False
    way: list[list[float]] = field(default_factory=list)
    steps: int = 0
    stiff: bool = False


class _Ended(Exception):
    """The trajectory ends here."""


def course(
    reading: Reading, x0: Floats, u: Floats, p: Floats, dt: float, size: Floats, careful: bool = True, longest: float = LONGEST
) -> Course:
    """The trajectory from x0 over dt; states are measured by `size` (n_x,). Careful: less exact, but least distances too.

    With surfaces no step is longer than `longest`, as a share of dt.
    """
    return _Walk(
        reading, np.asarray(x0, float), tuple(map(float, u)), tuple(map(float, p)), float(dt), size, careful, longest
    ).run()


class _Walk:
    def __init__(
        self,
        reading: Reading,
        x0: Floats,
        u: tuple[float, ...],
        p: tuple[float, ...],
        dt: float,
        size: Floats,
        careful: bool,
        longest: float,
    ) -> None:
        self.careful, self.longest = careful, longest
        self.reading, self.x0, self.u, self.p, self.dt, self.size = reading, x0, u, p, dt, size
        self.done = Course(x0.copy(), largest=np.abs(x0))
        self.sides: list[int] = []
        self.fresh: set[int] = set()  # surfaces that were just crossed, whose sign is not settled
        self.signs: dict[int, bool] = {}
        self.output_signs: dict[int, bool] = {}
        self.seen: dict[tuple[str, int], list[float]] = {}  # heights at the looks of this step
        self.least: dict[tuple[str, int], tuple[float, Floats, list[int]]] = {}

    def run(self) -> Course:
        heights = self.reading.heights(self.x0.tolist(), self.u, self.p)
        self.sides = [side_of(height) for height in heights]
        limits = self.reading.look(self.x0.tolist(), self.u, self.p, self.sides)
        if self.rates(self.x0) is None or any(v <= 0 and not self.reading.limits[k].pole for k, v in limits.items()):
            on_edge = all(v == 0 for k, v in limits.items() if v <= 0 and not self.reading.limits[k].pole)
            self.done.end, self.done.at, self.done.depth = End.unknown if on_edge else End.domain, 0.0, math.inf
            return self.done
        self.look_at_output(self.x0)
        self.done.way.append(self.x0.tolist())
        self.signs = {k: v > 0 for k, v in limits.items()}
        with contextlib.suppress(_Ended):
            self.pieces()
        self.done.clearance = self.clearances()
        return self.done

    def rates(self, x: Floats) -> Floats | None:
        f = self.reading.held(x.tolist(), self.u, self.p, self.sides)
        return None if f is None or not all(map(math.isfinite, f)) else np.array(f)

    def scaled(self, _: float, z: Floats) -> Floats:
        f = self.rates(z * self.size)
        return np.full(len(z), np.nan) if f is None else f * self.dt / self.size

    def pieces(self) -> None:
        """Time is in units of the duration, from 0 to 1."""
        t, z = 0.0, self.x0 / self.size
        for _ in range(MOST_CROSSINGS):
            t, z = self.piece(t, z)
            if t >= 1.0:
                self.done.x = z * self.size
                return
        self.end(End.unknown, t, z)

    def piece(self, t: float, z: Floats) -> tuple[float, Floats]:
        if self.rates(z * self.size) is None:
            self.end(End.unknown, t, z)  # SciPy would look for a first step without end
        solver: Any = self.solver(t, z)
        while True:
            try:
                with np.errstate(all="ignore"):
                    failed = solver.step()
            except (ValueError, ArithmeticError, np.linalg.LinAlgError):
                failed = "stopped"
            self.done.steps += 1
            if failed or solver.status == "failed":
                self.stuck(solver.t, solver.y)
            if self.done.steps > MOST_STEPS and not self.done.stiff:
                self.done.stiff = True
                solver = self.solver(solver.t, solver.y)
                continue
            if self.done.steps > MOST_STEPS + MOST_STIFF_STEPS:
                self.end(End.unknown, solver.t, solver.y)
            dense, before = solver.dense_output(), solver.t_old
            looks = LOOKS if self.reading.surfaces or self.reading.limits else 1
            times, self.seen = np.linspace(solver.t_old, solver.t, looks + 1)[1:], {}
            for now in times:
                crossing = self.look(dense, before, now)
                if crossing is not None:
                    return crossing
                before = now
            if self.careful:
                self.refine(dense, times)
            if solver.status == "finished":
                return 1.0, solver.y

    def solver(self, t: float, z: Floats) -> Any:
        with np.errstate(all="ignore"):
            if self.done.stiff:
                return Radau(self.scaled, t, z, 1.0, rtol=1e-9, atol=1e-11)
            rtol = RTOL if self.careful else FINE
            # A surface that is met twice between two looks is not seen: looks are near each other.
            most = self.longest if self.reading.surfaces or self.reading.limits else np.inf
            return DOP853(self.scaled, t, z, 1.0, rtol=rtol, atol=rtol / 100, max_step=most)

    def end(self, end: End, t: float, z: Floats, surface: int | None = None, depth: float = math.inf) -> None:
        self.done.end, self.done.at, self.done.x = end, t * self.dt, z * self.size
        self.done.surface, self.done.depth = surface, depth
        raise _Ended

    def look(self, dense: Any, before: float, now: float, back: float = 1e-6) -> tuple[float, Floats] | None:
        """Look at the surfaces and limits between two times; where a kink is crossed, the time and state there.

        Where another was met before, it is looked for further and further back, first by this share of the time.
        """
        z = dense(now)
        x = z * self.size
        if not np.isfinite(x).all():
            self.end(End.blow_up, now, z)
        self.done.largest = np.maximum(self.done.largest, np.abs(x))
        if self.careful:
            self.done.way.append(x.tolist())
        heights = self.reading.heights(x.tolist(), self.u, self.p)
        self.look_at_output(x)
        limits = self.reading.look(x.tolist(), self.u, self.p, self.sides)
        crossed: list[tuple[float, str, int]] = []
        for m, height in enumerate(heights):
            self.near("surface", m, height, x)
            if math.isnan(height) or side_of(height) == self.sides[m]:
                self.fresh.discard(m)
            elif m not in self.fresh:
                crossed.append((self.root(dense, before, now, "surface", m), "surface", m))
            else:  # back over the kink at once: it was grazed
                self.end(End.unknown, now, z)
        for k, value in limits.items():
            self.near("limit", k, value, x)
            if (value > 0) != self.signs.setdefault(k, value > 0 or not self.reading.limits[k].pole):
                crossed.append((self.root(dense, before, now, "limit", k), "limit", k))
        if not crossed:
            return None
        at, kind, place = min(crossed)
        if self.met_before(dense, before, at, place):
            if back >= 1:
                self.end(End.unknown, at, dense(at))
            return self.look(dense, before, at - back * (at - before), 4 * back)
        z = dense(at)
        if kind == "limit" and self.removable(dense, before, at):
            self.done.output_lost = True  # to be excluded there is no mistake
            self.signs[place] = not self.signs[place]
            return None
        if kind == "limit":
            unit = self.unit(x, kind, place)
            self.end(End.domain, at, z, place, abs(self.height(x, kind, place)) / unit if unit > 0 else math.inf)
        after = self.beyond(dense, at, now, place, side_of(heights[place]))
        if self.jumps(dense, before, at, now, after):
            self.end(End.jump, at, z, place, self.depth(at, z, place))
        if self.crawls(z, place):
            self.end(End.unknown, at, z)
        changed = [m for m, side in enumerate(after) if side != self.sides[m]]
        self.done.crossed += changed
        self.sides = after
        self.fresh.update(changed)
        at = self.entered(dense, at, now)
        return at, dense(at)

    def met_before(self, dense: Any, before: float, at: float, place: int) -> bool:
        """Whether another surface was passed before `at` that is passed back until the look after it, and so was not seen."""
        heights = self.reading.heights((dense(at - 1e-6 * (at - before)) * self.size).tolist(), self.u, self.p)
        others = [m for m in range(len(heights)) if m != place and m not in self.fresh and not math.isnan(heights[m])]
        return any(side_of(heights[m]) == -self.sides[m] != 0 for m in others)

    def crawls(self, z: Floats, place: int) -> bool:
        """Whether a trajectory on a kink does not get off it, as that of x' = |x| does: errors alone have led it there."""
        x, here = z * self.size, self.rates(z * self.size)
        ahead = math.nan if here is None else self.height(x + 1e-6 * self.dt * here, "surface", place)
        return abs(ahead - self.height(x, "surface", place)) < 1e-14 * self.unit(x, "surface", place)

    def entered(self, dense: Any, at: float, now: float) -> float:
        """When f has a value past a surface: rounding may leave a root's argument below zero at the very place."""
        for share in (0.0, 1e-12, 1e-9, 1e-6):
            if self.rates(dense(at + share * (now - at)) * self.size) is not None:
                return at + share * (now - at)
        return at

    def beyond(self, dense: Any, at: float, now: float, place: int, side: int) -> list[int]:
        """The sides of all surfaces past one that is crossed. Others may change with it, as one whose own height jumps there."""
        after = self.sides
        for share in (1e-6, 1e-3, 0.1, 1.0):
            heights = self.reading.heights((dense(at + share * (now - at)) * self.size).tolist(), self.u, self.p)
            after = [old if math.isnan(height) else side_of(height) for old, height in zip(self.sides, heights, strict=True)]
            if after[place] == side:  # nearer, rounding may decide
                break
        return after

    def removable(self, dense: Any, before: float, at: float) -> bool:
        """Whether f goes on smoothly up to a limit, as 1/(1/x) does: its changes become smaller in proportion on the way there."""
        ways = [(at - before) * share for share in (4e-3, 2e-3, 1e-3)]
        far, near, nearest = (self.rates(dense(at - way) * self.size) for way in ways)
        if far is None or near is None or nearest is None:
            return False
        return bool(np.all(np.abs(near - nearest) <= 0.6 * np.abs(far - near) + 1e-9 * np.abs(nearest)))

    def look_at_output(self, x: Floats) -> None:
        for k, value in self.reading.look_at_output(x.tolist(), self.u, self.p).items():
            pole = self.reading.limits[k].pole
            if (value > 0) != self.output_signs.setdefault(k, value > 0 or not pole):
                self.done.output_lost = True

    def height(self, x: Floats, kind: str, place: int) -> float:
        if kind == "surface":
            return self.reading.heights(x.tolist(), self.u, self.p)[place]
        return self.reading.look(x.tolist(), self.u, self.p, self.sides).get(place, math.nan)

    def root(self, dense: Any, before: float, now: float, kind: str, place: int) -> float:
        def along(t: float) -> float:
            value = self.height(dense(t) * self.size, kind, place)
            return 0.0 if math.isnan(value) else value

        if along(before) * along(now) < 0:
            # Where rounding decides about the sign, it may not converge to the last bit.
            return float(brentq(along, before, now, xtol=1e-16, rtol=9e-16, disp=False))
        if kind == "limit" or side_of(along(before)) != self.sides[place]:
            return before
        while now - before > 1e-15:  # a height that is zero on a whole side has a step, and no root
            middle = (before + now) / 2
            before, now = (middle, now) if side_of(along(middle)) == self.sides[place] else (before, middle)
        return now

    def refine(self, dense: Any, times: Floats) -> None:
        """Find the least distances within a step, where parabolas through the looks come near to zero."""
        for (kind, place), seen in self.seen.items():
            if len(seen) < len(times) or not all(map(math.isfinite, seen)):
                continue
            for k in range(1, len(times) - 1):
                bend, slope = seen[k - 1] - 2 * seen[k] + seen[k + 1], (seen[k + 1] - seen[k - 1]) / 2
                if bend * seen[k] <= 0 or abs(slope) > abs(bend) or abs(seen[k] - slope * slope / (2 * bend)) > 0.3 * abs(seen[k]):
                    continue

                def along(now: float, kind: str = kind, place: int = place) -> float:
                    return abs(self.height(dense(now) * self.size, kind, place))

                found = minimize_scalar(along, bounds=(times[k - 1], times[k + 1]), method="bounded", options={"maxiter": 30})
                x = dense(found.x) * self.size
                self.nearest(kind, place, float(found.fun), x)
                if self.height(x, kind, place) * seen[k] < 0:  # there and back within the step
                    self.end(End.unknown, float(found.x), dense(found.x))

    def near(self, kind: str, place: int, height: float, x: Floats) -> None:
        self.seen.setdefault((kind, place), []).append(height)
        self.nearest(kind, place, height, x)

    def nearest(self, kind: str, place: int, height: float, x: Floats) -> None:
        if not abs(height) >= self.least.get((kind, place), (math.inf,))[0]:
            self.least[kind, place] = (abs(height), x, self.sides)

    def clearances(self) -> dict[tuple[str, int], float]:
        """How near the trajectory came to every surface, measured by what changes of all states by their sizes do to its height."""
        last, found = self.sides, {}
        for (kind, place), (height, x, sides) in self.least.items():
            self.sides = sides
            unit = self.unit(x, kind, place)
            found[kind, place] = height / unit if unit > 0 else math.inf
        self.sides = last
        return found

    def unit(self, x: Floats, kind: str, place: int) -> float:
        here, total = self.height(x, kind, place), 0.0
        for i, size in enumerate(self.size):
            step = 1e-6 * max(size, abs(x[i]))
            moved = x.copy()
            moved[i] += step
            slope = (self.height(moved, kind, place) - here) / step * size
            total += 0.0 if math.isnan(slope) else abs(slope)
        return total

    def jumps(self, dense: Any, before: float, at: float, now: float, after: list[int]) -> bool:
        """Whether f differs between the sides before a surface and those `after` it, on it, measured by f beside it."""
        (here, there), *beside = (self.on_both(dense(t), dense(t), after) for t in (at, before, now))
        if here is None or there is None:  # rounding decides whether a root has a value on its edge
            return not self.meets(dense, before, at, now, after)
        size = np.abs(here) + np.abs(there)
        for a, b in beside:
            if a is not None and b is not None:
                size = np.maximum(size, np.abs(a) + np.abs(b))
        if not np.any(np.abs(here - there) > SAME * size + ROUNDING * self.fastest()):
            return False
        return not self.meets(dense, before, at, now, after)  # a root makes much of how little the surface is missed by

    def on_both(self, first: Floats, second: Floats, after: list[int]) -> tuple[Floats | None, Floats | None]:
        """f at two states, the first on the sides that hold now, the second on those `after` a surface."""
        sides, a = self.sides, self.rates(first * self.size)
        self.sides = after
        b = self.rates(second * self.size)
        self.sides = sides
        return a, b

    def meets(self, dense: Any, before: float, at: float, now: float, after: list[int]) -> bool:
        """Whether the difference of f before and past a surface becomes smaller on the way there, as that of a root does."""
        gaps = []
        for share in (4e-3, 1e-3):
            here, there = self.on_both(dense(at - share * (at - before)), dense(at + share * (now - at)), after)
            if here is None or there is None:
                return False
            gaps.append(np.abs(here - there) - SAME * (np.abs(here) + np.abs(there)))
        return bool(np.all(gaps[1] <= 0.6 * np.maximum(gaps[0], 0.0) + ROUNDING * self.fastest()))

    def fastest(self) -> Floats:
        """The largest rate of every state on the way: of a state at rest, its terms cancel to rounding alone."""
        rates = [rate for x in [self.x0.tolist(), *self.done.way] if (rate := self.rates(np.array(x))) is not None]
        return np.max(np.abs(rates), axis=0) if rates else np.zeros(len(self.x0))

    def depth(self, t: float, z: Floats, place: int) -> float:
        """How far the trajectory would go past a surface if f went on as before it."""
        unit = self.unit(z * self.size, "surface", place)
        sign, deepest = self.sides[place], 0.0
        with np.errstate(all="ignore"):
            solver = DOP853(self.scaled, t, z, 1.0, rtol=1e-9, atol=1e-12)
            for _ in range(100):
                try:
                    if solver.status != "running" or solver.step():
                        break
                except (ValueError, ArithmeticError):
                    break
                height = self.reading.heights((solver.y * self.size).tolist(), self.u, self.p)[place]
                if not math.isnan(height):
                    deepest = max(deepest, -sign * height if sign else abs(height))
        return deepest / unit if unit > 0 else math.inf

    def stuck(self, t: float, z: Floats) -> None:
        """No step is small enough: at a limit, or where the state grows past all bounds, or for no reason that is seen."""
        x = z * self.size
        f = self.rates(x)
        if f is None or np.max(np.abs(z)) > 1e6 * (1 + np.max(np.abs(self.x0 / self.size))):
            self.end(End.blow_up, t, z)
        assert f is not None
        here, beside = (self.reading.heights(at.tolist(), self.u, self.p) for at in (x, x + f * 1e-6 * self.dt))
        if any(a * b < 0 for a, b in zip(here, beside, strict=True)):  # past a kink that is met with it a limit may be none
            self.end(End.unknown, t, z)
        for k, value in self.reading.look(x.tolist(), self.u, self.p, self.sides).items():
            step = 1e-7 * self.dt
            ahead = self.reading.look((x + f * step).tolist(), self.u, self.p, self.sides).get(k, math.nan)
            slope = (ahead - value) / step
            if math.isnan(slope) or (slope * value < 0 and abs(value / slope) < 1e-6 * self.dt):
                self.end(End.domain, t, z, k)
        self.end(End.unknown, t, z)
