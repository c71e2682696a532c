"""Trajectories that are on several jumps at once, by SciPy: a mode after the other, each to its next event.

All sides that are consistent are looked for by trying every set of them, 3^k of k jumps. Written from the definition alone to check
the core, and slow. Where the jumps add to f one by one the slide on several is unique.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Sequence

import numpy as np
from scipy.integrate import DOP853

from filippov import Array, Course, NoAnswer, System

AT_ONCE = 1e-11
"""Surfaces that are met within this share of the duration are met at once."""


def course_of_several(
    system: System, x0: Sequence[float], u: Sequence[float], p: Sequence[float], dt: float, rtol: float = 1e-12
) -> Course:
    """Integrate from x0 over dt; raises `NoAnswer`."""
    return _Modes(system, np.array(u, dtype=float), np.array(p, dtype=float), dt, rtol).course(np.array(x0, dtype=float))


class _Modes:
    def __init__(self, system: System, u: Array, p: Array, dt: float, rtol: float) -> None:
        self.system, self.u, self.p, self.dt, self.rtol = system, u, p, dt, rtol

    def h(self, x: Array) -> Array:
        return np.array(self.system.h(x, self.u, self.p), dtype=float)

    def f(self, x: Array, side: Array) -> Array:
        return np.array(self.system.f(x, self.u, self.p, side), dtype=float)

    def normals(self, x: Array, which: Collection[int]) -> Array:
        """h_x of some surfaces, by central differences of which the error is of the fourth order."""
        found = np.empty((len(which), len(x)))
        for i, size in enumerate(self.system.size):
            e = np.zeros(len(x))
            e[i] = 1e-3 * size
            near, far = (self.h(x + e) - self.h(x - e))[list(which)], (self.h(x + 2 * e) - self.h(x - 2 * e))[list(which)]
            found[:, i] = (8 * near - far) / (12 * e[i])
        return found

    def parts(self, x: Array, side: Array, on: Sequence[int]) -> tuple[Array, Array]:
        """f at the middle of the sides of `on`, and what each of them adds, (n_x, k)."""
        up = side.copy()
        up[list(on)] = 1.0
        plus = self.f(x, up)
        adds = []
        for m in on:
            down = up.copy()
            down[m] = -1.0
            adds.append(0.5 * (plus - self.f(x, down)))
        matrix = np.array(adds).T.reshape(len(x), len(on))
        return plus - matrix.sum(axis=1), matrix

    def slide(self, x: Array, side: Array) -> tuple[Array, dict[int, float]]:
        """f on these sides, and the multipliers of the jumps that it slides on."""
        held = [int(m) for m in np.flatnonzero(side == 0)]
        if not held:
            return self.f(x, side), {}
        middle, adds = self.parts(x, side, held)
        normals = self.normals(x, held)
        multipliers = np.linalg.solve(normals @ adds, -normals @ middle)
        return middle + adds @ multipliers, dict(zip(held, multipliers.tolist(), strict=True))

    def settle(self, x: Array, side: Array, on: Sequence[int], released: dict[int, float]) -> Array:
        """The sides on which it goes on from where it is on these jumps."""
        middle, adds = self.parts(x, side, on)
        normals = self.normals(x, on)
        r0, r = normals @ middle, normals @ adds
        size = np.abs(r0) + np.abs(r).sum(axis=1)
        found = []
        for tried in itertools.product(*(((released[m],) if m in released else (1.0, -1.0, 0.0)) for m in on)):
            s = np.array(tried)
            free = s == 0
            if free.any():
                try:
                    s[free] = np.linalg.solve(r[np.ix_(free, free)], -(r0 + r[:, ~free] @ s[~free])[free])
                except np.linalg.LinAlgError:
                    continue
            least = np.array([-1e-4 if m in released else 1e-9 for m in on]) * size
            if (np.abs(s[free]) < 1).all() and (s * (r0 + r @ s) > least)[~free].all():
                found.append(tried)
        if len(found) != 1:
            raise NoAnswer(f"{len(found)} continuations")
        new = side.copy()
        new[list(on)] = found[0]
        return new

    def watched(self, x: Array, side: Array) -> Array:
        value = side * self.h(x)
        for m, multiplier in self.slide(x, side)[1].items():
            value[m] = 1 - multiplier**2
        return np.asarray(value)

    def course(self, x: Array) -> Course:
        value = self.h(x)
        side = np.where(value < 0, -1.0, 1.0)
        met: list[tuple[int, int]] = []
        if on := [int(m) for m in np.flatnonzero(np.abs(value) < 1e-14)]:
            side = self.settle(x, side, on, {})
        t, off = 0.0, np.array(on, dtype=int)
        for _ in range(400):
            t, x, hit = self.piece(t, x, side, off)
            if not hit:
                return Course(x, met, np.inf)
            released = {m: float(np.sign(self.slide(x, side)[1][m])) for m in hit if side[m] == 0}
            if len(released) < len(hit):
                x = self.polished(x, side, [m for m in hit if side[m] != 0])
            on = sorted({*hit, *np.flatnonzero(side == 0).tolist()})
            try:
                new = self.settle(x, side, on, released)
            except NoAnswer:
                new = self.settle(x, side, on, {})
            if any(side[m] and new[m] == side[m] for m in hit):
                raise NoAnswer("grazes")
            changed = np.flatnonzero(new != side)
            met += [(int(m), int(new[m])) for m in changed]
            side, off = new, changed
        raise NoAnswer("too many events")

    def piece(self, t: float, x: Array, side: Array, off: Array) -> tuple[float, Array, list[int]]:
        """Up to the next events."""
        size = self.system.size
        solver = DOP853(
            lambda _, z: self.slide(z * size, side)[0] / size,
            t,
            x / size,
            self.dt,
            rtol=max(self.rtol, 2.3e-14),
            atol=self.rtol,
            max_step=self.dt / 20,
        )
        clear = np.ones(len(side), dtype=bool)
        clear[off] = False
        while solver.status == "running":
            if message := solver.step():
                raise NoAnswer(message)
            at = solver.dense_output()
            times: dict[int, float] = {}
            grid = np.concatenate([[0.0], np.geomspace(1e-7, 1.0, 30)] if not clear.all() else [np.linspace(0, 1, 7)])
            start = solver.t_old
            for share in grid[1:]:
                end = solver.t_old + share * (solver.t - solver.t_old)
                now = self.watched(at(end) * size, side)
                for m in np.flatnonzero((now <= 0) & clear):
                    if int(m) not in times:
                        times[int(m)] = self.zero(lambda time, m=m, at=at: self.watched(at(time) * size, side)[m], start, end)
                clear |= now > 0
                start = end
                if times:
                    break
            if times:
                first = min(times.values())
                return first, at(first) * size, [m for m, time in times.items() if time <= first + AT_ONCE * self.dt]
        return self.dt, solver.y * size, []

    @staticmethod
    def zero(value, low: float, high: float) -> float:  # type: ignore[no-untyped-def]
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if value(middle) > 0 else (low, middle)
        return high

    def polished(self, x: Array, side: Array, which: list[int]) -> Array:
        """Onto the surfaces, by the smallest step."""
        for _ in range(3):
            normals = self.normals(x, which) * self.system.size
            x = x - self.system.size * np.linalg.lstsq(normals, self.h(x)[which], rcond=1e-10)[0]
        return x
