"""The information in runs, their samples one after the other as those of points are."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array, IntArray
from ..basics.work_clock import Clock
from ..points.broken_limits import refuse_failures
from ..points.run_trajectories import checked_run_sensitivities
from ..points.runs import Runs
from ..points.settings import Integration, checked_arguments, resolve_threads
from ..points.status import Status, only_finite
from .point_information import PointInformation, point_information
from .problem import DesignProblem
from .run_tangents import RunRows, informed, run_tangents

MOST_SEGMENTS = 200_000
"""Segments that the engine is given at once, so that memory stays bounded."""


def checked_problem(problem: DesignProblem) -> DesignProblem:
    """Return the problem, which must weigh the samples of runs by the sensor noise."""
    if problem.output_covariance != "noise":
        raise ValueError(f"output_covariance: expected 'noise' for runs, given {problem.output_covariance!r}")
    if problem.assumed is not None and problem.assumed_covariance != "tangents":
        raise ValueError(f"assumed_covariance: expected 'tangents' for runs, given {problem.assumed_covariance!r}")
    return problem


def run_rows(
    problem: DesignProblem, runs: Runs, theta: Array, settings: Integration, informative: NDArray[np.bool_] | None = None
) -> RunRows:
    """The rows of runs that fit the problem's model, at parameters (p,) or (K, p) of it.

    Outputs that are not `informative` (K, N, n_y) have no weight; the default is all.
    """
    return run_tangents(problem, runs, theta, settings, outputs_alone=True).rows(problem, informative)


def information_of(problem: DesignProblem, runs: Runs, threads: int | None, over_prior: bool = False) -> PointInformation:
    """Information of given runs, a sample after the other; every run must reach its end.

    What is drawn anew is a share of the covariances of points, and part of the rows of runs of several segments. With `over_prior`
    points have predictive covariances too.

    Raises
    ------
    ValueError
        Where a trajectory is not ok, at the prior mean or, with `over_prior`, over the prior; the message names the runs and
        reasons. And where the problem weighs runs of several segments by more than the sensor noise.
    """
    if runs.points is not None:
        return point_information(problem, runs.points, over_prior, threads)
    checked_problem(problem)
    checked_arguments(problem.model, runs, problem.theta, problem.rtol, threads, problem.kinks, problem.jumps, None)
    settings = problem.integration(threads)
    rows = run_rows(problem, runs, problem.theta, settings)
    refuse_failures(problem.limited, runs, problem.theta, settings, rows.status)
    sensitivity, _ = rows.samples(runs)
    n_y = sensitivity.shape[1]
    measured = None if runs.by_output is None else runs.by_output[runs.measured]
    return PointInformation(runs, sensitivity, np.zeros((len(sensitivity), n_y, n_y)), measured=measured)


def samples_at(
    problem: DesignProblem,
    runs: Runs,
    theta: Array,
    threads: int | None,
    measured: NDArray[np.bool_] | None = None,
    plain: bool = False,
    clock: Clock | None = None,
) -> Iterator[tuple[Array, IntArray]]:
    """For each of R sets of parameters (R, p) of the model: rows (S, n_y, p) and statuses (S,) of the samples.

    Kinks and jumps are crossed, as in fits. Outputs of samples that are not `measured` (S, n_y) have no weight; the default is all.
    Rows that are `plain` have nothing in them of what is drawn anew. With a `clock`, `OutOfTime` is raised where it is late.
    """
    informative = None
    if measured is not None:
        informative = np.zeros((*runs.dt.shape, measured.shape[1]), dtype=bool)
        informative[runs.measured] = measured
    settings = Integration(float(problem.rtol), threads=resolve_threads(threads))
    rows_of = _plain_rows if plain else run_rows
    count, each = len(runs), max(1, MOST_SEGMENTS // runs.dt.size)
    kind = "tangents" if runs.points is None else "sensitivities"
    clock = Clock() if clock is None else clock
    clock.check(clock.cost(kind, len(theta) * len(runs)))  # a part of them is of no use
    blocks = clock.blocks(kind, len(theta), len(runs))
    for some in (theta[block][first : first + each] for block in blocks for first in range(0, len(theta[block]), each)):
        many = runs[np.tile(np.arange(count), len(some))]
        of_many = None if informative is None else np.tile(informative, (len(some), 1, 1))
        rows = rows_of(problem, many, np.repeat(some, count, axis=0), settings, of_many)
        for part in range(len(some)):
            own = slice(part * count, (part + 1) * count)
            yield RunRows(rows.sensitivity[own], rows.status[own]).samples(runs)


def _plain_rows(
    problem: DesignProblem, runs: Runs, theta: Array, settings: Integration, informative: NDArray[np.bool_] | None
) -> RunRows:
    """The standardised sensitivities of runs, whatever is drawn anew in each."""
    model = problem.limited
    if problem.n_nuisance and problem.assumed is not None:
        model, theta = problem.assumed.model, problem.assumed.theta(theta)
    result = checked_run_sensitivities(model, runs, theta, settings, outputs_alone=True)
    scaled = problem.standardised(result.dy_dtheta)
    if informative is not None or runs.by_output is not None:
        scaled = np.where(informed(runs, informative)[..., None], scaled, 0.0)
    status = only_finite(result.status, scaled)
    scaled[status != Status.ok] = 0.0
    return RunRows(scaled, status)


def information_matrices(problem: DesignProblem, sensitivity: Array) -> Array:
    """F of each of K runs in its sum form, (K, p, p), standardised, of rows (K, N, n_y, p)."""
    white = sensitivity / np.sqrt(np.diag(problem.noise_covariance))[:, None]
    white = white.reshape(len(white), -1, white.shape[3])
    return white.transpose(0, 2, 1) @ white
