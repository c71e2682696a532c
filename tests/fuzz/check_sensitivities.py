"""Sensitivities against differences of trajectories: the package's own at a tight tolerance, and SciPy's.

Every column is promised by its own size, so an error counts as wrong where it is above ALLOWED times rtol times the largest size
that the column has on the way, and times what a deviation there grows to (checks.py).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import fisherpoint as fp
from check_states import judge
from checks import ALLOWED, OK, TIGHT, Bench, compare, magnification
from reading import Floats, Reading
from room import FEW_ROUNDINGS, output_slopes, output_undecided, slope_room
from scipy_route import End
from scipy_slope import slope

STEPS = (4e-3, 2e-3, 1e-3)  # of a parameter, for differences


def check_sensitivities(bench: Bench, rtol: float, method: str) -> None:
    """Against differences of tight trajectories, and against SciPy's where these disagree and for one other."""
    points, theta = bench.points, bench.theta
    if not len(points):
        return
    bench.figures.count("calls")
    bench.figures.count("sensitivities", len(points))
    done = fp.sensitivities(bench.model, points, theta, rtol=rtol, threads=1, method=method, jumps="exclude")
    bench.finite("fp.sensitivities", done, rtol)
    call = f"fp.sensitivities(model, points, theta, rtol={rtol:g}, method={method!r}, jumps='exclude')"
    judged = 0
    ok = np.flatnonzero(done.status == OK)
    check_output_sensitivities(bench, done, ok, rtol, call)
    if not bench.case.rates:
        return
    slopes, slopes_error = differences(bench, ok)
    size = bench.case.sizes[:, None]
    for row, k in enumerate(ok.tolist()):
        given = done.dx_dtheta[k]
        for j in range(theta.shape[1]):
            error = np.abs(given[:, j] - slopes[row, :, j])
            trust = slopes_error[row, :, j]
            column = float(np.max(np.abs(given[:, j]) / size[:, 0]))
            if not np.isfinite(trust).all():
                bench.figures.count("columns without differences")
                continue
            bench.figures.count("columns compared with differences")
            excess = float(np.max((error - 3 * trust) / size[:, 0]))
            if excess <= ALLOWED * rtol * column:
                bench.figures.ratio(f"columns against differences, rtol {rtol:g}", multiple(excess, rtol * column))
            elif judged < 3:
                judged += 1
                judge_column(bench, done, k, j, rtol, call)
    for k in ok[:1].tolist():
        judge(bench, k, OK, done.x[k], rtol, call, method)
        judge_column(bench, done, k, 0, rtol, call)


def differences(bench: Bench, rows: Any) -> tuple[Floats, Floats]:
    """dx/dtheta (rows, n_x, p) of tight trajectories and an estimate of its error, infinite where there is none."""
    points, theta = bench.points, bench.theta
    n_x, p = len(bench.case.sizes), theta.shape[1]
    found, error = np.zeros((len(rows), n_x, p)), np.full((len(rows), n_x, p), math.inf)
    if not len(rows):
        return found, error
    at, moved, steps = [], [], []
    for k in rows.tolist():
        for j in range(p):
            for share in STEPS:
                step = share * (abs(theta[k, j]) or 1.0)
                for sign in (1.0, -1.0):
                    at.append(k)
                    moved.append(theta[k] + sign * step * (np.arange(p) == j))
                steps.append(step)
    try:
        ends = bench.simulate(points[at], np.array(moved), TIGHT)
    except ValueError:  # parameters that the model refuses
        return found, error
    x = ends.x.reshape(len(rows), p, len(STEPS), 2, n_x)
    ok = (ends.status == OK).reshape(len(rows), p, -1).all(axis=2)
    h = np.array(steps).reshape(len(rows), p, len(STEPS), 1)
    central = (x[:, :, :, 0] - x[:, :, :, 1]) / (2 * h)
    once = (4 * central[:, :, 1:] - central[:, :, :-1]) / 3
    twice = (16 * once[:, :, 1] - once[:, :, 0]) / 15
    size, largest = bench.case.sizes, np.abs(x).max(axis=(2, 3))
    noise = (10 * TIGHT * size + 1e-14 * largest) / h[:, :, -1]
    estimate = np.abs(twice - once[:, :, 1]) + noise
    found = twice.transpose(0, 2, 1)
    error = np.where(ok[:, :, None], estimate, math.inf).transpose(0, 2, 1)
    return found, error


def judge_column(bench: Bench, done: fp.Sensitivities, k: int, j: int, rtol: float, call: str) -> None:
    """Compare the derivative by one parameter with differences of SciPy's trajectories."""
    true = bench.course(k)
    if true.end is not End.ok or true.stiff:
        bench.figures.count("columns that SciPy cannot tell")
        return
    x0, u, dt = bench.points.x0[k], bench.points.u[k], float(bench.points.dt[k])
    beside = slope(bench.reading, true, x0, u, bench.theta[k].tolist(), dt, bench.case.sizes, j)
    if beside is None:
        bench.figures.count("columns that SciPy cannot tell")
        return
    bench.figures.count("columns compared with SciPy")
    size, given = bench.case.sizes, done.dx_dtheta[k][:, j]
    step = STEPS[-1] * (abs(bench.theta[k, j]) or 1.0)
    error = np.abs(given - beside.x) - 3 * beside.x_error - (1e-11 * size + 1e-13 * true.largest) / step
    column = max(float(np.max(np.abs(column) / size)) for column in (given, beside.x))
    excess = float(np.max(error / size))
    if excess > ALLOWED * rtol * column:
        column = largest_column(bench, k, j, column) * magnification(bench, k, rtol)
    ratio = multiple(excess, rtol * column)
    if ratio > ALLOWED and bench.undecided(k):
        bench.figures.count("conditions that rounding decides about")
        return
    bench.figures.ratio(f"columns against SciPy, rtol {rtol:g}", ratio)
    if ratio > ALLOWED:
        name = bench.case.parameters[j]
        remark = f"dx/d{name} = {beside.x.tolist()} by SciPy, given {given.tolist()}"
        bench.report("wrong ok: sensitivities", ratio / ALLOWED, k, call, remark)


