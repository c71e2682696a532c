"""What is checked of one random case, and by which route.

What is promised (docs/explanation/integration.md): end states are exact to `rtol` in units of the states' sizes for 99 % of the
points, and every column of sensitivities in units of its own size. Local errors are what is controlled, so where a model magnifies
deviations the end may be further off by the magnification. So an error counts as wrong where it is above ALLOWED = 100 times rtol,
in these units, and above 100 times what a deviation of rtol grows to on the way, which is measured. A hundred is what separates the
rare point whose step saw too little from one that is wrong: the worst of 30,000 points of the paper's cylinder is 10 rtol off.

Jumps are excluded, as SciPy's route ends there; tests/python/test_jumps.py compares trajectories that cross them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import numpy as np

import fisherpoint as fp
from figures import Figures, Finding
from random_models import Case
from reading import Floats, Reading
from room import by_own_rounding, by_rounding, output_slopes, undecided
from scipy_route import Course, course

TIGHT = 1e-12
ALLOWED = 100.0
CLOSE = 1000.0  # times rtol: nearer to a surface than this, nobody can tell
ROUNDING = 1e-12  # of the largest number on the way
COUNT = 24  # points of a case
OK = fp.Status.ok


@dataclass
class Bench:
    """One case at work: its model, points and parameters; and what was found."""

    case: Case
    figures: Figures
    findings: list[Finding] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.model: Any = self.case.model()
        self.points, self.theta = self.case.points(COUNT)
        self._admit()
        self._courses: dict[int, Course] = {}
        self.growths: dict[tuple[int, float], float] = {}  # see magnification

    def _admit(self) -> None:
        """Leave out points that are refused, as those that start on a surface."""
        try:
            fp.simulate(self.model, self.points, self.theta, threads=1, jumps="exclude")
            return
        except ValueError:
            pass
        kept = []
        for k in range(len(self.points)):
            try:
                fp.simulate(self.model, self.points[k], self.theta[k], threads=1, jumps="exclude")
                kept.append(k)
            except ValueError as error:
                self.figures.count("points refused")
                if "\n" in str(error):
                    self.report("message of several lines", 1.0, k, "fp.simulate(model, points, theta)", repr(str(error)))
        self.points, self.theta = self.points[kept], self.theta[kept]

    @cached_property
    def reading(self) -> Reading:
        return self.case.reading()

    @cached_property
    def moving_jumps(self) -> list[bool]:
        """Whether the time of each jump depends on a parameter; others are crossed in any case."""
        if not isinstance(self.model, fp.SymbolicModel):
            return []
        return list(self.model.structure.programs.varying_surfaces[: len(self.model.jumps)])

    @cached_property
    def tight(self) -> fp.Trajectories:
        """Of all points, at the tightest tolerance that is sensible."""
        return self.simulate(self.points, self.theta, TIGHT)

    def simulate(self, points: fp.Experiments, theta: Floats, rtol: float, method: str | None = None) -> fp.Trajectories:
        self.figures.count("calls")
        self.figures.count("trajectories", len(points))
        done = fp.simulate(self.model, points, theta, rtol=rtol, threads=1, method=method, jumps="exclude")
        self.finite("fp.simulate", done, rtol)
        return done

    def finite(self, what: str, results: Any, rtol: float) -> None:
        """No number that is not finite may leave, whatever the status is."""
        for array in results:
            bad = np.flatnonzero(~np.isfinite(array).all(axis=tuple(range(1, array.ndim))))
            if len(bad) and len(array) == len(self.points):
                k = int(bad[0])
                self.report("not finite", math.inf, k, f"{what}(model, points, theta, rtol={rtol:g})", "inf or NaN")
            elif len(bad):
                self.report("not finite", math.inf, 0, f"{what}(...)", "inf or NaN, at other points or parameters than these")

    def course(self, k: int) -> Course:
        """Of point k, by SciPy."""
        if k not in self._courses:
            x0, u, dt = self.points.x0[k], self.points.u[k], self.points.dt[k]
            self._courses[k] = course(self.reading, x0, u, self.theta[k], dt, self.case.sizes)
            self.figures.count("trajectories by SciPy")
            self.figures.count(f"trajectories by SciPy: {self._courses[k].end.name}")
            self.figures.count("trajectories by SciPy that cross a kink", bool(self._courses[k].crossed))
        return self._courses[k]

    def close_course(self, k: int) -> Course:
        """As `course`, in short steps, between which no pair of crossings is missed."""
        return course(
            self.reading,
            self.points.x0[k],
            self.points.u[k],
            self.theta[k],
            self.points.dt[k],
            self.case.sizes,
            longest=1.0 / 500,
        )

    def undecided(self, k: int) -> bool:
        """Whether rounding decides which way point k goes: at a condition whose sides are the same."""
        point, shares = self.points[k], np.array([0.1, 0.3, 0.5, 0.7, 0.9, 1.0])
        way = fp.Experiments(np.repeat(point.x0, 6, 0), np.repeat(point.u, 6, 0), point.dt * shares)
        seen = np.vstack([point.x0, fp.simulate(self.model, way, self.theta[k], threads=1, jumps="exclude").x])
        u, p, unit = self.points.u[k].tolist(), self.theta[k].tolist(), self.case.sizes / self.case.time
        return any(undecided(self.reading, x, u, p, unit) for x in seen.tolist())

    def code(self, k: int, call: str, remark: str, theta: bool = True) -> str:
        shown = self.case.point_code(self.points, k, self.theta[k] if theta else None)
        return f"{shown}\nprint({call})\n# {remark}"

    def report(self, kind: str, ratio: float, k: int, call: str, remark: str, theta: bool = True) -> None:
        """Put down what is wrong; once of a kind for every case."""
        if all(finding.kind != kind for finding in self.findings):
            self.findings.append(Finding(kind, float(ratio), self.code(k, call, remark, theta)))

    def excluded_wrongly(self, kind: str, k: int, call: str, remark: str) -> None:
        self.figures.count(f"false exclusions: {kind}")
        self.figures.example(Finding(f"false exclusion, {kind}", 1.0, self.code(k, call, remark)))


# --- how deviations grow --------------------------------------------------------------------------------------------------


def magnification(bench: Bench, k: int, rtol: float) -> float:
    """What a deviation by rtol, anywhere on the way, has grown to at the end; at least 1."""
    if (k, rtol) not in bench.growths:
        bench.growths[k, rtol] = _magnification(bench, k, rtol)
    return bench.growths[k, rtol]


def _magnification(bench: Bench, k: int, rtol: float) -> float:
    points, theta, size = bench.points[k], bench.theta[k : k + 1], bench.case.sizes
    largest = 1.0
    for share in (0.0, 0.05, 0.25, 0.5, 0.75, 0.9, 0.98):
        x0 = points.x0
        if share:
            part = fp.Experiments(x0, points.u, points.dt * share)
            way = fp.simulate(bench.model, part, theta, rtol=TIGHT, threads=1, jumps="exclude")
            if way.status[0] != OK:
                continue
            x0 = way.x
        deviation = rtol * np.concatenate([np.zeros((1, len(size))), np.diag(size), -np.diag(size)])
        moved = fp.Experiments(
            x0 + deviation, np.repeat(points.u, len(deviation), 0), np.repeat(points.dt, len(deviation)) * (1 - share)
        )
        try:
            ends = fp.simulate(bench.model, moved, theta[0], rtol=TIGHT, threads=1, jumps="exclude")
        except ValueError:
            return math.inf
        if ends.status.any():
            return math.inf  # too near to a surface to tell
        largest = max(largest, float(np.max(np.abs(ends.x[1:] - ends.x[0]) / size)) / rtol)
    return largest


def state_error(bench: Bench, actual: Floats, expected: Floats) -> Floats:
    """Errors (K,) in units of the states' sizes, less what rounding may do."""
    error = np.abs(actual - expected) - ROUNDING * np.maximum(np.abs(actual), np.abs(expected))
    return np.max(error / bench.case.sizes, axis=-1, initial=0.0)


