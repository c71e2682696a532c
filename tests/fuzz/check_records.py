"""Records against SciPy at the samples, and their derivatives against differences."""

from __future__ import annotations

import itertools
import math

import numpy as np

import fisherpoint as fp
from checks import ALLOWED, OK, ROUNDING, TIGHT, Bench
from fisherpoint.estimation.response import RecordResponse
from reading import Floats
from room import slope_room
from scipy_route import End, course

SAMPLES = 10
RTOL = 1e-6


def check_record(bench: Bench, by_scipy: bool) -> None:
    """One record over several durations, with an input that changes at every sample."""
    case = bench.case
    if not len(bench.points):
        return
    rng = np.random.default_rng(case.seed)
    t = np.concatenate([[0.0], np.cumsum(rng.uniform(0.2, 1.0, SAMPLES - 1))]) * case.time * case.duration[1] / 3
    u = rng.uniform(case.low, 2.0, (SAMPLES, len(case.inputs))) * case.input_sizes
    x0, theta = bench.points.x0[0], bench.theta[0]
    try:
        done = fp.simulate_record(bench.model, t, u, theta, x0, rtol=RTOL)
        tight = fp.simulate_record(bench.model, t, u, theta, x0, rtol=TIGHT)
    except ValueError:
        bench.figures.count("records refused")
        return
    bench.figures.count("calls", 2)
    bench.figures.count("records")
    bench.figures.count(f"records {done.status.name}")
    call = f"fp.simulate_record(model, {t.tolist()}, {u.tolist()}, theta, {x0.tolist()}, rtol={RTOL:g})"
    if not (np.isfinite(done.x).all() and np.isfinite(done.y).all()):
        bench.report("record not finite", math.inf, 0, call, "inf or NaN")
    if done.status == OK == tight.status and case.rates:
        error = _error(bench, done.x, tight.x)
        if error > ALLOWED * RTOL:
            error /= _growth(bench, theta, t, u, x0, tight.x) * SAMPLES
        bench.figures.ratio(f"records against rtol {TIGHT:g}", error / RTOL)
        if error > ALLOWED * RTOL:
            bench.report("wrong ok: record", error / (ALLOWED * RTOL), 0, call, f"x = {tight.x.tolist()} at rtol {TIGHT:g}")
        check_derivatives(bench, done, tight, theta, t, u, call)
    if by_scipy and case.rates:
        record_by_scipy(bench, done, theta, t, u, x0, call)


def _error(bench: Bench, given: Floats, expected: Floats) -> float:
    error = np.abs(given - expected) - ROUNDING * np.maximum(np.abs(given), np.abs(expected))
    return float(np.max(error / bench.case.sizes, initial=0.0))


def _growth(bench: Bench, theta: Floats, t: Floats, u: Floats, x0: Floats, x: Floats) -> float:
    """What a deviation at any sample has grown to at any later one."""
    largest = 1.0
    for n in range(0, SAMPLES - 1):
        for i, size in enumerate(bench.case.sizes):
            for sign in (1.0, -1.0):
                start = x[n] + sign * RTOL * size * (np.arange(len(x0)) == i)
                moved = fp.simulate_record(bench.model, t[n:] - t[n], u[n:], theta, start, rtol=TIGHT)
                if moved.status != OK:
                    return math.inf
                largest = max(largest, _error(bench, moved.x, x[n:]) / RTOL)
    return largest


def record_by_scipy(
    bench: Bench, done: fp.results.RecordTrajectory, theta: Floats, t: Floats, u: Floats, x0: Floats, call: str
) -> None:
    x, sizes = x0, bench.case.sizes
    samples = [x0]
    for n in range(SAMPLES - 1):
        piece = course(bench.reading, x, u[n], theta, t[n + 1] - t[n], sizes)
        if piece.end is not End.ok:
            bench.figures.count(f"records by SciPy: {piece.end.name}")
            clear = piece.end is End.domain and piece.depth > 1e4 * RTOL and piece.at < 0.99 * (t[n + 1] - t[n])
            if done.status == OK and clear and len(samples) < 5:
                bench.report(f"wrong ok: record, {piece.end.name}", 1.0, 0, call, f"{piece.end.value} after sample {n}")
            return
        x = piece.x
        samples.append(x)
    bench.figures.count("records by SciPy: ok")
    if done.status != OK:
        bench.figures.count(f"records excluded though ok by SciPy: {done.status.name}")
        return
    error = _error(bench, done.x, np.array(samples))
    if error > ALLOWED * RTOL:
        error /= _growth(bench, theta, t, u, x0, done.x) * SAMPLES
    bench.figures.ratio("records against SciPy", error / RTOL)
    if error > ALLOWED * RTOL:
        bench.report("wrong ok: record", error / (ALLOWED * RTOL), 0, call, f"x = {[s.tolist() for s in samples]} by SciPy")


