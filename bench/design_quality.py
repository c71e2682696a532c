"""``python -m bench.design_quality``: what designs of twelve points promise, and what estimates from them achieve.

For every design, noise level and case: true parameters from the prior, virtual measurements, and a weighted least-squares fit of
each from the prior mean. What is found is kept in the JSON file after each step; an interrupted run goes on from there.
``--table`` prints what the file has, ``--plot DIR`` draws it.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

import fisherpoint as fp
from fisherpoint.basics.values import IntArray
from fisherpoint.data.record_trajectory import record_trajectories
from fisherpoint.estimation.least_squares import CONVERGED, minimise
from fisherpoint.estimation.observed import Observed
from fisherpoint.estimation.precision import Precision, covariances
from fisherpoint.estimation.search import spread_starts
from fisherpoint.estimation.small_samples import output_degrees_of_freedom
from fisherpoint.estimation.unknowns import checked_bounds, prior_factor, unknowns_of
from fisherpoint.estimation.weighting import WeightedResiduals
from fisherpoint.information.draws import drawn_from_prior
from fisherpoint.noise.models import nominal_std
from fisherpoint.points.settings import Integration, resolve_threads
from fisherpoint.validation.fits import Estimator
from fisherpoint.validation.searches import Searched
from fisherpoint.validation.truths import TRUTH_RTOL, Rig, Streams

from .quality_designs import MODEL, PRIOR, SMOOTH, SOURCES, Candidate, problem

Array = NDArray[np.float64]

LEVELS = (1.0, 10.0, 0.1)
N, N_LONG, SEED = 300, 100, 0
"""True parameter sets, of the records of 120 samples, and the seed of both and of the noise."""

RTOL, RECORD_RTOL, ITERATIONS = 1e-9, 1e-6, 60
"""Of the fits: tolerances of points and of records, and steps at most; who converges takes ten to twenty."""

FARTHEST = 10.0
"""Bounds of the fits of records, in prior std from the prior mean."""

T_1, T_1_STD = 2.2e-3, 2.2e-4
BATCH = 100
"""Fits that advance together: of records, more would not fit the caches."""


class Fits(Estimator):
    """Fits from the prior mean; of points, those that get stuck begin once more at a node of the prior."""

    def searched(self, residuals: WeightedResiduals, truth: Array) -> Searched:
        bounds = self.unknowns.lower, self.unknowns.upper
        minima = minimise(residuals, np.tile(self.start, (len(truth), 1)), *bounds, ITERATIONS)
        stuck = np.flatnonzero(minima.end != CONVERGED)
        if len(stuck) and len(self.starts) > 1:
            again = np.tile(self.starts[1], (len(stuck), 1))
            found = minimise(replace(residuals, y=residuals.y[stuck]), again, *bounds, ITERATIONS)
            better = found.end == CONVERGED
            minima.z[stuck[better]], minima.end[stuck[better]] = found.z[better], CONVERGED
        n_y = residuals.y.shape[-1]
        return Searched(minima, np.zeros((len(truth), n_y, n_y)), np.zeros(len(truth), dtype=bool))


@dataclass(frozen=True)
class Case:
    """Which T_1 the truth has, as a factor, what the fits take T_1 for, and whether they use the prior."""

    factor: float = 1.0
    t_1: str = "known"  # or "stated", "estimated"
    use_prior: bool = False


CASES = {
    "right": Case(),
    "T_1 off": Case(factor=1.1),
    "prior": Case(use_prior=True),
    "stated": Case(t_1="stated"),
    "stated, T_1 off": Case(factor=1.1, t_1="stated"),
    "estimated": Case(t_1="estimated"),
    "estimated, T_1 off": Case(factor=1.1, t_1="estimated"),
}
FOR_ALL = ("right", "prior", "T_1 off")
"""Cases of every design; the others are those of "noise" alone."""


def setting(case: Case, noise: float) -> fp.DesignProblem:
    """The problem that the fits solve."""
    asked = problem(noise)
    if case.t_1 == "stated":
        return asked.replace(varies={"T_1": T_1_STD})
    if case.t_1 == "estimated":
        prior = fp.GaussianPrior({**PRIOR.mean, "T_1": T_1}, {**PRIOR.std, "T_1": T_1_STD})
        return asked.replace(model=MODEL.estimate("T_1"), prior=prior, parameters=None)
    return asked


@cache
def truths(n: int) -> Array:
    """True parameters (n, p), the same for all."""
    return drawn_from_prior(problem(), n, np.random.default_rng([SEED, 0]))[0]


def measured(candidate: Candidate, case: Case, noise: float, theta: Array) -> tuple[Array, IntArray]:
    """What rigs with these parameters measure (B, N, n_y), and the status of each."""
    asked, streams = problem(noise), Streams.of(SEED, len(MODEL.outputs))
    constants: dict[str, Any] = {"T_1": case.factor * T_1}
    if isinstance(candidate.data, fp.Experiments):
        rig = Rig.of(asked, fp.HydraulicCylinder(**constants), nominal_std(asked.noise))
        y, status, _ = rig.measure(candidate.data, theta, streams, resolve_threads(None))
        return y, status
    one = candidate.data
    x0 = np.tile([one.x0[state.name] for state in MODEL.states], (len(theta), 1))
    true = fp.HydraulicCylinder(**constants, smooth=SMOOTH)
    _, y, status, _ = record_trajectories(true, theta, x0, one.inputs, Integration(TRUTH_RTOL, threads=resolve_threads(None)))
    return y + np.array(list((nominal_std(asked.noise)).values())) * streams.noise.standard_normal(y.shape) + 0 * one.y, status


def estimator(candidate: Candidate, case: Case, noise: float) -> Estimator:
    """What fits the data."""
    asked, threads = setting(case, noise), resolve_threads(None)
    std = dict(nominal_std(asked.noise))
    if isinstance(candidate.data, fp.Experiments):
        return Fits.of(asked, candidate.data, std, True, case.use_prior, RTOL, threads)
    model, names, one = fp.HydraulicCylinder(smooth=SMOOTH), asked.estimated, candidate.data
    mean = {name: PRIOR.mean[name] for name in names}
    unknowns = unknowns_of(mean, PRIOR, {}, checked_bounds(model, None, names))
    # Twelve samples leave directions open, along which a fit would run to where the equations are stiff.
    unknowns = replace(unknowns, lower=np.maximum(unknowns.lower, -FARTHEST), upper=np.minimum(unknowns.upper, FARTHEST))
    residuals = WeightedResiduals(
        Observed(model, [one], names, asked.theta, RECORD_RTOL, threads),
        unknowns,
        one.y[None],
        np.diag([std.get(output.name, 1.0) ** 2 for output in model.outputs]),
        prior_factor(PRIOR, unknowns) if case.use_prior else None,
    )
    starts = spread_starts(unknowns, mean, None, 1)
    _, jacobian, _ = residuals(starts[:1], np.zeros(1, dtype=np.intp))
    return Fits(residuals, starts, True, Precision.of(jacobian[0]))


def study(candidate: Candidate, case: Case, noise: float, n: int) -> dict[str, Any]:
    """Fit n virtual experiments; standard errors and errors in prior std, by parameter."""
    begin, theta, fits = perf_counter(), truths(n), estimator(candidate, case, noise)
    names, p = fits.unknowns.names, len(PRIOR.names)
    y, status = measured(candidate, case, noise, theta)
    fine = np.flatnonzero(status == fp.Status.ok)
    truth = theta[fine]
    if case.t_1 == "estimated":
        truth = np.column_stack([truth, np.full(len(fine), case.factor * T_1)])
    std = np.array([setting(case, noise).prior.std[name] for name in names])
    off, covered, failures = np.empty((len(fine), len(names))), np.empty((len(fine), len(names)), dtype=bool), Counter[str]()
    squares, degrees, lost = np.zeros(y.shape[-1]), np.zeros(y.shape[-1]), []
    for first in range(0, len(fine), BATCH):
        some = slice(first, first + BATCH)
        runs = fits.fit(y[fine[some]], truth[some])
        failed = runs.failure != ""
        failures.update(runs.failure[failed].tolist())
        lost += (first + np.flatnonzero(failed)).tolist()
        # Whose fit fails is left with the prior.
        off[some] = (np.where(failed[:, None], fits.unknowns.center, runs.estimate) - truth[some]) / std
        covered[some] = runs.covered & ~failed[:, None]
        found = chi_squares(replace(fits, residuals=replace(fits.residuals, y=y[fine[some]])), runs.estimate, ~failed)
        squares, degrees = squares + found[0], degrees + found[1]
    own = candidate.own if case.t_1 == "known" else None
    return {
        "promised": (fits.promised_errors / std)[:p].tolist(),
        "own": None if own is None or case.use_prior else own.tolist(),
        "squares": np.round(off[:, :p] ** 2, 12).tolist(),
        "coverage": covered[:, :p].mean(axis=0).tolist(),
        "chi_square": (squares / degrees).tolist(),
        "t_1": None if len(names) == p else float(np.sqrt(np.mean(off[:, p] ** 2)) * T_1_STD),
        "rigs": n,
        "cannot_run": dict(Counter(fp.Status(int(code)).name for code in status if code != fp.Status.ok)),
        "failed": dict(failures),
        "failed_rows": lost,
        "seconds": perf_counter() - begin,
    }


def chi_squares(fits: Estimator, estimate: Array, fine: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Sums over the fits of the squared residuals of each output, and of their degrees of freedom."""
    shape = fits.residuals.y.shape[1:]
    residuals, jacobian, _ = fits.residuals(fits.unknowns.coordinates(estimate), np.arange(len(estimate)))
    covariance, _ = covariances(jacobian)
    rows = shape[0] * shape[1]
    squares = np.square(residuals[:, :rows]).reshape(-1, *shape).sum(axis=1)
    counts = fits.residuals.measured.sum(axis=0)
    degrees = output_degrees_of_freedom(jacobian[:, :rows].reshape(len(jacobian), *shape, -1), covariance, counts)
    return squares[fine].sum(axis=0), degrees[fine].sum(axis=0)


