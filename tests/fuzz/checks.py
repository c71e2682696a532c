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
from scipy.integrate import solve_ivp

import fisherpoint as fp
from figures import Figures, Finding
from random_models import Case
from reading import Floats, Reading, side_of
from room import by_own_rounding, by_rounding, output_slopes, undecided
from scipy_route import Course, End, course

TIGHT = 1e-12
TOLERANCES = (1e-4, 1e-6, 1e-9)
METHODS = ("RK45", "DOP853", "Radau")
ALLOWED = 100.0
CLOSE = 1000.0  # times rtol: nearer to a surface than this, nobody can tell
ROUNDING = 1e-12  # of the largest number on the way
LOOKED_AROUND, TURNS = 301, 8  # places around a state, and signs of its rate that change there
NEXT_TO = 0.02  # of a state's size
CHANCE = "states off by a chance of the error's estimate"
LOOSE = 1e-4
CHANCES = 5e-5  # of all trajectories, the share of which that may be true
COUNT = 24  # points of a case
COURSES = 4  # of them that SciPy integrates
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


# --- states and statuses --------------------------------------------------------------------------------------------------


def check_states(bench: Bench) -> None:
    """Every tolerance and method against the tightest, and against SciPy where statuses differ and for a few others."""
    if not bench.case.rates or not len(bench.points):
        return
    results = {(rtol, method): bench.simulate(bench.points, bench.theta, rtol, method) for rtol in TOLERANCES for method in METHODS}
    suspects: list[int] = []
    for (rtol, method), done in results.items():
        for status in fp.Status:
            bench.figures.count(f"status {status.name}", int((done.status == status).sum()))
        both = (done.status == OK) & (bench.tight.status == OK)
        error = np.where(both, state_error(bench, done.x, bench.tight.x), 0.0)
        bench.figures.count("trajectories compared with rtol 1e-12", int(both.sum()))
        for k in np.flatnonzero(error > 3 * ALLOWED * rtol)[:2].tolist():
            error[k] /= magnification(bench, k, rtol)
            suspects += [k] * bool(error[k] > ALLOWED * rtol)
        error[error > 3 * ALLOWED * rtol] = 0.0  # where the first two are right, so may these be
        bench.figures.ratio(f"states against rtol {TIGHT:g}, {method} {rtol:g}", float(np.max(error / rtol, initial=0.0)))
    statuses = np.array([done.status for done in results.values()] + [bench.tight.status])
    suspects += np.flatnonzero((statuses != statuses[0]).any(axis=0)).tolist()
    others = {int(status): int(k) for k, status in reversed(list(enumerate(bench.tight.status)))}
    chosen = list(dict.fromkeys([*suspects, *sorted(others.values()), *range(len(bench.points))]))[:COURSES]
    for k in chosen:
        for (rtol, method), done in results.items():
            judge(
                bench,
                k,
                int(done.status[k]),
                done.x[k],
                rtol,
                f"fp.simulate(model, points, theta, rtol={rtol:g}, method={method!r}, jumps='exclude')",
                method,
            )


def judge(bench: Bench, k: int, status: int, x: Floats, rtol: float, call: str, method: str | None = None) -> None:
    """Compare one result with SciPy's."""
    true, name = bench.course(k), fp.Status(status).name
    bench.figures.count("judged by SciPy")
    if true.end is End.unknown:
        return
    if status == OK and true.end is End.ok:
        judge_state(bench, k, true, x, rtol, call, method)
    elif status == OK:
        judge_ok(bench, k, true, rtol, call)
    elif true.end is End.ok:
        judge_exclusion(bench, k, true, name, rtol, call)


