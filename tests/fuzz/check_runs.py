"""Runs of random models: nice durations, inputs that stay or change, ends of segments on surfaces to the last digit.

A run is compared with itself at the tightest tolerance, with the same trajectory by other kernels (one point where the input stays,
a chain of points where it changes), with SciPy's from segment to segment, and its derivatives with differences of tight runs. The
first two cross jumps, SciPy's route does not. A status other than ok is counted: on a surface there may be no derivative.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

import fisherpoint as fp
from checks import ALLOWED, OK, ROUNDING, TIGHT, Bench
from reading import Floats, side_of
from room import undecided
from scipy_route import End, course

RTOL = 1e-6
COUNT, MOST_SEGMENTS = 6, 5
LOOKS, HALVINGS = 33, 12  # at a segment, for an event in it
STEPS = (2e-3, 1e-3, 5e-4)  # of a parameter, for differences
SHARES = (0.3, 0.8, 1.25, 3.0)  # of the tolerance: a chance is gone at others
CHANCE = "runs off by a chance of the error's estimate"


@dataclass
class Run:
    """One run of a bench, with its parameters."""

    bench: Bench
    runs: fp.Runs
    theta: Floats

    @property
    def sizes(self) -> Floats:
        return self.bench.case.sizes

    def simulate(self, rtol: float, jumps: str = "cross", theta: Floats | None = None) -> fp.RunTrajectories | None:
        """None where it is refused."""
        try:
            values = self.theta if theta is None else theta
            return fp.simulate(self.bench.model, self.runs, values, rtol=rtol, threads=1, jumps=jumps)
        except ValueError:
            return None

    def sensitivities(self, rtol: float) -> fp.RunSensitivities:
        return fp.sensitivities(self.bench.model, self.runs, self.theta, rtol=rtol, threads=1)

    def error(self, given: Floats, expected: Floats) -> float:
        """The largest in units of the states' sizes, less what rounding may do."""
        error = np.abs(given - expected) - ROUNDING * np.maximum(np.abs(given), np.abs(expected))
        return float(np.max(error / self.sizes, initial=0.0))

    def call(self, what: str, rtol: float, jumps: str = "cross") -> str:
        of = self.runs
        rows = f"{of.x0.tolist()}, {of.u.tolist()}, {of.dt.tolist()}, {of.measured.tolist()}"
        return f"fp.{what}(model, fp.Runs({rows}), theta, rtol={rtol:g}, jumps={jumps!r})"

    def report(self, kind: str, ratio: float, call: str, remark: str) -> None:
        if all(finding.kind != kind for finding in self.bench.findings):
            self.bench.report(kind, ratio, 0, call, remark)
            finding = self.bench.findings[-1]
            code = f"{self.bench.case.code()}\ntheta = {self.theta.tolist()}\nprint({call})\n# {remark}"
            self.bench.findings[-1] = type(finding)(finding.kind, finding.ratio, code)


def check_runs(bench: Bench) -> None:
    """Some runs from the starts of the case's points."""
    if not bench.case.rates or not len(bench.points):
        return
    rng = np.random.default_rng(bench.case.seed)
    for k in range(min(COUNT, len(bench.points))):
        one = drawn(bench, rng, k)
        if one is None:
            bench.figures.count("runs refused")
            continue
        compare(one, by_scipy=k < 2)


# --- what is drawn -------------------------------------------------------------------------------------------------------


