"""Runs of random models of which an input has a dead time: zero, whole and broken numbers of segments, longer than the run.

The states are those of the same model without dead time under segments that are divided by hand, and the derivatives, that by the
dead time among them, those of differences of tight runs. Where a switch comes just with an end, the latter has two sides, of which
that towards larger dead times is given.
"""

from __future__ import annotations

import copy
import itertools
import re
from dataclasses import replace

import numpy as np

import fisherpoint as fp
from check_run_derivatives import differences, judge_column
from check_runs import judge
from checks import OK, TIGHT, Bench
from random_runs import RTOL, Run, drawn
from reading import Floats

COUNT = 4
SHARES = (0.0, 1.0, 2.0, 0.3, 0.7, 1.3, 100.0)  # of a segment, by which an input is late


def check_delay(bench: Bench) -> None:
    """Some runs from the starts of the case's points, with their first input late."""
    if not bench.case.rates or not bench.case.inputs or not len(bench.points):
        return
    rng = np.random.default_rng(bench.case.seed)
    for k in range(min(COUNT, len(bench.points))):
        run = drawn(bench, rng, k)
        if run is not None:
            compare(*delayed(run, rng))


def delayed(run: Run, rng: np.random.Generator) -> tuple[Run, Run]:
    """The run with its first input late by a further parameter; and the same with its segments divided by hand."""
    case, runs = run.bench.case, run.runs
    plain = replace(case, parameter_sizes=(*case.parameter_sizes, case.time), relative_std=(0.0,), log=(False,))
    tau = plain.parameters[-1]
    late = [re.sub(r"\bu1\b", f"delay(u1, {tau})", text) for text in (*plain.rates, *plain.outputs)]
    n = len(plain.rates)
    theta = np.append(run.theta, rng.choice(SHARES) * rng.choice(runs.dt[0]))
    before = runs.u[0, 0] * np.where(rng.integers(2), 1.0, rng.choice([0.5, 1.2, 2.0], runs.u.shape[2]))
    given = fp.Runs(runs.x0, runs.u, runs.dt, runs.measured, before=before)
    of_delayed = benched(run.bench, replace(plain, rates=tuple(late[:n]), outputs=tuple(late[n:])), plain)
    return Run(of_delayed, given, theta), Run(benched(run.bench, plain, plain), by_hand(given, float(theta[-1])), theta)


def benched(bench: Bench, case: object, read: object) -> Bench:
    other = copy.copy(bench)
    other.case, other.model = case, case.model()  # type: ignore[attr-defined, assignment]
    other.__dict__["reading"] = read.reading()  # type: ignore[attr-defined]
    return other


def by_hand(runs: fp.Runs, tau: float) -> fp.Runs:
    """One run with the first input late by tau: a segment for each interval between ends and late switches."""
    ends = np.concatenate([[0.0], np.cumsum(runs.dt[0])])
    same = 1e-12 * ends[-1]
    instants = list(ends)
    for late in ends[:-1] + tau:
        if late < ends[-1] - same and min(abs(late - one) for one in instants) > same:
            instants.append(late)
    instants.sort()
    u, dt, measured = [], [], []
    for begin, end in itertools.pairwise(instants):
        n = int(np.searchsorted(ends, (begin + end) / 2)) - 1
        since = int(np.searchsorted(ends + tau, (begin + end) / 2)) - 1
        late_input = runs.before[0, 0] if since < 0 else runs.u[0, min(since, len(ends) - 2), 0]  # type: ignore[index]
        u.append([late_input, *runs.u[0, n, 1:]])
        dt.append(end - begin)
        measured.append(end in ends and bool(runs.measured[0, n]))
    return fp.Runs(runs.x0, [u], [dt], [measured])


def compare(one: Run, other: Run) -> None:
    figures = one.bench.figures
    given, tight, expected = one.simulate(RTOL), one.simulate(TIGHT), other.simulate(TIGHT)
    figures.count("runs with dead time")
    if given is None or tight is None or expected is None or given.status[0] or tight.status[0] or expected.status[0]:
        figures.count("runs with dead time that are not ok")
        return
    at = np.concatenate([[0.0], np.cumsum(other.runs.dt[0])])
    ends = np.concatenate([[0.0], np.cumsum(one.runs.dt[0])])
    rows = [int(np.argmin(abs(at - end))) for end in ends]
    judge(one, "segments by hand", given.x[0], expected.x[0, rows], tight.x[0])
    done = one.sensitivities(RTOL)
    figures.count(f"run derivatives with dead time {fp.Status(int(done.status[0])).name}")
    if done.status[0] == OK:
        judge_derivatives(one, done.dx_dtheta[0], tight.x[0])


def judge_derivatives(one: Run, slopes: Floats, x: Floats) -> None:
    rows = np.flatnonzero(one.runs.measured[0])
    for j in range(len(one.theta)):
        if one.theta[j] or j < len(one.theta) - 1:
            found = differences(one, x[1:][rows], rows, j)
            if found is None:
                one.bench.figures.count("run columns without differences")
            else:
                judge_column(one, slopes[rows][:, :, j], x, found, j)