def judge_state(bench: Bench, k: int, true: Course, x: Floats, rtol: float, call: str, method: str | None) -> None:
    """A trajectory that gets to its end, here and there."""
    if true.stiff and rtol < 1e-6:
        return
    error, growth = float(state_error(bench, x, true.x)), 1.0
    if error > ALLOWED * rtol:
        growth = magnification(bench, k, rtol)
        error /= growth
    if error > ALLOWED * rtol and bench.undecided(k):
        bench.figures.count("conditions that rounding decides about")
        return
    if error > ALLOWED * rtol and by_chance(bench, k, true, rtol, growth, method):
        bench.figures.count(CHANCE)
        return
    if error > ALLOWED * rtol and turns_within(bench, k, true, rtol):
        bench.figures.count("rates that change their sign again and again within what is allowed")
        return
    if error > ALLOWED * rtol and missed_by_a_peer(bench, k, true, rtol, method):
        bench.figures.count("rates that turn faster than steps of the tolerance see, by SciPy's pair too")
        return
    if error > ALLOWED * rtol and state_error(bench, x, bench.close_course(k).x) <= ALLOWED * rtol * growth:
        bench.figures.count("pairs of crossings that SciPy missed in steps of dt / 25")
        return
    bench.figures.ratio("states against SciPy", error / rtol)
    if error > ALLOWED * rtol:
        bench.report("wrong ok: states", error / (ALLOWED * rtol), k, call, f"x = {true.x.tolist()} by SciPy")


def by_chance(bench: Bench, k: int, true: Course, rtol: float, growth: float, method: str | None) -> bool:
    """Whether a smooth trajectory is right at other tolerances next to this, or from other starts next to its own: so it is where
    the estimate of one step's error happens to vanish, of which the documentation says that no rule sees it, and how rare it is
    (`CHANCES`). A first step may be the same at many tolerances. A pair of kinks may be missed in a long step whose interpolant
    does not show it, as the documentation says: so it is where a loose tolerance alone is wrong."""
    point, theta = bench.points[k], bench.theta[k : k + 1]

    def right(of: fp.Experiments, end: Floats, at: float) -> bool:
        one = bench.simulate(of, theta, at, method)
        return bool(one.status[0] == OK and state_error(bench, one.x[0], end) <= ALLOWED * at * growth)

    if true.stiff:
        return False
    if true.crossed:
        return rtol >= LOOSE and all(right(point, true.x, share * rtol) for share in (0.2, 0.05, 0.01))
    if all(right(point, true.x, share * rtol) for share in (0.5, 0.8, 1.25, 2.0)):
        return True
    for share in (-0.02, -0.01, 0.01, 0.02):
        x0 = point.x0[0] + share * bench.case.sizes
        beside = course(bench.reading, x0, point.u[0], bench.theta[k], float(point.dt[0]), bench.case.sizes)
        if beside.end is not End.ok or not right(fp.Experiments(x0[None], point.u, point.dt), beside.x, rtol):
            return False
    return True


def missed_by_a_peer(bench: Bench, k: int, true: Course, rtol: float, method: str | None) -> bool:
    """Whether SciPy's pair of the same order is off as much on a smooth trajectory, at the same tolerance and at one next to it: f
    then turns faster than steps of that size see, as sin(1 / (x - 2)) next to 2 does."""
    if true.crossed or true.stiff:
        return False
    x0, u, p = bench.points.x0[k], tuple(bench.points.u[k].tolist()), tuple(bench.theta[k].tolist())
    size, dt = bench.case.sizes, float(bench.points.dt[k])
    sides = [side_of(height) for height in bench.reading.heights(x0.tolist(), u, p)]

    def rates(_: float, z: Floats) -> Floats:
        f = bench.reading.held((z * size).tolist(), u, p, sides)
        return np.full(len(z), np.nan) if f is None else np.array(f) * dt / size

    for share in (1.0, 0.9, 1.1):
        done = solve_ivp(
            rates, (0.0, 1.0), x0 / size, "RK45" if method == "RK45" else "DOP853", rtol=share * rtol, atol=share * rtol
        )
        if done.status == 0 and state_error(bench, done.y[:, -1] * size, true.x) > ALLOWED * rtol:
            return True
    return False


