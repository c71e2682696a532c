"""What no design of some candidates can exceed, for a criterion over the prior.

For weights of candidates M_s = sum_i w_i F_is in scenario s. With any q of those in average.py, for every other mixture N

    average(log det N_s) <= sum_s q_s log det N_s <= sum_s q_s log det M_s + p log(max_i d_i / p),
    d_i = sum_s q_s tr(M_s^-1 F_is),

as log det N <= log det M + p log(tr(M^-1 N) / p) and the logarithm is concave. So all weights and all q give bounds. At the best
weights, and their q, max_i d_i is p: the equivalence theorem. They are approached by the multiplicative algorithm (Silvey,
Titterington and Torsney 1978) on a few candidates at a time, to which those with the largest d_i are added.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ..average import Average

ROUNDS, STEPS, ADDED = 30, 200, 32
"""Times that candidates are added, steps of the weights in each, and candidates that are added."""

TOLERANCE = 0.01
"""By which share max d_i may exceed p."""

LEAST_WEIGHT = 1e-5
"""A candidate with less leaves, but for those that stand first."""


def over_bound(
    rows: Array, known: Array, average: Average, first: int, allowed: Callable[[NDArray[np.intp]], NDArray[np.bool_]]
) -> float | None:
    """The bound of the average of log det M_s + `known`; None where the first candidates do not determine all parameters.

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
        Of candidates that would have a weight, tells which may; the others do not count.
    """
    p = rows.shape[3]
    working = np.arange(first)
    weights, possible = np.full(first, 1 / first), np.ones(rows.shape[1], dtype=bool)
    best = np.inf
    for _ in range(ROUNDS):
        some = rows[:, working]
        for _ in range(STEPS):
            found = _slopes(some, weights, known, average)
            if found is None:
                return None
            weights = weights * found[2] / p
            weights /= weights.sum()
        found = _slopes(some, weights, known, average)
        if found is None:
            return None
        halves, value, _ = found
        along = _along(rows, halves, known)
        added = np.zeros(0, dtype=np.intp)
        while True:  # what may not have a weight does not count
            order = np.argsort(-np.where(possible, along, -np.inf), kind="stable")[:ADDED]
            new = np.setdiff1d(order[possible[order] & (along[order] > p)], working)
            may = allowed(new)
            possible[new[~may]] = False
            added = np.union1d(added, new[may])
            if may.all():
                break
        largest = float(along[possible].max())
        best = min(best, value + p * float(np.log(largest / p)))
        if largest <= p * (1 + TOLERANCE) or not len(added):
            break
        kept = (weights > LEAST_WEIGHT) | (working < first)
        share = np.full(len(added), 0.1 / len(added))
        working = np.concatenate([working[kept], added])
        weights = np.concatenate([0.9 * weights[kept] / weights[kept].sum(), share])
    return best


def _slopes(rows: Array, weights: Array, known: Array, average: Average) -> tuple[Array, float, Array] | None:
    """Y_s (S, p, p) with q_s M_s^-1 = Y_s Y_s^T, sum_s q_s log det M_s, and all d_i; None where an M_s is singular."""
    matrices = np.einsum("k,sknp,sknq->spq", weights, rows, rows, optimize=True) + known
    try:
        factors = np.linalg.cholesky(matrices)
    except np.linalg.LinAlgError:
        return None
    log_dets = 2 * np.log(np.diagonal(factors, axis1=1, axis2=2)).sum(axis=1)
    q = average.softened(log_dets)[1] / len(log_dets)
    inverse = np.linalg.solve(factors, np.broadcast_to(np.eye(rows.shape[3]), factors.shape))
    halves = np.sqrt(q)[:, None, None] * inverse.swapaxes(1, 2)
    return halves, float(q @ log_dets), _along(rows, halves, known)


def _along(rows: Array, halves: Array, known: Array) -> Array:
    """d_i (K,) of candidates."""
    total = np.full(rows.shape[1], float(np.einsum("spq,spr,sqr->", known, halves, halves, optimize=True)))
    for own, half in zip(rows, halves, strict=True):
        product = (own.reshape(-1, own.shape[2]) @ half).reshape(len(own), -1)
        total += np.einsum("ij,ij->i", product, product)
    return total