def check_derivatives(
    bench: Bench,
    done: fp.results.RecordTrajectory,
    tight: fp.results.RecordTrajectory,
    theta: Floats,
    t: Floats,
    u: Floats,
    call: str,
) -> None:
    """dy/d(theta, start) along the record against differences of tight records."""
    x0 = done.x[0]
    p, n_x, n_y = len(theta), len(x0), len(bench.case.outputs)
    record = fp.Record(t, u, np.zeros((SAMPLES, len(bench.case.outputs))))
    given = RecordResponse(bench.model, record, range(p), RTOL, threads=1)(theta[None], x0[None])
    branches = [
        [bench.reading.output_branches(x, u[n].tolist(), theta.tolist()) for n, x in enumerate(of.x.tolist())]
        for of in (done, tight)
    ]
    if branches[0] != branches[1] or any(0 in taken for taken in branches[0]):
        bench.figures.count("record derivatives too close to a branch of the output")
        return
    if given.status[0] != OK:
        bench.figures.count(f"record derivatives {fp.Status(given.status[0]).name}")
        return
    steps = np.concatenate([1e-4 * np.abs(theta), 1e-4 * bench.case.sizes])
    for j in range(p + n_x):
        found = []
        for share in (1.0, 0.5, 0.25):
            ends = []
            for sign in (1.0, -1.0):
                moved = np.concatenate([theta, x0])
                moved[j] += sign * share * steps[j]
                try:
                    one = fp.simulate_record(bench.model, t, u, moved[:p], moved[p:], rtol=TIGHT)
                except ValueError:
                    return
                if one.status != OK:
                    return
                ends.append(np.concatenate([one.y, one.x], axis=1))
            found.append((ends[0] - ends[1]) / (2 * share * steps[j]))
        once = [(4 * b - a) / 3 for a, b in itertools.pairwise(found)]
        twice = (16 * once[1] - once[0]) / 15
        # Where a kink lies between the trajectories, differences of two steps disagree.
        trust = np.abs(twice - once[1]) + 0.02 * np.abs(found[2] - found[1]) + 1e-9 * (1 + np.abs(ends[0])) / steps[j]
        twice, columns, trust = twice[:, :n_y], twice[:, n_y:], trust[:, :n_y]
        column = float(np.max(np.abs(twice)))
        if not np.max(trust) < 1e-3 * column:
            bench.figures.count("record columns without differences")
            continue
        error = np.abs(given.dy[0, :, :, j] - twice) - 5 * trust
        bench.figures.count("record columns compared")
        if np.max(error) > 1e-3 * column:
            error -= _room(bench, tight.x, u, theta, columns, j, _growth(bench, theta, t, u, x0, tight.x))
        if np.max(error) > 1e-3 * column:
            remark = f"dy/d({j}) expected {twice.tolist()} by differences, given {given.dy[0, :, :, j].tolist()}"
            bench.report("record derivatives", float(np.max(error)) / (1e-3 * column), 0, call, remark)


def _room(bench: Bench, x: Floats, u: Floats, theta: Floats, columns: Floats, j: int, growth: float) -> Floats:
    """How far derivatives of the outputs (n, n_y) by number j may be off, of states (n, n_x) and their derivatives `columns`."""
    sizes = bench.case.sizes
    if not math.isfinite(growth):
        return np.full((len(x), len(bench.case.outputs)), math.inf)
    off = ALLOWED * RTOL * growth * sizes
    column = float(np.max(np.abs(columns) / sizes))
    rooms = []
    for state, put, by_number in zip(x, u.tolist(), columns[:, :, None], strict=True):
        rooms.append(slope_room(bench.reading, state, put, theta.tolist(), off, by_number, off[:, None] * column, [j])[:, 0])
    return np.array(rooms)