def drawn(bench: Bench, rng: np.random.Generator, k: int) -> Run | None:
    """A run from the start of point k; the ends of some of its segments are on surfaces."""
    case, count = bench.case, int(rng.integers(2, MOST_SEGMENTS + 1))
    unit = case.time * 10.0 ** np.floor(np.log10(case.duration[1] / count))
    dt = unit * rng.choice([0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 3.0], count)
    x0 = bench.points.x0[k : k + 1]
    u = np.tile(bench.points.u[k], (1, count, 1))
    if rng.integers(3):
        levels = rng.choice([0.1, 0.5, 1.0, 1.2, 2.0], (1, count, len(case.inputs))) * case.input_sizes
        u = np.where(rng.random((1, count, 1)) < 0.6, levels, u)
    if rng.integers(2):
        x0 = np.maximum(np.round(x0 / case.sizes, 1), 0.1) * case.sizes
    theta = bench.theta[k] if rng.integers(2) else case.mean
    measured = np.ones((1, count), bool)
    one = Run(bench, fp.Runs(x0, u, dt[None], measured), theta)
    for n in range(count):
        if rng.integers(2):
            at = event(one, n)
            if at is not None:
                dt[n] = at
                for _ in range(int(rng.integers(3))):
                    dt[n] = np.nextafter(dt[n], rng.choice([0.0, np.inf]))
                bench.figures.count("runs: ends of segments on surfaces")
                # There may be no derivative of what is measured at the surface itself.
                measured[0, n] = n == count - 1 or not rng.integers(3)
                one = Run(bench, fp.Runs(x0, u, dt[None], measured), theta)
    return one if one.simulate(RTOL) is not None else None


def event(one: Run, n: int) -> float | None:
    """How long segment n takes to the first of the model's surfaces that it meets, to the last digit; None without one."""
    reading, done = one.bench.reading, one.simulate(RTOL)
    if not reading.surfaces or done is None or done.reached[0] < n:
        return None
    start, u, p = done.x[0, n : n + 1], one.runs.u[0, n], one.theta.tolist()
    low, high = 0.0, float(one.runs.dt[0, n]) * 1.5
    for _ in range(HALVINGS):
        times = np.unique(np.linspace(low, high, LOOKS)[1:])
        points = fp.Experiments(start.repeat(len(times), 0), u[None].repeat(len(times), 0), times)
        try:
            ends = fp.simulate(one.bench.model, points, one.theta, rtol=RTOL, threads=1)
        except ValueError:
            return None
        good = ends.status == OK
        signs = [tuple(map(side_of, reading.heights(x, u.tolist(), p))) for x in ends.x[good].tolist()]
        changes = [j for j in range(1, len(signs)) if signs[j] != signs[j - 1]]
        if not changes:
            return None if low == 0.0 else high
        low, high = times[good][changes[0] - 1], times[good][changes[0]]
        if high <= np.nextafter(low, math.inf):
            break
    return float(high)


# --- what it is compared with -----------------------------------------------------------------------------------------------


def compare(one: Run, by_scipy: bool) -> None:
    figures = one.bench.figures
    given, tight = one.simulate(RTOL), one.simulate(TIGHT)
    if given is None or tight is None:
        figures.count("runs refused")
        return
    figures.count("runs")
    status = fp.Status(int(given.status[0]))
    figures.count(f"runs {status.name}")
    for name, array in (("x", given.x), ("y", given.y)):
        if status == OK and not np.isfinite(array).all():
            one.report("run not finite", math.inf, one.call("simulate", RTOL), f"{name} is inf or NaN")
    if status == OK == tight.status[0]:
        judge(one, "rtol 1e-12", given.x[0], tight.x[0])
        other = by_points(one)
        if other is not None:
            judge(one, "points", given.x[0], other, tight.x[0])
        check_derivatives(one, tight)
    if by_scipy:
        judge_by_scipy(one)


def judge(one: Run, route: str, given: Floats, expected: Floats, tight: Floats | None = None, jumps: str = "cross") -> None:
    """States (N + 1, n_x) against those of another route; `tight` is the same route at the tightest tolerance."""
    figures, error = one.bench.figures, one.error(given, expected)
    growth = 1.0
    if error > ALLOWED * RTOL:
        growth = growth_of(one, expected, jumps) * len(given)
        error /= growth
    if error > ALLOWED * RTOL and undecided_on(one, expected):
        figures.count("runs: conditions that rounding decides about")
        return
    whole = tight is None or one.error(tight, expected) <= 1e-9 * growth
    if error > ALLOWED * RTOL and whole and by_chance(one, expected, growth, jumps):
        figures.count(CHANCE)
        return
    figures.count(f"runs compared with {route}")
    figures.ratio(f"runs against {route}", error / RTOL)
    if error > ALLOWED * RTOL:
        remark = f"x = {expected.tolist()} by {route}"
        one.report(f"wrong ok: run against {route}", error / (ALLOWED * RTOL), one.call("simulate", RTOL, jumps), remark)


