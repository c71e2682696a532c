"""Runs of random models whose outputs are late: by nothing, whole and broken numbers of segments, and longer than the run.

The outputs are the states of the same model without delays, under segments that are divided by hand, and the derivatives, that by
the delay among them, those of differences of tight runs. In some the first input is late by the same time.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import numpy as np

import fisherpoint as fp
from check_delay import SHARES, benched, by_hand
from check_run_derivatives import differences, judge_column
from check_runs import judge
from checks import OK, TIGHT, Bench
from random_runs import RTOL, Run, drawn
from reading import Floats

COUNT = 4
BESIDE = 1e-9  # of a run, up to which an instant is at an end


@dataclass
class LateRun(Run):
    """A run of a model whose outputs are its states as they were before; they stand in the place of these."""

    def simulate(self, rtol: float, jumps: str = "cross", theta: Floats | None = None) -> fp.Trajectories | None:
        done = super().simulate(rtol, jumps, theta)
        return None if done is None else done._replace(x=np.concatenate([done.x[:, :1], done.y], axis=1))


def check_late(bench: Bench) -> None:
    """Some runs from the starts of the case's points, with all states as late outputs."""
    if not bench.case.rates or not len(bench.points):
        return
    rng = np.random.default_rng(bench.case.seed)
    for k in range(min(COUNT, len(bench.points))):
        run = drawn(bench, rng, k)
        if run is not None:
            compare(*late(run, rng))


def late(run: Run, rng: np.random.Generator) -> tuple[LateRun, Run, Floats]:
    """The run with late outputs; the same without, with its segments divided by hand; and what is shown when."""
    case, runs = run.bench.case, run.runs
    plain = replace(
        case, parameter_sizes=(*case.parameter_sizes, case.time), relative_std=(0.0,), log=(False,), outputs=case.states
    )
    tau, theta = plain.parameters[-1], np.append(run.theta, rng.choice(SHARES) * rng.choice(runs.dt[0]))
    rates, divided = plain.rates, runs
    if case.inputs and rng.integers(2):
        rates = tuple(re.sub(r"\bu1\b", f"delay(u1, {tau})", text) for text in rates)
        before = runs.u[0, 0] * np.where(rng.integers(2), 1.0, 1.2)
        runs = fp.Runs(runs.x0, runs.u, runs.dt, runs.measured, before=before)
        divided = by_hand(runs, float(theta[-1]))
    shown = np.cumsum(runs.dt[0]) - theta[-1]
    of_late = replace(plain, rates=rates, outputs=tuple(f"delay({x}, {tau})" for x in case.states))
    other = Run(benched(run.bench, plain, plain), with_ends(divided, shown), theta)
    return LateRun(benched(run.bench, of_late, plain), runs, theta), other, shown


def with_ends(runs: fp.Runs, instants: Floats) -> fp.Runs:
    """One run with further ends of segments."""
    ends = np.concatenate([[0.0], np.cumsum(runs.dt[0])])
    same = 1e-12 * ends[-1]
    further = [t for t in instants if 0 < t < ends[-1] and np.min(abs(ends - t)) > same]
    every = np.union1d(ends, further)
    n = np.searchsorted(ends, (every[1:] + every[:-1]) / 2) - 1
    return fp.Runs(runs.x0, runs.u[:, n], [np.diff(every)])


def compare(one: LateRun, other: Run, shown: Floats) -> None:
    figures = one.bench.figures
    given, tight, expected = one.simulate(RTOL), one.simulate(TIGHT), other.simulate(TIGHT)
    figures.count("runs with late outputs")
    if given is None or tight is None or expected is None or given.status[0] or tight.status[0] or expected.status[0]:
        figures.count("runs with late outputs that are not ok")
        return
    at = np.concatenate([[0.0], np.cumsum(other.runs.dt[0])])
    rows = [0, *(int(np.argmin(abs(at - t))) for t in shown)]
    judge(one, "states by hand", given.x[0], expected.x[0, rows], tight.x[0])
    done = one.sensitivities(RTOL)
    figures.count(f"derivatives of late outputs {fp.Status(int(done.status[0])).name}")
    if done.status[0] != OK:
        return
    ends = np.concatenate([[0.0], np.cumsum(one.runs.dt[0])])
    apart = np.abs(shown[:, None] - ends).min(axis=1) > BESIDE * ends[-1]  # there may be no derivative where a jump is
    rows = np.flatnonzero(one.runs.measured[0] & (apart | (shown < -BESIDE * ends[-1]) | (not one.bench.reading.surfaces)))
    for j in range(len(one.theta)) if len(rows) else ():
        if one.theta[j] or j < len(one.theta) - 1:
            found = differences(one, tight.x[0, 1:][rows], rows, j)
            if found is None:
                figures.count("run columns without differences")
            else:
                judge_column(one, done.dy_dtheta[0, rows, :, j], tight.x[0], found, j)
