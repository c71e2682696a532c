"""Many local ascents of the sensitivity function in a region at once.

Each follows a quasi-Newton direction (BFGS) on the coordinates that no bound stops; of some step lengths the best valid point is
the next. Gradients are central differences of psi(x) = tr(G F(x)), for all ascents in one call of the engine.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from .tuning import RegionTuning

Psi = Callable[[Array], Array]


def ascend(
    psi: Psi, start: Array, difference: float, iterations: int, tuning: RegionTuning = RegionTuning()
) -> tuple[Array, Array]:
    """Local maxima z (S, d) in the unit box, and psi there; `psi` is -inf where there is no valid point.

    Parameters
    ----------
    psi : callable
        Of places (K, d), gives (K,).
    start : ndarray, (S, d)
        Valid places.
    difference : float
        Half the distance over which derivatives are taken.
    iterations : int
    tuning : RegionTuning, optional
    """
    z, value, lengths = start.copy(), psi(start), np.array(tuning.ascent_lengths)
    count, d = z.shape
    inverse = np.broadcast_to(np.eye(d), (count, d, d)).copy()
    gradient = _gradient(psi, z, value, difference)
    active = np.isfinite(value)
    fresh, waited = np.ones(count, dtype=bool), np.zeros(count, dtype=int)
    for _ in range(iterations):
        rows = np.flatnonzero(active)
        if not len(rows):
            break
        step = _directions(z[rows], gradient[rows], inverse[rows])
        size = np.abs(step).max(axis=1)
        longest = np.where(fresh[rows], tuning.first_step, tuning.later_step)
        # A first step has no length of its own; later ones only must not leave the neighbourhood.
        factor = np.where(fresh[rows], longest / np.maximum(size, 1e-300), np.minimum(1.0, longest / np.maximum(size, 1e-300)))
        tried = np.clip(z[rows, None] + lengths[None, :, None] * (step * factor[:, None])[:, None], 0.0, 1.0)
        values = psi(tried.reshape(-1, d)).reshape(len(rows), -1)
        best = values.argmax(axis=1)
        gained = values[np.arange(len(rows)), best] - value[rows]
        better = gained > tuning.ascent_least_gain * np.abs(value[rows])
        moved = rows[better]
        new = tried[np.flatnonzero(better), best[better]]
        change = new - z[moved]
        z[moved], value[moved] = new, values[np.flatnonzero(better), best[better]]
        old = gradient[moved]
        if len(moved):
            gradient[moved] = _gradient(psi, z[moved], value[moved], difference)
            inverse[moved] = _updated(inverse[moved], change, old - gradient[moved], fresh[moved])
            fresh[moved], waited[moved] = False, 0
        stuck = rows[~better]  # once more along the gradient, before the ascent counts as ended
        inverse[stuck] = np.eye(d)
        waited[stuck] += 1
        fresh[stuck] = True
        active[stuck[waited[stuck] > 1]] = False
    return z, value


def newton(psi: Psi, z: Array, difference: float, tuning: RegionTuning = RegionTuning()) -> Array:
    """Places (S, d) after a Newton step to the maximum of psi on the coordinates that no bound stops; psi must not fall."""
    count, d = z.shape
    value = psi(z)
    gradient = _gradient(psi, z, value, difference)
    wide = 10 * difference
    inside = np.clip(z, wide, 1.0 - wide)
    sides = np.stack(
        [_gradient(psi, inside + s * wide * e, psi(inside + s * wide * e), difference) for e in np.eye(d) for s in (1, -1)]
    )
    hessian = np.moveaxis(sides[::2] - sides[1::2], 0, 1) / (2 * wide)
    hessian = (hessian + np.swapaxes(hessian, 1, 2)) / 2
    result = z.copy()
    for k in range(count):
        held = ((z[k] <= 0.0) & (gradient[k] < 0)) | ((z[k] >= 1.0) & (gradient[k] > 0))
        free = np.flatnonzero(~held)
        block = hessian[k][np.ix_(free, free)]
        if len(free) and np.isfinite(block).all() and np.linalg.eigvalsh(block)[-1] < 0:
            step = np.linalg.solve(block, gradient[k][free])
            if np.abs(step).max() <= tuning.longest_newton:
                result[k, free] = np.clip(z[k, free] - step, 0.0, 1.0)
    return np.where((psi(result) >= value - 1e-6 * np.abs(value))[:, None], result, z)


def _gradient(psi: Psi, z: Array, value: Array, difference: float) -> Array:
    """Central differences (S, d), one-sided where a side is outside of the box or not valid."""
    count, d = z.shape
    shifts = difference * np.concatenate([np.eye(d), -np.eye(d)])
    places = np.clip(z[:, None] + shifts, 0.0, 1.0)
    found = psi(places.reshape(-1, d)).reshape(count, 2, d)
    moved = np.moveaxis(places.reshape(count, 2, d, d).diagonal(axis1=2, axis2=3), 1, 1)
    value = np.where(np.isfinite(value), value, np.nan)  # of what is no valid point there is no derivative
    lost = ~np.isfinite(found)
    found, moved = np.where(lost, value[:, None, None], found), np.where(lost, z[:, None, :], moved)
    width = moved[:, 0] - moved[:, 1]
    return np.asarray((found[:, 0] - found[:, 1]) / np.where(width > 0, width, 1.0))


def _directions(z: Array, gradient: Array, inverse: Array) -> Array:
    """Ascent directions (S, d) that are zero where a bound is in the way."""
    held: NDArray[np.bool_] = ((z <= 0.0) & (gradient < 0)) | ((z >= 1.0) & (gradient > 0))
    free = np.where(held, 0.0, gradient)
    step = np.where(held, 0.0, np.einsum("sij,sj->si", inverse, free))
    uphill = (step * free).sum(axis=1) > 1e-12 * np.linalg.norm(step, axis=1) * np.linalg.norm(free, axis=1)
    return np.where(uphill[:, None], step, free)


def _updated(inverse: Array, s: Array, y: Array, fresh: NDArray[np.bool_]) -> Array:
    """BFGS of the inverse Hessian of -psi, where the curvature along the step is positive."""
    d = s.shape[1]
    curvature = (s * y).sum(axis=1)
    good = curvature > 1e-10 * np.linalg.norm(s, axis=1) * np.linalg.norm(y, axis=1)
    safe = np.where(good, curvature, 1.0)
    first = (safe / np.maximum((y * y).sum(axis=1), 1e-300))[:, None, None] * np.eye(d)
    start = np.where((fresh & good)[:, None, None], first, inverse)
    left = np.eye(d) - s[:, :, None] * y[:, None, :] / safe[:, None, None]
    new = left @ start @ np.swapaxes(left, 1, 2) + s[:, :, None] * s[:, None, :] / safe[:, None, None]
    return np.where(good[:, None, None], new, inverse)