# --- right-hand sides and outputs ------------------------------------------------------------------------------------------


def check_functions(bench: Bench) -> None:
    """f at the starts and g at the ends are those that Python makes of the texts."""
    case, reading, points = bench.case, bench.reading, bench.points

    def rates(x: list[float], u: list[float], p: list[float]) -> list[float] | None:
        return reading.held(x, u, p, reading.sides(x, u, p))

    def rough_rates(x: list[float], u: list[float], p: list[float]) -> list[float] | None:
        return reading.rough.held(x, u, p, reading.rough.sides(x, u, p))

    f = bench.model.core.rhs(points.x0, points.u, bench.theta) if case.rates else None
    for k in range(len(points)):
        x0, u, p = points.x0[k].tolist(), points.u[k].tolist(), bench.theta[k].tolist()
        if f is not None:
            expected = rates(x0, u, p)
            unit = case.sizes / case.time
            whole = expected is not None and np.isfinite(expected).all() and np.isfinite(f[k]).all()
            if whole and 0 not in reading.sides(x0, u, p):
                allowed = 1e-9 * (unit * 1e3 + np.abs(expected)) + by_rounding(rates, expected, x0, u, p)
                call = "model.rhs(points.x0[0], points.u[0], theta)"
                own = partial(by_own_rounding, rough_rates, expected, x0, u, p)
                compare(bench, "right-hand side", f[k], np.array(expected), allowed, k, call, own)
        if bench.tight.status[k] == OK:
            x = bench.tight.x[k].tolist()
            expected, slopes = reading.output(x, u, p), output_slopes(reading, x, u, p)
            if expected is not None and np.isfinite(expected).all():
                room = np.abs(np.nan_to_num(slopes)) @ np.abs([*x, *p]) + np.abs(expected) + 1
                allowed = 1e-9 * room + by_rounding(reading.output, expected, x, u, p)
                call = f"fp.simulate(model, points, theta, rtol={TIGHT}, jumps='exclude').y"
                values = expected, x, u, p
                own = partial(by_own_rounding, reading.rough.output, *values)
                compare(bench, "output", bench.tight.y[k], np.array(expected), allowed, k, call, own)


