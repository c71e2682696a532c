"""Rows and distances to limits of runs by their free numbers, for the criterion to first order.

Slopes are taken by differences, all of them side by side: second derivatives of trajectories would cost as much. A run whose input
changes in segment n is the same up to there, so it goes on from the state and the sensitivities at its start: half of the segments
need not be computed again.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ...information.run_tangents import RunTangents, tangents_from
from ...points.status import Status
from ..goal.determinant import slopes_of
from .linear_rows import LinearRows
from .run_objective import RunObjective
from .tried_runs import TriedRuns


class _RunParts(NamedTuple):
    """Parts of K runs on R plants: rows (R, K, m, p), distances (R, K, c), and which runs reach their ends on all plants."""

    rows: Array
    distances: Array
    ok: NDArray[np.bool_]


def linear_rows(
    objective: RunObjective, z: Array, selected: NDArray[np.bool_] | None, central: bool, rng: np.random.Generator
) -> LinearRows | None:
    """The criterion to first order around free numbers z (L, d); None where there is none, or no number is free.

    Without `central` differences, slopes cost half as much and are exact to a step only. Where those of all numbers took too much
    memory, they are those of some.
    """
    count = len(z)
    base = objective.tried(z, selected)
    along = objective.tangents(base.runs, outputs_alone=False)
    if along.status.any():
        return None
    # Samples on a clock of their own stay where they are when segments move, up to the last one, also of runs that become shorter.
    counts = None if base.looks is None else base.runs.measured.sum(axis=1)
    samples = int(base.runs.measured.sum(axis=1).max())
    here = _parts(objective, along, base, samples)
    variable = _variables(objective, count, (here.rows.size + here.distances.size) // count, rng)
    run, number = np.nonzero(variable >= 0)
    if not len(run):
        return None
    step = objective.tuning.difference_step / objective.coordinates.steepness(z)[run, number]
    inward = np.where(z[run, number] < 0.5, step, -step)

    def beside(step: Array) -> _RunParts:
        """Parts of runs that each have one number changed by a step."""

        def part(some: slice) -> _RunParts:
            own = run[some]
            moved = z[own]
            moved[np.arange(len(own)), number[some]] += step[some]
            tried = objective.tried(moved, None if selected is None else selected[own], None if counts is None else counts[own])
            many, theta = objective.on_plants(tried.runs)
            lanes = (own[:, None] + count * np.arange(len(objective.plants))).T.ravel()  # of `along`, plant after plant
            settings = objective.settings._replace(threads=1)
            there = tangents_from(objective.problem, along, lanes, many, theta, settings, outputs_alone=not objective.costly)
            return _parts(objective, there, tried, samples)

        parts = objective.in_parts(part, len(run))
        return _RunParts(*(np.concatenate([one[k] for one in parts], axis=0 if k == 2 else 1) for k in range(3)))

    def slopes(first: _RunParts, second: _RunParts, span: Array, both: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Derivatives by the numbers, zero where one of the two sides is missing."""
        found, scale = [], np.divide(1.0, span, out=np.zeros(len(span)), where=both)
        for k in range(2):
            difference = (first[k] - second[k]).swapaxes(0, 1)
            found.append(difference * scale.reshape(-1, *[1] * (difference.ndim - 1)))
        return found[0], found[1]

    at_own = _RunParts(here.rows[:, run], here.distances[:, run], here.ok[run])
    near = beside(inward)
    by_rows, by_distances = slopes(near, at_own, inward, near.ok)
    if central or not near.ok.all():
        outward = np.where((z[run, number] - inward < 0.0) | (z[run, number] - inward > 1.0), 0.0, -inward)
        far = beside(outward)
        better = far.ok & near.ok & (outward != 0.0) if central else far.ok & ~near.ok & (outward != 0.0)
        other = slopes(near, far, inward - outward, better) if central else slopes(far, at_own, outward, better)
        by_rows[better], by_distances[better] = other[0][better], other[1][better]
    rows, row_slopes = _by_few_rows(here.rows, _by_run(by_rows, run, number, z.shape), objective.tuning.many_samples)
    return LinearRows(
        rows,
        row_slopes,
        here.distances,
        _by_run(by_distances, run, number, z.shape),
        objective.previous,
        objective.average,
        objective.kappa,
        variable,
        partial(slopes_of, objective.criteria),
        objective.tuning.ascent,
    )


def _parts(objective: RunObjective, tangents: RunTangents, tried: TriedRuns, samples: int) -> _RunParts:
    """Whitened rows of the samples, and distances where they count."""
    plants = len(objective.plants)
    of_all = tangents.rows(objective.problem)
    places = np.argsort(~tangents.runs.measured, axis=1, kind="stable")[:, :samples]
    sampled = of_all.sensitivity[np.arange(len(places))[:, None], places]
    sampled = np.pad(sampled, [(0, 0), (0, samples - places.shape[1]), (0, 0), (0, 0)])
    rows = sampled / np.sqrt(np.diag(objective.problem.noise_covariance))[:, None]
    count = len(rows) // plants
    distances = objective.distances(tangents, tried) if objective.costly else np.empty((len(rows), 0))
    return _RunParts(
        rows.reshape(plants, count, -1, rows.shape[3]),
        distances.reshape(plants, count, -1),
        (of_all.status.reshape(plants, count) == Status.ok).all(axis=0),
    )


def _by_few_rows(rows: Array, slopes: Array, many: float) -> tuple[Array, Array]:
    """Rows (R, L, m, p) and slopes (L, d, R, m, p) as fewer rows m, where there are many more samples than numbers.

    The information after any step is the same: both are multiplied by the transpose of a matrix with orthonormal columns, in whose
    span they lie.
    """
    (plants, runs, m, p), d = rows.shape, slopes.shape[1]
    if m < many * p * (1 + d):
        return rows, slopes
    columns = np.concatenate([rows[..., None, :], slopes.transpose(2, 0, 3, 1, 4)], axis=3)
    few = np.asarray(np.linalg.qr(columns.reshape(plants, runs, m, (1 + d) * p), mode="r")).reshape(plants, runs, -1, 1 + d, p)
    return np.ascontiguousarray(few[..., 0, :]), np.ascontiguousarray(few[..., 1:, :].transpose(1, 3, 0, 2, 4))


def _variables(objective: RunObjective, count: int, size: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Which variable each number (L, d) is: what runs share is one, the others are their own; -1 of those that stay."""
    free, shared = objective.coordinates.stepped == 0, objective.coordinates.shared
    variable = np.full((count, len(free)), -1, dtype=np.intp)
    common, own = np.flatnonzero(free & shared), np.flatnonzero(free & ~shared)
    variable[:, common] = np.arange(len(common))
    variable[:, own] = len(common) + np.arange(count * len(own)).reshape(count, -1)
    n, most = len(common) + count * len(own), max(1, objective.tuning.most_slopes // max(1, size))
    affordable = objective.clock.affordable("tangents", objective.tuning.slopes_share) / len(objective.plants)
    most = int(min(most, max(objective.tuning.least_slopes, affordable)))
    if n > most:
        kept = np.zeros(n, dtype=bool)
        kept[rng.permutation(n)[:most]] = True
        variable = np.append(np.where(kept, np.cumsum(kept) - 1, -1), -1)[variable]
    return variable


def _by_run(slopes: Array, run: NDArray[np.intp], number: NDArray[np.intp], shape: tuple[int, ...]) -> Array:
    """Slopes by single numbers as (L, d, ...), zero of those that stay."""
    whole = np.zeros((*shape, *slopes.shape[1:]))
    whole[run, number] = slopes
    return whole