def by_chance(one: Run, expected: Floats, growth: float, jumps: str) -> bool:
    """Whether the error is gone at tolerances next to this one."""
    for share in SHARES:
        done = one.simulate(share * RTOL, jumps)
        if done is None or done.status[0] != OK or one.error(done.x[0], expected) > ALLOWED * share * RTOL * growth:
            return False
    return True


def undecided_on(one: Run, x: Floats) -> bool:
    """Whether rounding decides about a condition at the start or within a segment: one whose sides are the same.

    Ends of segments are not looked at: on a surface that is crossed there, rounding decides about the side, and about nothing else.
    """
    u, dt, unit = one.runs.u[0], one.runs.dt[0], one.sizes / one.bench.case.time
    seen = [(x[0], u[0])]
    for n in range(len(dt)):
        points = fp.Experiments(x[[n, n, n]], u[[n, n, n]], dt[n] * np.array([0.1, 0.4, 0.8]))
        try:
            seen += [(state, u[n]) for state in fp.simulate(one.bench.model, points, one.theta, threads=1).x]
        except ValueError:
            continue
    return any(undecided(one.bench.reading, state.tolist(), put.tolist(), one.theta.tolist(), unit) for state, put in seen)


def growth_of(one: Run, x: Floats, jumps: str) -> float:
    """What a deviation at the start of any segment has grown to at any later end; infinite where another surface is met then."""
    largest, u, dt = 1.0, one.runs.u, one.runs.dt
    moves = np.concatenate([np.zeros((1, len(one.sizes))), np.diag(one.sizes), -np.diag(one.sizes)])
    for n in range(len(x) - 1):
        rest = fp.Runs(x[n] + RTOL * moves, u[:, n:].repeat(len(moves), 0), dt[:, n:].repeat(len(moves), 0))
        done = Run(one.bench, rest, one.theta).simulate(TIGHT, jumps)
        if done is None or done.status.any():
            return math.inf
        largest = max(largest, one.error(done.x[1:], done.x[:1]) / RTOL)
    return largest


def by_points(one: Run) -> Floats | None:
    """States (N + 1, n_x) of the same trajectory as points: from the start where the input stays, else each from the last's end."""
    runs, figures = one.runs, one.bench.figures
    x, u, dt = runs.x0[0], runs.u[0], runs.dt[0]
    held = bool((u == u[0]).all())
    states = [x]
    for n in range(len(dt)):
        start, time = (runs.x0[0], float(dt[: n + 1].sum())) if held else (states[-1], float(dt[n]))
        try:
            done = fp.simulate(one.bench.model, fp.Experiments([start], [u[n]], [time]), one.theta, rtol=TIGHT, threads=1)
        except ValueError:
            figures.count("runs: points refused")
            return None
        if done.status[0] != OK:
            figures.count(f"runs ok, as points {fp.Status(int(done.status[0])).name}")
            return None
        states.append(done.x[0])
    return np.array(states)


def judge_by_scipy(one: Run) -> None:
    """Jumps are excluded here, as the route ends there."""
    bench, runs, done = one.bench, one.runs, one.simulate(RTOL, "exclude")
    if done is None:
        return
    states, status = [runs.x0[0]], fp.Status(int(done.status[0]))
    for n, dt in enumerate(runs.dt[0].tolist()):
        piece = course(bench.reading, states[-1], runs.u[0, n], one.theta, dt, one.sizes)
        if piece.end is not End.ok or piece.stiff:
            bench.figures.count(f"runs by SciPy: {'stiff' if piece.end is End.ok else piece.end.name}")
            clear = piece.end is End.domain and piece.depth > 1e4 * RTOL and 0 < piece.at < 0.99 * dt
            if status == OK and clear and growth_of(one, done.x[0], "exclude") < 1e3:
                remark = f"{piece.end.value} in segment {n} at {piece.at:.6g}"
                one.report(f"wrong ok: run, {piece.end.name}", 1.0, one.call("simulate", RTOL, "exclude"), remark)
            return
        states.append(piece.x)
    if status != OK:
        bench.figures.count(f"runs excluded though ok by SciPy: {status.name}")
        return
    judge(one, "SciPy", done.x[0], np.array(states), jumps="exclude")