def compare(
    bench: Bench, what: str, given: Floats, expected: Floats, allowed: Floats, k: int, call: str, own: Callable[[], Floats]
) -> None:
    """Compare numbers; `own` is what roundings on the way to them make of them, and is asked where that decides."""
    bench.figures.count(f"{what} compared")
    ratio = float(np.max(np.abs(given - expected) / allowed, initial=0.0))
    if ratio > 1:
        ratio = float(np.max(np.abs(given - expected) / (allowed + own())))
    if ratio > 1:
        bench.report(f"{what} differs", ratio, k, call, f"expected {expected.tolist()}, given {given.tolist()}")


def check_static(bench: Bench) -> None:
    """Of a model without states: it has a value exactly where its roots and logarithms have one."""
    if bench.case.rates or not len(bench.points):
        return
    done = bench.tight
    for k in range(len(bench.points)):
        seen = bench.reading.look_at_output([], bench.points.u[k].tolist(), bench.theta[k].tolist())
        roots = [value for place, value in seen.items() if not bench.reading.limits[place].pole]
        if any(abs(value) < 1e-9 for value in seen.values()):
            continue
        defined = bench.reading.output([], bench.points.u[k].tolist(), bench.theta[k].tolist()) is not None
        bench.figures.count("static points")
        if done.status[k] == OK and not defined:
            bench.report("wrong ok: static", 1.0, k, "fp.simulate(model, points, theta)", f"y = {done.y[k].tolist()}")
        elif done.status[k] != OK and defined and all(value > 0 for value in roots):
            name = fp.Status(done.status[k]).name
            bench.figures.count(f"exclusions without a reason: {name}")
            bench.excluded_wrongly(f"{name}, static", k, "fp.simulate(model, points, theta)", f"status {name}; limits {seen}")
