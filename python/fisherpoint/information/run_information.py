"""Runs as the Fisher matrix takes them.

F of a run is the sum over its samples, as long as only the sensor noise moves them. What is uncertain and common to a run, its
start and constants, moves all its samples at once: with G their tangents by it and P its squared standard deviations, the
covariance of what a run measures is one matrix, R_k = I x R + G P G^T, and F = J^T R_k^-1 J. Here each sample has rows such that F
is a sum over samples again: J is multiplied by (I x R)^1/2 R_k^-1/2, so that D = R whitens them as it does those of points.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..basics.values import Array, IntArray
from ..points.broken_limits import statuses_in_words
from ..points.run_trajectories import checked_run_sensitivities
from ..points.runs import Runs
from ..points.settings import Settings, check_jumps, check_kinks, checked_arguments, resolve_threads
from ..points.status import Status, only_finite
from .point_information import PointInformation
from .problem import DesignProblem

MOST_SEGMENTS = 200_000
"""Segments that the engine is given at once, so that memory stays bounded."""


class RunRows(NamedTuple):
    """Of K runs: sensitivities (K, N, n_y, p), standardised and such that D = R whitens them, zero where nothing is measured.

    And the statuses (K,); where one is not ok, all its rows are zero.
    """

    sensitivity: Array
    status: IntArray

    def samples(self, runs: Runs) -> tuple[Array, IntArray]:
        """The rows (S, n_y, p) of the samples, run after run, and their statuses (S,)."""
        run, _ = np.nonzero(runs.measured)
        return self.sensitivity[runs.measured], self.status[run]


def checked_problem(problem: DesignProblem) -> DesignProblem:
    """Return the problem, which must weigh the samples of runs by the sensor noise."""
    if problem.output_covariance != "noise":
        raise ValueError(f"output_covariance: expected 'noise' for runs, given {problem.output_covariance!r}")
    if problem.assumed is not None and problem.assumed_covariance != "tangents":
        raise ValueError(f"assumed_covariance: expected 'tangents' for runs, given {problem.assumed_covariance!r}")
    return problem


def run_rows(problem: DesignProblem, runs: Runs, theta: Array, settings: Settings) -> RunRows:
    """The rows of runs that fit the problem's model, at parameters (p,) or (K, p) of it."""
    assumed = problem.assumed
    model, values = (problem.limited, theta) if assumed is None else (assumed.model, assumed.theta(theta))
    result = checked_run_sensitivities(model, runs, values, settings, outputs_alone=True)
    there = runs.measured[:, :, None, None]
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is given a status
        scaled = np.where(there, result.dy_dtheta[..., problem.estimated_columns] * problem.std, 0.0)
        scaled[~(np.abs(scaled) <= problem.largest_sensitivity)] = np.inf
        status = only_finite(result.status, scaled)
        if assumed is not None:
            moved = np.where(there, result.dy_dtheta[..., assumed.columns] * assumed.std, 0.0)
            status = only_finite(status, moved)
            noise = np.sqrt(np.diag(problem.noise_covariance))[:, None]
            scaled = noise * _whitened(scaled / noise, moved / noise)
            status = only_finite(status, scaled)
    scaled[status != Status.ok] = 0.0
    return RunRows(scaled, status)


def _whitened(rows: Array, moved: Array) -> Array:
    """(I + B B^T)^-1/2 A for rows A (K, N, n_y, p) and B (K, N, n_y, q) of each run."""
    (count, _, _, p), q = rows.shape, moved.shape[3]
    a, b = rows.reshape(count, -1, p), moved.reshape(count, -1, q)
    u, s, _ = np.linalg.svd(b, full_matrices=False)
    shrink = 1 / np.sqrt(1 + s * s) - 1
    white: Array = (a + u @ (shrink[:, :, None] * (u.transpose(0, 2, 1) @ a))).reshape(rows.shape)
    return white


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
    settings = run_settings(problem, threads)
    rows = run_rows(problem, runs, problem.theta, settings)
    bad = np.flatnonzero(rows.status)
    if len(bad):
        told = bad[:5].tolist()
        words = statuses_in_words(problem.limited, runs, problem.theta, settings, rows.status, told)
        listed = ", ".join(f"runs[{k}] ({word})" for k, word in zip(told, words, strict=True))
        more = " ..." if len(bad) > 5 else ""
        raise ValueError(f"runs: expected trajectories that are ok, given {listed}{more}. {Status(rows.status[bad[0]]).advice}")
    sensitivity, _ = rows.samples(runs)
    n_y = sensitivity.shape[1]
    return PointInformation(runs, sensitivity, np.zeros((len(sensitivity), n_y, n_y)))


def run_samples_at(problem: DesignProblem, runs: Runs, theta: Array, threads: int | None) -> Iterator[tuple[Array, IntArray]]:
    """For each of R sets of parameters (R, p) of the model: rows (S, n_y, p) and statuses (S,) of the samples.

    Kinks and jumps are crossed, as in fits.
    """
    settings: Settings = float(problem.rtol), True, True, "fastest", resolve_threads(threads)
    count, each = len(runs), max(1, MOST_SEGMENTS // runs.dt.size)
    for first in range(0, len(theta), each):
        some = theta[first : first + each]
        many = runs[np.tile(np.arange(count), len(some))]
        rows = run_rows(problem, many, np.repeat(some, count, axis=0), settings)
        for part in range(len(some)):
            own = slice(part * count, (part + 1) * count)
            yield RunRows(rows.sensitivity[own], rows.status[own]).samples(runs)


def run_settings(problem: DesignProblem, threads: int | None) -> Settings:
    """Settings of the trajectories at the prior mean."""
    return float(problem.rtol), check_kinks(problem.kinks), check_jumps(problem.jumps), "fastest", resolve_threads(threads)


def information_matrices(problem: DesignProblem, rows: RunRows) -> Array:
    """F of each run in its sum form, (K, p, p), standardised."""
    white = rows.sensitivity / np.sqrt(np.diag(problem.noise_covariance))[:, None]
    white = white.reshape(len(white), -1, white.shape[3])
    product: Array = white.transpose(0, 2, 1) @ white
    return product
