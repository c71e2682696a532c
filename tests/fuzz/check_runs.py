"""Runs of random models: nice durations, inputs that stay or change, ends of segments on surfaces to the last digit.

A run is compared with itself at the tightest tolerance, with the same trajectory by other kernels (one point where the input stays,
a chain of points where it changes), with SciPy's from segment to segment, and its derivatives with differences of tight runs. The
first two cross jumps, SciPy's route does not. A status other than ok is counted: on a surface there may be no derivative.
"""

from __future__ import annotations

import math

import numpy as np

import fisherpoint as fp
from check_run_derivatives import check_derivatives
from checks import ALLOWED, OK, TIGHT, Bench
from random_runs import RTOL, Run, drawn, growth_of, undecided_on
from reading import Floats
from scipy_route import End, course

COUNT = 6
SHARES = (0.3, 0.8, 1.25, 3.0)  # of the tolerance: a chance is gone at others
CHANCE = "runs off by a chance of the error's estimate"


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
