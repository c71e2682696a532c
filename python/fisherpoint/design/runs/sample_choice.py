"""Which samples of runs to take: weights on all instants, then the best few of each run by exchange."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ...points.runs import Runs
from .run_objective import RunObjective


def best_samples(objective: RunObjective, runs: Runs, count: int) -> NDArray[np.bool_]:
    """Which samples of L runs to take.

    Parameters
    ----------
    objective : RunObjective
        What the runs are worth, over R plants.
    runs : Runs
        L runs of N segments, with all samples that may be taken.
    count : int
        How many are taken of each.

    Returns
    -------
    ndarray of bool, (L, N)
        Samples that are measured and taken.
    """
    f = objective.sample_matrices(runs)  # (L, N, R, p, p)
    shape, allowed = f.shape[:2], runs.measured
    weights = _weights(objective, f, allowed, count)
    order = np.argsort(np.where(allowed, -weights, np.inf), axis=1, kind="stable")
    chosen = np.zeros(shape, dtype=bool)
    np.put_along_axis(chosen, order[:, :count], True, axis=1)
    sensors = objective.problem.sensors
    if sensors is not None and not sensors.independent:
        return _exchanged_anew(objective, runs, chosen)
    total = f[chosen].sum(axis=0) + objective.previous
    value = float(objective.averages(total))
    for _ in range(objective.tuning.most_sample_exchanges):
        best, change = value, None
        for run in range(shape[0]):
            inside, outside = np.flatnonzero(chosen[run]), np.flatnonzero(allowed[run] & ~chosen[run])
            if not len(outside):
                continue
            values = objective.averages(total - f[run, inside][:, None] + f[run, outside][None])
            a, b = np.unravel_index(int(np.argmax(values)), values.shape)
            if values[a, b] > best + 1e-9:
                best, change = float(values[a, b]), (run, int(inside[a]), int(outside[b]))
        if change is None:
            break
        run, leaving, entering = change
        value = best
        total = total - f[run, leaving] + f[run, entering]
        chosen[run, leaving], chosen[run, entering] = False, True
    return chosen


def _exchanged_anew(objective: RunObjective, runs: Runs, chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The choice after exchanges, where the noise of samples depends on that of others: F of each choice is computed anew.

    The sample that leaves is the one without which most is left; what enters is the best beside the others.
    """
    tangents, count = objective.tangents(runs), len(runs)
    each = np.stack([objective.chosen_matrices(tangents, run, count, chosen[run : run + 1])[0] for run in range(count)])
    value, run, unchanged = float(objective.averages(each.sum(axis=0) + objective.previous)), 0, 0
    for _ in range(objective.tuning.most_sample_exchanges):
        others = each.sum(axis=0) - each[run] + objective.previous

        def best(flags: NDArray[np.bool_], run: int = run, others: Array = others) -> tuple[float, NDArray[np.bool_], Array]:
            f = objective.chosen_matrices(tangents, run, count, flags)
            values = objective.averages(others + f)
            k = int(np.argmax(values))
            return float(values[k]), flags[k], f[k]

        inside, outside = np.flatnonzero(chosen[run]), np.flatnonzero(runs.measured[run] & ~chosen[run])
        unchanged += 1
        if len(outside):
            _, left, _ = best(chosen[run] & ~np.eye(chosen.shape[1], dtype=bool)[inside])
            found, flags, f = best(left | np.eye(chosen.shape[1], dtype=bool)[outside])
            if found > value + 1e-9:
                value, chosen[run], each[run], unchanged = found, flags, f, 0
        if unchanged == count:
            break
        run = (run + (unchanged > 0)) % count
    return chosen


def _weights(objective: RunObjective, f: Array, allowed: NDArray[np.bool_], count: int) -> Array:
    """Weights (L, N) that sum up to `count` in each run, by the multiplicative algorithm (Titterington 1976).

    With the root of what another criterion than log det F gains: with all of it weights may go to and fro.
    """
    weights = np.where(allowed, count / np.maximum(allowed.sum(axis=1, keepdims=True), 1), 0.0)
    p = f.shape[-1]
    for _ in range(objective.tuning.sample_weight_rounds):
        total = np.einsum("kn,knrij->rij", weights, f) + objective.previous
        ridge = 1e-12 * np.trace(total, axis1=1, axis2=2)[:, None, None] * np.eye(p)
        weights = weights * _gains(objective, f, total + ridge)
        weights *= count / np.maximum(weights.sum(axis=1, keepdims=True), 1e-300)
    return weights


def _gains(objective: RunObjective, f: Array, total: Array) -> Array:
    """Factors (L, N) of the weights of samples, at M (R, p, p) on each plant.

    Where a criterion sees only what is known worst, those of log det F are the better start of an exchange.
    """
    if objective.criteria[0].plain or objective.criteria[0].bounded:
        return np.asarray(np.trace(np.linalg.solve(total, f), axis1=-2, axis2=-1).mean(axis=-1))
    slopes = [
        criterion.objective_slope(matrix, np.eye(len(matrix))) for criterion, matrix in zip(objective.criteria, total, strict=True)
    ]
    gradients, values = np.stack([by for _, by in slopes]), np.array([value for value, _ in slopes])
    along = np.einsum("lnrij,rij,r->ln", f, gradients, objective.average.parts(values) / len(values), optimize=True)
    return np.asarray(np.sqrt(np.maximum(along, 0.0)))
