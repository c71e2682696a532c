"""What rounded and limited readings cost beyond their mean information: over the prior, outputs lie at many places.

Readings that lie at one place of a step, or past a limit, inform much or little together. So the mean of F^-1 over the prior is
larger than the inverse of the mean F, and it is the mean of F^-1 that errors of estimates show. It is found to first order: at
draws of the unknowns outputs are where their tangents lead, and derivatives stay those at the prior mean.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array
from ..noise.sensors import Sensors
from ..points.points_or_runs import as_runs
from ..prior.rules.sobol import standard_normal
from .nuisance import marginal_rows
from .output_covariance import OutputCovariance, whitened
from .point_information import PointInformation
from .prior_information import parameter_rows
from .problem import DesignProblem
from .run_tangents import run_tangents
from .white_rows import independently

DRAWS = 512
"""Draws of the unknowns."""

FEWEST = 64
"""Draws of the unknowns where there are many readings, whose places differ anyway."""

AT_MOST = 2**21
"""Readings of all draws, as far as `FEWEST` allows."""


def mean_covariance(
    problem: DesignProblem,
    information: PointInformation,
    d: OutputCovariance,
    factor: Array,
    known: Array | None,
    with_prior: bool,
    threads: int | None,
) -> Array:
    """The mean covariance (p, p) of standardised estimates over where the prior has the outputs.

    Parameters
    ----------
    problem : DesignProblem
    information : PointInformation
        The points.
    d : OutputCovariance
        The sensor noise.
    factor : ndarray
        Cholesky factor of the D by which prepared sensitivities are whitened.
    known : ndarray, (k, n_unknowns), optional
        Rows that count beside those of the points.
    with_prior : bool
        Whether the prior's information is among these.
    threads : int or None
    """
    runs, nuisance = as_runs(information.points), problem.n_nuisance
    tangents = run_tangents(problem, runs, problem.theta, problem.integration(threads), outputs_alone=True)
    informative = None
    if information.measured is not None:
        informative = np.zeros(tangents.y.shape, dtype=bool)
        informative[runs.measured] = information.measured

    sensors, own = problem.sensors, parameter_rows(problem)[:, : len(problem.estimated)]
    assert sensors is not None
    of_prior = np.zeros((0, len(own))) if with_prior else own
    scaled = independently(problem, problem.standardised(tangents.dy))
    there = problem.measured & (runs.readings if informative is None else informative)

    def informations() -> Iterator[tuple[Array, Array]]:
        for place in draws(problem.n_unknowns, tangents.y.size):
            sensitivity, _ = tangents.rows(problem, informative, place).samples(runs)
            white = whitened(factor, d.prepare(replace(information, sensitivity=sensitivity)).sensitivity)
            white = white.reshape(-1, problem.n_unknowns)
            white = marginal_rows(white if known is None else np.concatenate([white, known]), nuisance)
            past = past_row(sensors, tangents.y, scaled, there, place)[: len(own)] @ own
            beside = np.concatenate([of_prior, past[None]])
            yield white.T @ white, beside.T @ beside

    return covariance_over(informations(), of_prior.T @ of_prior)


def past_row(sensors: Sensors, y: Array, dy: Array, measured: NDArray[np.bool_], place: Array) -> Array:
    """What plants at a place (n,) of independent standard normal unknowns are known by: that an output is past a limit.

    As a row (n,) whose square is information: of the output that is past it least, in its standard deviations, as the estimate ends
    where that comes back; zeros where none is. From outputs y (..., n_y) and their derivatives (..., n_y, n) at the mean.
    """
    spread = np.linalg.norm(dy, axis=-1)
    known = np.where(measured, sensors.past_limits(y + dy @ place, spread), 0.0)
    most = np.unravel_index(int(np.argmax(known)), known.shape)
    return np.asarray(np.sqrt(known[most]) * dy[most] / (spread[most] or 1.0))


def draws(unknowns: int, readings: int) -> Array:
    """Standard normal unknowns (D, n) for so many readings."""
    count = int(np.clip(AT_MOST // max(readings, 1), FEWEST, DRAWS))
    return standard_normal(unknowns, 1 << (count.bit_length() - 1))


def covariance_over(informations: Iterable[tuple[Array, Array]], of_prior: Array) -> Array:
    """The covariance (p, p) at the mean of informations (p, p), and what it is more in their mean.

    What it is more is found beside the prior's information (p, p), and with each what else is known there: an estimate from
    readings that say nothing is about as far off as the prior allows, and not infinitely.
    """
    count, mean, beside_prior = 0, np.zeros(of_prior.shape), np.zeros(of_prior.shape)
    for one, known in informations:
        count += 1
        mean += one
        beside_prior += _inverse(one + known)
    mean /= count
    return _inverse(mean) + beside_prior / count - _inverse(mean + of_prior)


def _inverse(matrix: Array) -> Array:
    """The inverse of a positive definite matrix, by its Cholesky factor."""
    half = np.linalg.solve(np.linalg.cholesky(matrix), np.eye(len(matrix)))
    return np.asarray(half.T @ half)
