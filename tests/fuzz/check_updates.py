"""Runs of random models whose states are updated: at each segment, at given times, and by clocks that fit the segments or do not.

The states are those of the same model without updates, piece by piece, with the new values computed by Python. The derivatives are
those of differences of tight runs.
"""

from __future__ import annotations

import itertools

import numpy as np

import fisherpoint as fp
from check_delay import benched, judge_derivatives
from check_runs import judge
from checks import OK, TIGHT, Bench
from random_runs import RTOL, Run, drawn
from reading import Floats

COUNT = 4
PERIODS = (1.0, 0.5, 0.37, 2.0, 100.0)  # in segments
VALUES = ("0.5*{x} + 0.3*{p}*{size}", "{x} + 0.1*{p}*{size}", "max({x}, 0.6*{size})", "0.7*{size}")


def check_updates(bench: Bench) -> None:
    """Some runs from the starts of the case's points, with a state that is updated."""
    if not bench.case.rates or not len(bench.points):
        return
    rng = np.random.default_rng(bench.case.seed)
    for k in range(min(COUNT, len(bench.points))):
        run = drawn(bench, rng, k)
        if run is not None:
            compare(run, rng)


def compare(run: Run, rng: np.random.Generator) -> None:
    """Make an update of the first state, and follow the run with it and by hand."""
    bench, case, runs = run.bench, run.bench.case, run.runs
    size = float(case.sizes[0])
    scale = float(case.parameter_sizes[0]) if case.parameter_sizes else 1.0
    text = str(rng.choice(VALUES)).format(
        x=case.states[0], p=f"{case.parameters[0]}/{scale!r}" if case.parameters else "1", size=repr(size)
    )
    ends = np.cumsum(runs.dt[0])
    period = float(rng.choice(PERIODS)) * float(runs.dt[0, 0])
    every, first = f"every {period!r} s", float(ends[0])
    when = str(rng.choice(["each segment", every, f"{every} from {0.5 * period!r} s", f"at {first!r} s, {1.5 * first!r} s"]))
    if "every" in when and ends[-1] / period > 40:
        return
    bench.figures.count("runs with updates")
    updated = benched(bench, case, case)
    updated.model = fp.SymbolicModel(**case.arguments(), resets={when: {case.states[0]: text}}, check_units=False)
    one = Run(updated, runs, run.theta)
    given, tight = one.simulate(RTOL), one.simulate(TIGHT)
    expected = by_hand(run, updated.model.updates[0], text)
    if given is None or tight is None or expected is None or given.status[0] or tight.status[0]:
        bench.figures.count("runs with updates that are not ok")
        return
    judge(one, "updates by hand", given.x[0], expected, tight.x[0])
    done = one.sensitivities(RTOL)
    bench.figures.count(f"run derivatives with updates {fp.Status(int(done.status[0])).name}")
    if done.status[0] == OK:
        judge_derivatives(one, done.dx_dtheta[0], tight.x[0])


def by_hand(run: Run, times: object, text: str) -> Floats | None:
    """States (N + 1, n_x) at the ends of segments; None where a piece does not get to its end."""
    bench, runs = run.bench, run.runs
    ends = np.concatenate([[0.0], np.cumsum(runs.dt[0])])
    near = 1e-9 * float(np.min(runs.dt[0]))
    instants = ends[:-1] if times.each_segment else times.until(ends[-1])  # type: ignore[attr-defined]
    own = [float(ends[np.argmin(abs(ends - t))]) if np.min(abs(ends - t)) <= near else float(t) for t in instants]
    own = [t for t in own if t < ends[-1]]
    code = compile(text, "update", "eval")
    x, states = runs.x0[0].copy(), [runs.x0[0].copy()]
    for n in range(len(ends) - 1):
        cuts = [float(ends[n]), *(t for t in own if ends[n] < t < ends[n + 1]), float(ends[n + 1])]
        for begin, end in itertools.pairwise(cuts):
            if begin in own:
                names = dict(zip(bench.case.states, x.tolist(), strict=True)) | {"max": max}
                names |= dict(zip(bench.case.parameters, run.theta.tolist(), strict=True))
                x = np.concatenate([[eval(code, {}, names)], x[1:]])  # the texts are ours
            piece = Run(bench, fp.Runs([x], runs.u[:, n : n + 1], [[end - begin]]), run.theta).simulate(TIGHT)
            if piece is None or piece.status[0] != OK:
                return None
            x = piece.x[0, 1]
        states.append(x)
    return np.array(states)
