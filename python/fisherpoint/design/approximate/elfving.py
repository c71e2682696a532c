"""Optimal designs for one function of the parameters, where every point measures one number: Elfving's theorem.

With rows f_i the variance of c^T theta is (sum_i |b_i|)^2 where sum_i b_i f_i = c, with weights |b_i| / sum |b_i|; the best design
has the smallest such sum (Elfving, Ann. Math. Stat. 23, 1952). So a support of few points, down to one, is found exactly, though
its information matrix is singular and other points have almost the same variance: the sum is a linear program over candidates, and
a smooth one over places.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...basics.values import Array

LEAST_SHARE = 1e-7
"""Share of the sum of |b| below which a term is rounding."""

UNNEEDED = 1e-5
"""Share of that sum below which dropping the point is tried after all have moved."""

MISSED = 3e-8
"""Largest relative error of a sum that should be c: what is taken for the range of a singular matrix."""


def smallest_sum(rows: Array, c: Array) -> tuple[Array, Array] | None:
    """b (m,) with sum_i b_i f_i = c and the smallest sum of |b_i|, for rows (m, p), and y (p,) with |f_i y| <= 1 that proves it.

    The sum is c y; None where there are no such b.
    """
    from scipy.optimize import linprog

    size = np.abs(c).max()
    found = linprog(np.ones(2 * len(rows)), A_eq=np.concatenate([rows, -rows]).T, b_eq=c / size, bounds=(0, None), method="highs")
    if found.x is None:
        return None
    b = size * (found.x[: len(rows)] - found.x[len(rows) :])
    y = np.asarray(found.eqlin.marginals, dtype=np.float64)
    return np.where(np.abs(b) > LEAST_SHARE * np.abs(b).sum(), b, 0.0), y


def moved(
    rows_at: Callable[[Array], Array | None], z: Array, b: Array, c: Array, difference: float
) -> tuple[Array, Array, Array] | None:
    """Places in the unit box near given ones, b and rows there, with the smallest sum of |b|; None where c is missed.

    Points that are not needed are left out.

    Parameters
    ----------
    rows_at : callable
        Rows (m, p) at places; None where one is no point.
    z, b : ndarray, (m, d) and (m,)
        Where to begin; the signs of b are kept.
    c : ndarray, (p,)
    difference : float
        Half the distance of central differences.
    """
    from scipy.optimize import least_squares, minimize

    m, d = z.shape
    signs, size = np.sign(b), float(np.abs(c).max())
    scale = float(np.abs(b).sum())

    def parts(x: Array) -> tuple[Array, Array]:
        return x[: m * d].reshape(m, d), scale * x[m * d :]

    def missed(x: Array) -> Array:
        places, of = parts(x)
        rows = rows_at(np.clip(places, 0.0, 1.0))
        return np.full(len(c), 1e3) if rows is None else np.asarray((of @ rows - c) / size)

    def by_all(x: Array) -> Array:
        places, of = parts(x)
        places = np.clip(places, 0.0, 1.0)
        rows, result = rows_at(places), np.zeros((len(c), len(x)))
        if rows is None:
            return result
        for k in range(d):
            low, high = places.copy(), places.copy()
            low[:, k], high[:, k] = np.maximum(low[:, k] - difference, 0.0), np.minimum(high[:, k] + difference, 1.0)
            below, above = rows_at(low), rows_at(high)
            if below is not None and above is not None:
                slope = (above - below) / (high - low)[:, k, None]
                result[:, k : m * d : d] = (of[:, None] * slope).T / size
        result[:, m * d :] = scale * rows.T / size
        return result

    start = np.concatenate([z.ravel(), b / scale])
    if m * (d + 1) <= len(c):  # as many conditions as numbers or more: nothing is left to choose
        x = least_squares(missed, start, jac=by_all, xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=100).x
    else:
        total = np.concatenate([np.zeros(m * d), signs])
        limits = [(0.0, 1.0)] * (m * d) + [(0.0, np.inf) if sign > 0 else (-np.inf, 0.0) for sign in signs]
        x = minimize(  # type: ignore[call-overload]  # the stubs know no mapping of constraints
            lambda x: float(total @ x),
            start,
            jac=lambda x: total,
            bounds=limits,
            constraints=[{"type": "eq", "fun": missed, "jac": by_all}],
            method="SLSQP",
            options={"ftol": 1e-14, "maxiter": 100},
        ).x
    if not np.isfinite(x).all():
        return None
    places, of = parts(x)
    needed = np.abs(of) > UNNEEDED * np.abs(of).sum()
    places, signs = np.clip(places[needed], 0.0, 1.0), signs[needed]
    rows = rows_at(places)
    if rows is None or not len(rows):
        return None
    of = np.asarray(np.linalg.lstsq(rows.T, c, rcond=None)[0], dtype=np.float64)
    if np.linalg.norm(of @ rows - c) > MISSED * np.linalg.norm(c) or (of * signs <= 0).any():
        return None
    return places, of, rows
