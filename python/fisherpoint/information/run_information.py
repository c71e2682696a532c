"""The information in runs, their samples one after the other as those of points are."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array, IntArray
from ..points.broken_limits import statuses_in_words
from ..points.runs import Runs
from ..points.settings import Integration, checked_arguments, resolve_threads
from ..points.status import NoTrajectory, Status
from .point_information import PointInformation
from .problem import DesignProblem
from .run_tangents import RunRows, run_tangents

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


def run_information(problem: DesignProblem, runs: Runs, threads: int | None) -> PointInformation:
    """Information of given runs, a sample after the other; every run must reach its end.

    Raises
    ------
    ValueError
        Where a trajectory is not ok, or has no derivative at a sample; the message names the runs and reasons. And where the
        problem weighs outputs by more than the sensor noise.
    """
    checked_problem(problem)
    checked_arguments(problem.model, runs, problem.theta, problem.rtol, threads, problem.kinks, problem.jumps, None)
    settings = problem.integration(threads)
    rows = run_rows(problem, runs, problem.theta, settings)
    bad = np.flatnonzero(rows.status)
    if len(bad):
        listed_rows = bad[:5].tolist()
        words = statuses_in_words(problem.limited, runs, problem.theta, settings, rows.status, listed_rows)
        listed = ", ".join(f"runs[{k}] ({word})" for k, word in zip(listed_rows, words, strict=True))
        more = " ..." if len(bad) > 5 else ""
        raise NoTrajectory(f"runs: expected trajectories that are ok, given {listed}{more}. {Status(rows.status[bad[0]]).advice}")
    sensitivity, _ = rows.samples(runs)
    n_y = sensitivity.shape[1]
    return PointInformation(runs, sensitivity, np.zeros((len(sensitivity), n_y, n_y)))


def run_samples_at(
    problem: DesignProblem, runs: Runs, theta: Array, threads: int | None, measured: NDArray[np.bool_] | None = None
) -> Iterator[tuple[Array, IntArray]]:
    """For each of R sets of parameters (R, p) of the model: rows (S, n_y, p) and statuses (S,) of the samples.

    Kinks and jumps are crossed, as in fits. Outputs of samples that are not `measured` (S, n_y) have no weight; the default is all.
    """
    informative = None
    if measured is not None:
        informative = np.zeros((*runs.dt.shape, measured.shape[1]), dtype=bool)
        informative[runs.measured] = measured
    settings = Integration(float(problem.rtol), threads=resolve_threads(threads))
    count, each = len(runs), max(1, MOST_SEGMENTS // runs.dt.size)
    for first in range(0, len(theta), each):
        some = theta[first : first + each]
        many = runs[np.tile(np.arange(count), len(some))]
        of_many = None if informative is None else np.tile(informative, (len(some), 1, 1))
        rows = run_rows(problem, many, np.repeat(some, count, axis=0), settings, of_many)
        for part in range(len(some)):
            own = slice(part * count, (part + 1) * count)
            yield RunRows(rows.sensitivity[own], rows.status[own]).samples(runs)


def information_matrices(problem: DesignProblem, sensitivity: Array) -> Array:
    """F of each of K runs in its sum form, (K, p, p), standardised, of rows (K, N, n_y, p)."""
    white = sensitivity / np.sqrt(np.diag(problem.noise_covariance))[:, None]
    white = white.reshape(len(white), -1, white.shape[3])
    return white.transpose(0, 2, 1) @ white