# --- derivatives ------------------------------------------------------------------------------------------------------------


def check_derivatives(one: Run, tight: fp.RunTrajectories) -> None:
    """dx/dtheta at the ends that are measured against differences of tight runs, and against a point's where the input stays."""
    figures = one.bench.figures
    done = one.sensitivities(RTOL)
    status = fp.Status(int(done.status[0]))
    figures.count(f"run derivatives {status.name}")
    if status != OK:
        return
    rows = np.flatnonzero(one.runs.measured[0])
    given = done.dx_dtheta[0, rows]  # (N, n_x, p)
    if not np.isfinite(given).all():
        one.report("run not finite", math.inf, one.call("sensitivities", RTOL), "inf or NaN in dx_dtheta")
        return
    by_one_point(one, given[-1])
    for j in range(len(one.theta)):
        found = differences(one, tight.x[0, 1:][rows], rows, j)
        if found is None:
            figures.count("run columns without differences")
            continue
        judge_column(one, given[:, :, j], tight.x[0], found, j)


@dataclass
class Differences:
    """Derivatives (N, n_x) by one parameter from both sides, from below and from above, with what they may be off."""

    central: Floats
    below: Floats
    above: Floats
    trust: Floats

    @property
    def bent(self) -> Any:
        """Where the sides disagree: there is none, or one for each side."""
        return np.abs(self.above - self.below) > 4 * self.trust


def differences(one: Run, middle: Floats, rows: Any, j: int) -> Differences | None:
    """None where a run beside it does not get to its end."""
    central, above, below = [], [], []
    for share in STEPS:
        step = share * (abs(one.theta[j]) or 1.0)
        ends = []
        for sign in (1.0, -1.0):
            done = one.simulate(TIGHT, theta=one.theta + sign * step * (np.arange(len(one.theta)) == j))
            if done is None or done.status[0] != OK:
                return None
            ends.append(done.x[0, 1:][rows])
        central.append((ends[0] - ends[1]) / (2 * step))
        above.append((ends[0] - middle) / step)
        below.append((middle - ends[1]) / step)
    once = [(4 * b - a) / 3 for a, b in itertools.pairwise(central)]
    sides = [(4 * (2 * of[2] - of[1]) - (2 * of[1] - of[0])) / 3 for of in (above, below)]  # up to the third order in the step
    noise = (10 * TIGHT * one.sizes + 1e-14 * np.abs(middle)) / step
    best = (16 * once[1] - once[0]) / 15
    first, second = (np.abs(b - a) for a, b in itertools.pairwise(central))
    slow = np.where(second > 0.3 * first, second, 0.05 * second)  # an event at an end leaves an error in proportion to the step
    trust = np.abs(best - once[1]) + slow + 8 * noise
    return Differences(best, sides[1], sides[0], trust)


