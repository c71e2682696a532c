"""dx/dtheta along runs against differences of tight runs, and against a point's where the input stays."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

import fisherpoint as fp
from checks import ALLOWED, OK, TIGHT
from random_runs import RTOL, Run, growth_of, undecided_on
from reading import Floats

STEPS = (2e-3, 1e-3, 5e-4)  # of a parameter, for differences


def check_derivatives(one: Run, tight: fp.Trajectories) -> None:
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