def tasks(only: set[str]) -> Iterator[tuple[str, float, str]]:
    """(design, level, case), what is asked first first."""
    main = [name for name in SOURCES if not name.endswith("paper")]
    asked = [(name, 1.0, case) for case in FOR_ALL for name in main]
    asked += [("noise", 1.0, case) for case in CASES if case not in FOR_ALL]
    asked += [(name, 1.0, "right") for name in SOURCES if name not in main]
    short = [name for name in main if not name.endswith("120")]
    asked += [(name, level, "right") for level in LEVELS for name in short]
    asked += [(name, 10.0, "prior") for name in short]
    for task in dict.fromkeys(asked):
        if all(not names or task[place] in names for place, names in ((0, only & set(SOURCES)), (2, only & set(CASES)))):
            yield task


def main() -> None:
    """Measure what the file does not have yet."""
    parser = argparse.ArgumentParser(prog="python -m bench.design_quality", description=__doc__.split("\n")[0].split(": ")[1])
    parser.add_argument("--quick", action="store_true", help="30 true parameter sets and one seed of each design, for a look")
    parser.add_argument("--json", type=Path, metavar="FILE", help="figures found so far, and those that are added")
    parser.add_argument("--only", metavar="NAME", action="append", help="these designs, these cases; may be repeated")
    parser.add_argument("--table", action="store_true", help="print what the file has, measure nothing")
    parser.add_argument("--plot", type=Path, metavar="DIR", help="draw what the file has, measure nothing")
    options = parser.parse_args()
    known = {*SOURCES, *CASES}
    for name in options.only or ():
        if name not in known:
            parser.error(f"--only: expected one of {', '.join(sorted(known))}; given {name!r}")
    found = json.loads(options.json.read_text()) if options.json is not None and options.json.exists() else {}
    n = 30 if options.quick else N
    if not options.table and options.plot is None:
        for name, level, case in tasks(set(options.only or ())):
            measure(found, name, level, case, n, options)
    from .quality_tables import plot, show  # Matplotlib and Rich only where something is shown

    if options.plot is not None:
        plot(found, options.plot)
    else:
        show(found)


def measure(found: dict[str, Any], name: str, level: float, case: str, n: int, options: argparse.Namespace) -> None:
    """Add the figures of one task, unless they are there with as many parameter sets."""
    key = f"{name}|{level:g}|{case}"
    source, seeds = SOURCES[name]
    seeds = 1 if options.quick else seeds
    n = min(n, N_LONG) if name.endswith("120") else n
    if key in found and len(found[key]) >= seeds and found[key][0]["rigs"] == n:
        return
    found[key] = [study(source(level, seed), CASES[case], level, n) for seed in range(seeds)]
    print(f"{key}: {sum(one['seconds'] for one in found[key]):.0f} s", flush=True)
    if options.json is not None:
        written = options.json.with_suffix(".part")
        written.write_text(json.dumps(found) + "\n")
        written.replace(options.json)


if __name__ == "__main__":
    main()