def judge_column(one: Run, given: Floats, x: Floats, found: Differences, j: int) -> None:
    figures, sizes = one.bench.figures, one.sizes
    column = float(np.max(np.abs(given) / sizes, initial=0.0))
    if not column and np.all(np.abs(found.central) <= 5 * found.trust):
        figures.count("run columns of zeros")
        return
    if not np.max(found.trust / sizes) < 1e-3 * column and np.max(np.abs(found.central) / sizes) <= column:
        figures.count("run columns without differences")
        return
    allowed = max(1e-3 * column, 1e-9 * float(np.max(1 / max(abs(one.theta[j]), 1e-300))))
    off = np.abs(given - found.central) - 5 * found.trust
    figures.count("run columns compared")
    error = float(np.max(off / sizes))
    if error <= allowed:
        figures.ratio("run columns, in thousandths", 1e3 * error / column if column else 0.0)
        return
    if found.bent.any():
        beside = min(float(np.max((np.abs(given - side) - 5 * found.trust) / sizes)) for side in (found.below, found.above))
        figures.count("run columns with two sides")
        if beside <= 10 * allowed:
            return
        off = np.where(found.bent, -math.inf, off)
        error = float(np.max(off / sizes))
    if error > allowed:
        allowed = max(allowed, 1e-3 * largest_columns(one)[j])
        error /= max(1.0, ALLOWED * RTOL * 1e3 * growth_of(one, x, "cross"))
    if error > allowed and undecided_on(one, x):
        figures.count("runs: conditions that rounding decides about")
        return
    if error > allowed:
        remark = f"dx/d{one.bench.case.parameters[j]} = {found.central.tolist()} by differences, given {given.tolist()}"
        one.report("wrong ok: run derivatives", error / allowed, one.call("sensitivities", RTOL), remark)


def by_one_point(one: Run, given: Floats) -> None:
    """dx/dtheta (n_x, p) at the end, against that of the point that is the same trajectory."""
    runs, figures = one.runs, one.bench.figures
    if not (runs.u[0] == runs.u[0, 0]).all():
        return
    point = fp.Experiments(runs.x0, runs.u[:, 0], [float(runs.dt.sum())])
    for rtol in (RTOL, 1e-9):  # at RTOL too: a run is ok where it ends next to a jump that no output feels, a point is not
        try:
            done = fp.sensitivities(one.bench.model, point, one.theta, rtol=rtol, threads=1)
        except ValueError:
            return
        if done.status[0] != OK:
            figures.count(f"run derivatives ok, as a point {fp.Status(int(done.status[0])).name}")
            return
    figures.count("run derivatives compared with a point")
    expected, x = done.dx_dtheta[0], one.simulate(TIGHT).x[0]  # type: ignore[union-attr]
    error = np.max(np.abs(given - expected) / one.sizes[:, None], axis=0)
    error = np.maximum(error - 1e-12 / np.maximum(np.abs(one.theta), 1e-300), 0.0)  # a column that is nothing but rounding

    def ratio(columns: Floats) -> float:
        return float(np.max(np.divide(error, columns, out=np.zeros_like(error), where=columns > 0)))

    worst = ratio(np.max(np.abs(np.stack([expected, given])) / one.sizes[:, None], axis=(0, 1)))
    if worst > ALLOWED * RTOL:
        worst = ratio(largest_columns(one)) / (growth_of(one, x, "cross") * len(runs.dt[0]))
    if worst > ALLOWED * RTOL and undecided_on(one, x):
        figures.count("runs: conditions that rounding decides about")
        return
    figures.ratio("run derivatives against a point", worst / RTOL)
    if worst > ALLOWED * RTOL:
        remark = f"dx/dtheta = {expected.tolist()} as one point, given {given.tolist()}"
        one.report("wrong ok: run derivatives, as a point", worst / (ALLOWED * RTOL), one.call("sensitivities", RTOL), remark)


def largest_columns(one: Run) -> Floats:
    """The largest sizes (p,) of dx/dtheta on the way, in units of the states': what an error is measured by."""
    runs = one.runs
    shares = np.array([0.001, 0.009, 0.04, 0.1, 0.15, 0.2, 0.2, 0.3])
    u, dt = runs.u.repeat(len(shares), 1), (runs.dt[:, :, None] * shares).reshape(1, -1)
    way = Run(one.bench, fp.Runs(runs.x0, u, dt), one.theta)
    seen = [one.sensitivities(RTOL).dx_dtheta[0], way.sensitivities(1e-9).dx_dtheta[0]]
    return np.max(np.abs(np.concatenate(seen)) / one.sizes[:, None], axis=(0, 1))
