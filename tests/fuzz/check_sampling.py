"""Runs of random models that are sampled on their own clock: slower than their segments, much faster, and just with their ends.

The states at the ends of segments are those of the run that is not divided.
"""

from __future__ import annotations

import numpy as np

import fisherpoint as fp
from check_runs import judge
from checks import TIGHT, Bench
from random_runs import RTOL, Run, drawn

COUNT = 4
SAMPLES = (1.0, 3.0, 7.3, 20.0, 50.0)
"""Periods in the length of a run."""

MOST = 200
"""Their number where the shortest segment is the period."""


def check_sampling(bench: Bench) -> None:
    """Some runs from the starts of the case's points."""
    if not bench.case.rates or not len(bench.points):
        return
    rng = np.random.default_rng(bench.case.seed)
    for k in range(min(COUNT, len(bench.points))):
        run = drawn(bench, rng, k)
        if run is not None:
            period = (
                run.runs.dt.sum() / rng.choice(SAMPLES) if rng.integers(3) else max(run.runs.dt.min(), run.runs.dt.sum() / MOST)
            )
            compare(run, Run(bench, run.runs.sampled(float(period)), run.theta))


def compare(one: Run, sampled: Run) -> None:
    given, tight, fine = one.simulate(RTOL), one.simulate(TIGHT), sampled.simulate(TIGHT)
    one.bench.figures.count("runs that are sampled")
    if given is None or tight is None or fine is None or given.status[0] or tight.status[0] or fine.status[0]:
        one.bench.figures.count("runs that are sampled and not ok")
        return
    at = np.concatenate([[0.0], np.cumsum(sampled.runs.dt[0])])
    rows = [int(np.argmin(abs(at - end))) for end in np.concatenate([[0.0], np.cumsum(one.runs.dt[0])])]
    judge(one, "parts between samples", given.x[0], fine.x[0, rows], tight.x[0])
    loose = sampled.simulate(RTOL)
    one.bench.figures.count(f"runs that are sampled: {'refused' if loose is None else fp.Status(int(loose.status[0])).name}")
