"""Single changes of a run, with which a search leaves the maximum that gradients have led it to.

log det F of runs has many local maxima, most of them a pulse at another place: from one of them, another one is seldom far.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ...basics.work_clock import OutOfTime
from ...information.run_tangents import RunTangents
from ...points.run_coordinates import RunCoordinates
from .run_objective import RunObjective
from .tuning import RunSearchTuning


def best_moves(
    objective: RunObjective,
    z: Array,
    value: float,
    selected: NDArray[np.bool_] | None,
    others: Array,
    least: float,
    rng: np.random.Generator,
) -> tuple[Array, float]:
    """Free numbers (L, d) after good single changes of each run, one run after the other, and what they are worth; in the time
    that there is.

    A change gains more than `least`. Parts of `others` (K, d), good runs, are among the changes.
    """
    tuning, clock, judged = objective.tuning, objective.clock, objective.judged(objective.tried(z, selected))
    affordable = clock.affordable("tangents", tuning.changes_share) / len(objective.plants)
    at_once = int(min(tuning.changes_at_once, max(tuning.least_changes_at_once, affordable)))
    total, paid = judged.matrices.sum(axis=0) + objective.previous, float(judged.costs.sum())
    for k in range(len(z)):
        own, gains, base = judged.some([k]), 0, _along(objective, z, k, selected)
        left = _in_turn(objective, z[k], rng, others)
        while len(left) and gains < tuning.most_changes_made:
            trial, left = left[:at_once], left[at_once:]
            rows = None if selected is None else np.repeat(selected[k : k + 1], len(trial), axis=0)
            runs = objective.tried(trial, rows)
            try:
                tried = objective.judged(runs) if base.status.any() else objective.judged_beside(base, runs)
            except OutOfTime:
                return z, value
            values = objective.averages(total - own.matrices[0] + tried.matrices) - (paid - own.costs[0] + tried.costs)
            values = np.where(tried.ok, values, -np.inf)
            m = int(np.argmax(values))
            if values[m] > value + least:
                z, value, gains = z.copy(), float(values[m]), gains + 1
                z[k] = trial[m]
                total = total - own.matrices[0] + tried.matrices[m]
                paid += float(tried.costs[m] - own.costs[0])
                own, base = tried.some([m]), _along(objective, z, k, selected)
                left = _in_turn(objective, z[k], rng, others)
    return z, value


def _along(objective: RunObjective, z: Array, k: int, selected: NDArray[np.bool_] | None) -> RunTangents:
    """Tangents of one run, which others continue that are equal up to some segment."""
    run = objective.tried(z[k : k + 1], None if selected is None else selected[k : k + 1])
    return objective.tangents(run.runs, outputs_alone=False)


def _in_turn(objective: RunObjective, z: Array, rng: np.random.Generator, others: Array) -> Array:
    """All changes of a run, in random order."""
    moved = moved_runs(objective.coordinates, z, rng, others, objective.tuning)
    return moved[rng.permutation(len(moved))]


def hopped(objective: RunObjective, z: Array, selected: NDArray[np.bool_] | None, others: Array, rng: np.random.Generator) -> Array:
    """Free numbers (L, d) after some changes of each run, each of them the best of a few."""
    z = z.copy()
    for _ in range(objective.tuning.hop_changes):
        for k in range(len(z)):
            moved = moved_runs(objective.coordinates, z[k], rng, others, objective.tuning)
            designs = np.tile(z, (min(objective.tuning.hop_candidates, len(moved)), 1, 1))
            designs[:, k] = moved[rng.permutation(len(moved))[: len(designs)]]
            if len(designs):
                z = designs[int(np.argmax(objective.values(designs, selected)))]
    return z


def moved_runs(
    coordinates: RunCoordinates,
    z: Array,
    rng: np.random.Generator,
    others: Array | None = None,
    tuning: RunSearchTuning = RunSearchTuning(),
) -> Array:
    """Free numbers (M, d) of runs that differ from z (d,) by one change; what runs share stays.

    Numbers of a profile change one by one, or all of them are drawn anew, or are those of one of `others`.

    A number goes to another value; two segments swap theirs, or a profile is shifted or turned round; a hold takes the value of the
    one beside it; a block of segments gets one value, or is that of one of `others` (K, d).
    """
    moved = _single(coordinates, z, tuning)
    found = [_some(moved, tuning.most_single_changes, rng)]
    for _, where in coordinates.inputs:
        if not coordinates.shared[where].any():
            found += [_swaps(z, where, rng, tuning), _shifts(z, where), _merges(z, where), _blocks(z, where, rng, tuning)]
            if others is not None and len(others):
                found.append(_parts(z, where, others, rng, tuning))
    quiet = coordinates.quiet
    for one in coordinates.signals:
        moved = np.tile(z, (tuning.most_blocks, 1))
        for row in moved:
            anew = others is None or not len(others) or rng.random() < 0.5
            row[one.where] = (
                one.profile.drawn(rng, one.clock, float(quiet[one.where.start]))
                if anew or others is None
                else others[rng.integers(len(others)), one.where]
            )
        found.append(moved)
    return np.concatenate(found)


def _some(moved: Array, most: int, rng: np.random.Generator) -> Array:
    return moved if len(moved) <= most else moved[np.sort(rng.permutation(len(moved))[:most])]


def _single(coordinates: RunCoordinates, z: Array, tuning: RunSearchTuning) -> Array:
    number, values = [], []
    of_profiles = {j for one in coordinates.signals for j in range(one.where.start, one.where.stop)}
    for j, levels in enumerate(coordinates.stepped):
        if not coordinates.shared[j]:
            fine = tuning.grid_values if j not in of_profiles else tuning.grid_values_of_profiles
            grid = np.linspace(0, 1, fine) if levels == 0 else (np.arange(levels) + 0.5) / levels
            number += [j] * len(grid)
            values += grid.tolist()
    moved = np.tile(z, (len(number), 1))
    moved[np.arange(len(number)), number] = values
    return moved


def _swaps(z: Array, where: slice, rng: np.random.Generator, tuning: RunSearchTuning) -> Array:
    a, b = np.triu_indices(where.stop - where.start, 1)
    differ = z[where][a] != z[where][b]
    a, b = a[differ] + where.start, b[differ] + where.start
    moved, rows = np.tile(z, (len(a), 1)), np.arange(len(a))
    moved[rows, a], moved[rows, b] = z[b], z[a]
    return _some(moved, tuning.most_swaps, rng)


def _shifts(z: Array, where: slice) -> Array:
    n = where.stop - where.start
    moved = np.tile(z, (2 * n, 1))
    for k in range(n):
        moved[k, where] = np.roll(z[where], k)
        moved[n + k, where] = np.roll(z[where], k)[::-1]
    return moved[1:]


def _merges(z: Array, where: slice) -> Array:
    values = z[where]
    edges = [0, *(np.flatnonzero(np.diff(values)) + 1).tolist(), len(values)]
    moved = np.tile(z, (2 * (len(edges) - 2), 1))
    for k, (first, between, stop) in enumerate(zip(edges, edges[1:], edges[2:], strict=False)):
        moved[2 * k, where][first:between] = values[between]
        moved[2 * k + 1, where][between:stop] = values[first]
    return moved


def _blocks(z: Array, where: slice, rng: np.random.Generator, tuning: RunSearchTuning) -> Array:
    n = where.stop - where.start
    if n < 4:
        return np.empty((0, len(z)))
    moved = np.tile(z, (tuning.most_blocks, 1))
    for row in moved:
        length = int(np.ceil((n / 2) ** rng.random()))
        first = where.start + rng.integers(n - length + 1)
        row[first : first + length] = rng.integers(0, tuning.grid_values) / (tuning.grid_values - 1)
    return moved


def _parts(z: Array, where: slice, others: Array, rng: np.random.Generator, tuning: RunSearchTuning) -> Array:
    """Copy a block from another run, to its place or elsewhere."""
    n = where.stop - where.start
    moved = np.tile(z, (tuning.most_blocks, 1))
    for row in moved:
        length = int(np.ceil(n ** rng.random()))
        first, source = (where.start + rng.integers(n - length + 1) for _ in range(2))
        row[first : first + length] = others[rng.integers(len(others)), source : source + length]
    return moved
