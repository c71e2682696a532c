"""Runs of random models that are sampled on their own clock: slower than their segments, much faster, and just with their ends.

The states at the ends of segments are those of the run that is not divided. Outputs with instants of their own, periods or tables,
are measured there, and F is that of these readings.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import fisherpoint as fp
from check_runs import judge
from checks import TIGHT, Bench
from random_runs import RTOL, Run, drawn
from reading import Floats

Flags = NDArray[np.bool_]

COUNT = 4
SAMPLES = (1.0, 3.0, 7.3, 20.0, 50.0)
"""Periods in the length of a run."""

MOST = 200
"""Their number where the shortest segment is the period."""

SAME = 1e-9
"""Share of the length of a run, and of F, by which instants and sums may differ."""


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
            by_outputs(run, rng)


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


def by_outputs(one: Run, rng: np.random.Generator) -> None:
    """A run whose outputs have periods or tables of their own, or are not measured."""
    bench, names, total = one.bench, [quantity.name for quantity in one.bench.model.outputs], float(one.runs.dt.sum())
    every: dict[str, float | Floats] = {}
    for name in names:
        kind = rng.integers(3)
        if kind == 0:
            every[name] = total / float(rng.choice(SAMPLES))
        elif kind == 1:
            every[name] = np.unique(np.minimum(total * rng.choice([0.1, 0.25, 1 / 3, 0.5, 0.77, 1.0], 3), total))
    every = every or {names[0]: np.array([total])}
    sampled = Run(bench, one.runs.sampled(every, model=bench.model), one.theta)
    compare(one, sampled)
    runs, wrong = sampled.runs, 0.0
    flags = np.broadcast_to(runs.readings, (*runs.dt.shape, len(names)))[0]
    for j, name in enumerate(names):
        given = every.get(name, np.zeros(0))
        wanted = given if isinstance(given, np.ndarray) else given * np.arange(1, int(total / given * (1 + 1e-9)) + 1)
        found = runs.t[0, flags[:, j]]
        wrong = max(wrong, np.inf if len(found) != len(wanted) else float(np.abs(found - wanted).max(initial=0.0)) / total)
    bench.figures.count("runs whose outputs have instants of their own")
    if wrong > SAME:
        one.report("instants of outputs", wrong / SAME, sampled.call("simulate", RTOL), f"{every}")
    sensitivities(sampled, flags)


def sensitivities(sampled: Run, flags: Flags) -> None:
    """F of the readings, as it is evaluated and as the sum over them."""
    bench, std = sampled.bench, 0.1 * np.maximum(np.abs(sampled.theta), 1.0)
    parameters, outputs = ([q.name for q in some] for some in (bench.model.parameters, bench.model.outputs))
    prior = fp.GaussianPrior(
        dict(zip(parameters, sampled.theta.tolist(), strict=True)), dict(zip(parameters, std.tolist(), strict=True))
    )
    noise = dict.fromkeys(outputs, 1.0)
    try:
        problem = fp.DesignProblem(bench.model, prior, None, noise=noise, output_covariance="noise", rtol=RTOL)
        found = fp.evaluate(problem, sampled.runs, threads=1)
    except ValueError:
        bench.figures.count("runs whose outputs have instants of their own and no F")
        return
    rows = sampled.sensitivities(RTOL).dy_dtheta[0] * std
    f, of_all = rows[flags].T @ rows[flags], np.einsum("nip,niq->pq", rows, rows)
    error = float(np.abs(found.fisher * found.n_points / 2 - f).max() / max(np.abs(of_all).max(), 1e-300))
    bench.figures.count("F of outputs with instants of their own")
    if error > SAME:
        sampled.report("F of readings", error / SAME, sampled.call("sensitivities", RTOL), "F is not the sum over readings")
