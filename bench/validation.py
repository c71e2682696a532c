"""A thousand fits of the cylinder, next to a loop over SciPy's `least_squares`: time and agreement.

Of a 12-point design of the default form, and of two runs of 48 samples of the smooth form, compiled.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.optimize import least_squares

import fisherpoint as fp
from fisherpoint.basics.values import Array
from fisherpoint.estimation.least_squares import minimise
from fisherpoint.estimation.weighting import WeightedResiduals
from fisherpoint.points.settings import resolve_threads
from fisherpoint.validation.fits import Estimator, VirtualExperiments
from fisherpoint.validation.truths import Rig, Streams, truths_of

from .designs import NOISE_STD, default_problem
from .timing import best_times

RTOLS = (1e-6, 1e-9)
FITS, COMPARED, LOOPED = 1000, 200, 20
SAME = 1e-6
"""Standard errors up to which two fits agree."""

TIGHT = 1e-15
"""Tolerance that asks SciPy for all that it can do."""


@dataclass(frozen=True)
class ValidationFigures:
    """The fits of one design at one tolerance of the trajectories.

    `seconds` are those of all fits together and `whole` those of `fisherpoint.validate`, both on `threads`; `ratio` is the time of
    a fit in a loop of `least_squares` with the engine's Jacobian to that of one of many. Distances to its minima are in standard
    errors: as they are, where `same` of `compared` agree, and after a Gauss-Newton step on its residuals.
    """

    design: str
    rtol: float
    threads: int
    seconds: float
    whole: float
    cores: float
    ratio: float
    compared: int
    same: int
    median: float
    worst: float
    worst_stepped: float


def measure(quick: bool) -> list[ValidationFigures]:
    """Figures for every tolerance, with the truth at the prior mean."""
    problem = default_problem("noise")
    points = fp.exchange(
        problem, n_experiments=12, n_candidates=50, max_iterations=40 if quick else 200, seed=0, method="paper"
    ).points
    smooth = fp.HydraulicCylinder(smooth=dict.fromkeys(("v", "x_v"), 1e-3)).compile()
    of_points = [_figures("12 points", problem, points, rtol, quick) for rtol in RTOLS]
    return of_points + [_figures("2 runs of 48", problem.replace(model=smooth), runs(), rtol, quick) for rtol in RTOLS]


def runs() -> fp.Runs:
    """Two runs from rest, of 0.24 s each, under twelve random inputs that are held for four samples."""
    levels = np.random.default_rng(0).uniform(-0.3, 0.3, (2, 12))
    return fp.Runs([[0.15, 0.0, 8e6, 10e6, 0.0]] * 2, np.repeat(levels, 4, axis=1), 5e-3)


def _figures(
    design: str, problem: fp.DesignProblem, points: fp.Experiments | fp.Runs, rtol: float, quick: bool
) -> ValidationFigures:
    threads = resolve_threads(None)
    estimator = Estimator.of(problem, points, NOISE_STD, True, False, rtol, threads)
    theta, _ = truths_of(problem, "mean", FITS, 0)
    rig = Rig.of(problem, None, NOISE_STD)
    y, _, _ = rig.measure(points, theta, Streams.of(0, len(problem.model.outputs)), threads)
    experiments = VirtualExperiments(estimator, rig, points, threads)
    residuals = replace(estimator.residuals, y=y)
    starts = np.tile(estimator.start, (FITS, 1))
    bounds = estimator.unknowns.lower, estimator.unknowns.upper
    tasks: dict[str, Callable[[], object]] = {
        "together": partial(minimise, residuals, starts, *bounds, accuracy=residuals.accuracy),
        "validate": lambda: experiments.run(theta, Streams.of(0, len(problem.model.outputs))),
        "loop": lambda: [_alone(residuals, estimator.start, row) for row in range(LOOPED)],
    }
    times = best_times(tasks, 2 if quick else 5)
    minima = minimise(residuals, starts, *bounds, accuracy=residuals.accuracy)
    compared = 20 if quick else COMPARED
    distances = np.array([_distances(residuals, estimator.start, minima.z[row], row) for row in range(compared)])
    return ValidationFigures(
        design,
        rtol,
        threads,
        times["together"].seconds,
        times["validate"].seconds,
        times["together"].cores,
        times["loop"].seconds / LOOPED / (times["together"].seconds / FITS),
        compared,
        int((distances[:, 0] < SAME).sum()),
        float(np.median(distances[:, 0])),
        float(distances[:, 0].max()),
        float(distances[:, 1].max()),
    )


def _one(residuals: WeightedResiduals, row: int, z: Array) -> tuple[Array, Array]:
    """Residuals and Jacobian of one problem; far off where a trajectory fails, so that the step is refused."""
    r, jacobian, ok = residuals(z[None], np.array([row]))
    return (r[0] if ok[0] else np.full(r.shape[1], 1e6)), jacobian[0]


def _alone(residuals: WeightedResiduals, start: Array, row: int) -> Array:
    """The minimum that SciPy finds, with each Jacobian taken from the evaluation of the residuals."""
    kept: dict[bytes, tuple[Array, Array]] = {}

    def both(z: Array) -> tuple[Array, Array]:
        key = z.tobytes()
        if key not in kept:
            kept.clear()
            kept[key] = _one(residuals, row, z)
        return kept[key]

    bounds = residuals.unknowns.lower, residuals.unknowns.upper

    def function(z: Array) -> Array:
        return both(z)[0]

    def jacobian(z: Array) -> Array:
        return both(z)[1]

    found = least_squares(function, start, jacobian, bounds, x_scale="jac", ftol=TIGHT, xtol=TIGHT, gtol=TIGHT)
    return np.asarray(found.x)


def _distances(residuals: WeightedResiduals, start: Array, z: Array, row: int) -> tuple[float, float]:
    found = _alone(residuals, start, row)
    r, jacobian = _one(residuals, row, found)
    stepped = found - np.linalg.lstsq(jacobian, r)[0]
    return float(np.linalg.norm(jacobian @ (found - z))), float(np.linalg.norm(jacobian @ (stepped - z)))