def turns_within(bench: Bench, k: int, true: Course, rtol: float) -> bool:
    """Whether a rate changes its sign many times within what is allowed of its state, as sin(tan(x)) next to a pole of tan.

    Where it is stiff, next to the state: from one rest to the next it is no more than what a step is off that sees few of them, and
    SciPy's methods go astray as often.
    """
    u, p = bench.points.u[k].tolist(), bench.theta[k].tolist()
    for x in (bench.points.x0[k], true.x):
        sides = [side_of(height) for height in bench.reading.heights(x.tolist(), u, p)]
        for i, size in enumerate(bench.case.sizes):
            around = np.tile(x, (LOOKED_AROUND, 1))
            around[:, i] += max(ALLOWED * rtol, NEXT_TO if true.stiff else 0.0) * size * np.linspace(-1, 1, LOOKED_AROUND)
            rates = [bench.reading.held(near, u, p, sides) for near in around.tolist()]
            signs = np.sign([rate[i] for rate in rates if rate is not None])
            if np.count_nonzero(np.diff(signs)) >= TURNS:
                return True
    return False


def judge_ok(bench: Bench, k: int, true: Course, rtol: float, call: str) -> None:
    """A trajectory that is said to be ok and, says SciPy, is none."""
    dt = float(bench.points.dt[k])
    remark = f"{true.end.value}: {true.end.name} at t = {true.at:.6g} of {dt:g}, x = {true.x.tolist()}"
    if true.surface is not None:
        remark += f", where {surface_name(bench.reading, true)} = 0"
    if true.end is End.jump and not all(bench.moving_jumps):
        bench.figures.count("jumps that may be at times that depend on no parameter")
        return
    clear = true.depth > CLOSE * rtol and (true.end is End.jump or true.at < 0.99 * dt)
    if true.end is End.domain and true.at == 0:
        clear = True
    if clear and not (true.at > 0 and stays_beside(bench, k, rtol)):
        bench.report(f"wrong ok: {true.end.name}", true.depth / (CLOSE * rtol), k, call, remark)
    else:
        bench.figures.count("too close to tell")


def stays_beside(bench: Bench, k: int, rtol: float) -> bool:
    """Whether a trajectory is ok whose start is moved by what its states may be off: so one that touches a surface is told from one
    that goes through."""
    x0, size, theta = bench.points.x0[k], bench.case.sizes, bench.theta[k]
    moves = [sign * ALLOWED * rtol * row for row in np.diag(size) for sign in (1.0, -1.0)]
    u, dt = bench.points.u[k], float(bench.points.dt[k])
    return any(course(bench.reading, x0 + move, u, theta, dt, size).end is End.ok for move in moves)


def surface_name(reading: Reading, true: Course) -> str:
    assert true.surface is not None
    return reading.surfaces[true.surface] if true.end is End.jump else reading.limits[true.surface].text


def judge_exclusion(bench: Bench, k: int, true: Course, name: str, rtol: float, call: str) -> None:
    """A trajectory that is excluded and, says SciPy, is one."""
    kind = "limit" if name == "left_domain" else "surface"
    nearest = min((value for (of, _), value in true.clearance.items() if of == kind), default=math.inf)
    if name == "met_jump" and passes(bench, k, bench.model.jumps, true):
        bench.figures.count("exclusions at a surface where f does not jump just there")
        return
    if name in ("step_limit", "not_finite"):
        hard = true.stiff or float(np.max(true.largest / bench.case.sizes)) * 1e-13 > rtol
    else:
        hard = (name == "left_domain" and true.output_lost) or nearest < CLOSE * rtol
    if hard:
        bench.figures.count(f"exclusions with a reason: {name}")
        return
    bench.figures.count(f"exclusions without a reason: {name}")
    bench.excluded_wrongly(
        name, k, call, f"ok, x = {true.x.tolist()} by SciPy in {true.steps} steps, nearest surface {nearest:.3g}"
    )


def passes(bench: Bench, k: int, names: tuple[str, ...], true: Course) -> bool:
    """Whether the trajectory passes one of the model's surfaces, by their names."""
    case = bench.case
    values = Reading((), names, case.states, case.inputs, case.parameters, dict(case.constants))
    u, p = bench.points.u[k].tolist(), bench.theta[k].tolist()
    signs = {tuple(map(side_of, values.output(x, u, p) or ())) for x in true.way}
    return len(signs) > 1