def multiple(excess: float, unit: float) -> float:
    """An error in units of what it may be, which is nothing where a column has decayed until the product underflows."""
    return max(excess, 0.0) / unit if unit else float(excess > 0)


def largest_column(bench: Bench, k: int, j: int, known: float, theta: Floats | None = None) -> float:
    """The largest size of a column on the way, which is what its error is measured by."""
    theta = bench.theta[k : k + 1] if theta is None else np.atleast_2d(theta)
    shares = looks_on_the_way(bench, k, theta)
    way = fp.sensitivities(bench.model, _parts(bench, k, shares), theta[0], rtol=1e-9, threads=1, jumps="exclude")
    columns = np.abs(way.dx_dtheta[way.status == OK][:, :, j]) / bench.case.sizes
    return max(known, float(np.max(columns, initial=0.0)))


def looks_on_the_way(bench: Bench, k: int, theta: Floats) -> Floats:
    """Shares of the duration, most of them where states change fastest: columns may have a spike there."""
    shares = np.array([0.0, 1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0])
    for _ in range(12):
        way = fp.simulate(bench.model, _parts(bench, k, shares[1:]), theta[0], rtol=1e-9, threads=1, jumps="exclude")
        x, ok = np.vstack([bench.points[k].x0, way.x]), np.append(True, way.status == OK)
        change = np.where(ok[1:] & ok[:-1], np.abs(np.diff(x, axis=0) / bench.case.sizes).max(axis=1), 0.0)
        far = np.argsort(-change, kind="stable")[:20]
        shares = np.union1d(shares, (shares[far] + shares[far + 1]) / 2)
    return shares[1:]


def _parts(bench: Bench, k: int, shares: Floats) -> fp.Experiments:
    point, count = bench.points[k], len(shares)
    return fp.Experiments(np.repeat(point.x0, count, 0), np.repeat(point.u, count, 0), point.dt * shares)


def check_output_sensitivities(bench: Bench, done: fp.Sensitivities, ok: Any, rtol: float, call: str) -> None:
    """dy/dtheta = g_x dx/dtheta + g_theta, with the text's own derivatives of g.

    Rows give dy/dtheta and columns dx/dtheta where both are smooth: two integrations, each as exact as rtol says.
    """
    reading, n = bench.reading, len(bench.case.rates)
    for k in ok.tolist():
        x, u, p = done.x[k].tolist(), bench.points.u[k].tolist(), bench.theta[k].tolist()
        branches = reading.output_branches(x, u, p)
        beside = [reading.output_branches([v * share for v in x], u, [v * share for v in p]) for share in (0.998, 1.002)]
        beside += [reading.output_branches(x, [v * (1 + few) for v in u], p) for few in (-FEW_ROUNDINGS, FEW_ROUNDINGS)]
        if any(other != branches for other in beside):
            continue
        slopes = output_slopes(reading, x, u, p)
        y = np.array(reading.output(x, u, p) or [math.nan])
        if not (np.isfinite(slopes).all() and np.isfinite(y).all()):
            continue
        dx = done.dx_dtheta[k]
        expected = slopes[:, :n] @ dx + slopes[:, n:]
        room = np.abs(slopes[:, :n]) @ np.abs(dx) + np.abs(slopes[:, n:])
        noise = 1e-9 * (np.abs(y)[:, None] + 1) / np.array([abs(v) or 1.0 for v in p])
        allowed = np.maximum((1e-6 + ALLOWED * rtol) * room + noise, 1e-300)
        few = FEW_ROUNDINGS * np.abs(done.x[k]), dx, FEW_ROUNDINGS * np.abs(dx)

        def own(
            k: int = k, slopes: Floats = slopes[:, :n], few: tuple[Floats, ...] = few, u: list[float] = u, p: list[float] = p
        ) -> Floats:
            largest = np.array([largest_column(bench, k, j, 0.0) for j in range(len(p))]) * magnification(bench, k, rtol)
            way = ALLOWED * rtol * (np.abs(slopes) @ bench.case.sizes)[:, None] * largest if len(bench.case.rates) else 0.0
            return way + roundings(reading, done.x[k], u, p, *few)

        compare(bench, "output sensitivity", done.dy_dtheta[k], expected, allowed, k, call, own)


def roundings(reading: Reading, x: Floats, u: list[float], p: list[float], room: Floats, columns: Floats, more: Floats) -> Floats:
    """What roundings of states and columns do to the outputs' derivatives: anything where they decide about a branch."""
    total = slope_room(reading, x, u, p, room, columns, more)
    return total + math.inf if output_undecided(reading, x.tolist(), u, p) else total
