"""Upper bound of the designs of some candidates, for a criterion over the prior.

For weights of candidates M_s = sum_i w_i F_is in scenario s, with G_s the derivative of log phi there. With any q of those in
average.py, for every other mixture N

    average(log phi(N_s)) <= sum_s q_s log phi(N_s) <= sum_s q_s log phi(M_s) + log max_i d_i,    d_i = sum_s q_s tr(G_s F_is),

as phi(N) <= phi(M) tr(G N) (criteria.py) and the logarithm is concave. For log det F, log phi is a p-th of it and G = M^-1 / p. So
all weights and all q give bounds. At the best weights, and their q, max_i d_i is 1: the equivalence theorem. They are approached by
the multiplicative algorithm (Silvey, Titterington and Torsney 1978) on a few candidates at a time, to which those with the largest
d_i are added.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ..average import Average
from ..optimality.criteria import Criterion

ROUNDS, STEPS, ADDED = 30, 200, 32
"""Rounds that add candidates, steps of the weights in each round, and candidates that each adds."""

TOLERANCE = 0.01
"""Relative amount by which max d_i may exceed 1."""

POWER = 0.5
"""Exponent of the factors d_i of the weights for criteria other than log det F: with 1 the weights may oscillate."""

SMOOTH = 0.02
"""Smoothing of a criterion with kinks, as a share of its value."""

LEAST_WEIGHT = 1e-5
"""A candidate with less leaves, but for those that stand first."""


def over_bound(
    rows: Array,
    known: Array,
    average: Average,
    first: int,
    allowed: Callable[[NDArray[np.intp]], NDArray[np.bool_]],
    criteria: Sequence[Criterion],
) -> float | None:
    """The bound of the objective at M_s + `known`; None where the first candidates do not determine the criterion.

    Parameters
    ----------
    rows : ndarray, (S, K, n, p)
        Whitened rows of all candidates in each scenario.
    known : ndarray, (S, p, p)
        Information that is there whatever the weights are.
    average : Average
    first : int
        Candidates to begin with: the first so many, which may have weights.
    allowed : callable
        Takes candidates that would have a weight and returns which of them may; the others do not count.
    criteria : sequence of Criterion
        In each scenario.
    """
    level, power = criteria[0].level, 1.0 if criteria[0].plain else POWER
    working = np.arange(first)
    weights, possible = np.full(first, 1 / first), np.ones(rows.shape[1], dtype=bool)
    best = np.inf
    for _ in range(ROUNDS):
        some = rows[:, working]
        for _ in range(STEPS):
            found = _slopes(some, weights, known, average, criteria)
            if found is None:
                return None
            weights = weights * found[2] ** power
            weights /= weights.sum()
        found = _slopes(some, weights, known, average, criteria)
        if found is None:
            return None
        halves, value, _ = found
        along = _along(rows, halves, known)
        added = np.zeros(0, dtype=np.intp)
        while True:  # what may not have a weight does not count
            order = np.argsort(-np.where(possible, along, -np.inf), kind="stable")[:ADDED]
            new = np.setdiff1d(order[possible[order] & (along[order] > 1)], working)
            may = allowed(new)
            possible[new[~may]] = False
            added = np.union1d(added, new[may])
            if may.all():
                break
        largest = float(along[possible].max())
        best = min(best, level * (value + float(np.log(largest))))
        if largest <= 1 + TOLERANCE or not len(added):
            break
        kept = (weights > LEAST_WEIGHT) | (working < first)
        share = np.full(len(added), 0.1 / len(added))
        working = np.concatenate([working[kept], added])
        weights = np.concatenate([0.9 * weights[kept] / weights[kept].sum(), share])
    return best


def _slopes(
    rows: Array, weights: Array, known: Array, average: Average, criteria: Sequence[Criterion]
) -> tuple[Array, float, Array] | None:
    """Y_s (S, p, r) with q_s G_s = Y_s Y_s^T, sum_s q_s log phi(M_s), and all d_i; None where an M_s is singular."""
    matrices = np.einsum("k,sknp,sknq->spq", weights, rows, rows, optimize=True) + known
    try:
        slopes = [criterion.slope(matrix, SMOOTH) for criterion, matrix in zip(criteria, matrices, strict=True)]
    except np.linalg.LinAlgError:
        return None
    values = np.array([slope.log_phi for slope in slopes])
    q = average.softened(criteria[0].level * values)[1] / len(values)
    halves = np.sqrt(q)[:, None, None] * np.stack([slope.half for slope in slopes])
    return halves, float(q @ values), _along(rows, halves, known)


def _along(rows: Array, halves: Array, known: Array) -> Array:
    """d_i (K,) of candidates."""
    total = np.full(rows.shape[1], float(np.einsum("spq,spr,sqr->", known, halves, halves, optimize=True)))
    for own, half in zip(rows, halves, strict=True):
        product = (own.reshape(-1, own.shape[2]) @ half).reshape(len(own), -1)
        total += np.einsum("ij,ij->i", product, product)
    return total
