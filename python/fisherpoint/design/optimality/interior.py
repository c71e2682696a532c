"""The best weights of a few information matrices, by a primal-dual interior point method.

Maximised is log phi(sum_i w_i F_i) over weights that sum to 1. At the optimum tr(G F_i) + s_i = nu with s_i w_i = 0; the method
follows s_i w_i = mu to mu = 0 by Newton steps (Boyd and Vandenberghe, Convex Optimization, 2004, section 11.7). All weights are
positive on the way, so that M is regular also where the optimum is not, as "c" may have it.
"""

from __future__ import annotations

import numpy as np

from ...basics.values import Array
from .criteria import Criterion, Slope

MOST_STEPS, MOST_IDLE = 200, 20
"""Steps, and steps in a row in which the gap does not fall by a tenth, after which double precision has no more."""

MULTIPLIED, EVEN, LEAST = 30, 1.5, 1e-4
"""Multiplications of the weights before the first step, the sensitivity from which on there are none, and the least factor squared.

Newton steps from equal weights are short where a few matrices are far larger than the others.
"""

TO_THE_BOUNDARY = 0.99
SHRINKING = 0.1
"""Of mu in each step."""


def best_weights(matrices: Array, criterion: Criterion, gap: float) -> tuple[Array, Slope]:
    """Weights (m,) of matrices (m, p, p), of which the mean must be regular, until max_i tr(G F_i) <= 1 + gap; and the derivatives.

    Where rounding keeps the gap from being reached, the best weights that were met.
    """
    m = len(matrices)
    w = np.full(m, 1.0 / m)
    slope = criterion.slope(mean_of(matrices, w), 1.0 / matrices.shape[1])
    g = slope.along(matrices)
    for _ in range(MULTIPLIED):  # which raise phi (Silvey, Titterington and Torsney 1978)
        if g.max() < EVEN:
            break
        w = w * np.sqrt(np.maximum(g, LEAST))
        w = w / w.sum()
        slope = criterion.slope(mean_of(matrices, w), 1.0 / matrices.shape[1])
        g = slope.along(matrices)
    nu = 1.1 * float(g.max())
    s = nu - g
    mu = float(w @ s) / m
    best, smallest = (w, slope), np.inf
    idle, since = 0, np.inf  # the gap before the first of the idle steps: small ones add up
    for _ in range(MOST_STEPS):
        above = float(g.max()) - 1.0
        idle, since = (0, above) if above < 0.9 * since else (idle + 1, since)
        if above < smallest:
            best, smallest = (w / w.sum(), slope), above
        if above <= gap or idle > MOST_IDLE:
            break
        if not criterion.kinked:
            mu = SHRINKING * float(w @ s) / m
        elif float(np.abs(g + s - nu).max()) <= m * mu:  # what is smoothed changes with mu: it waits until the last one is done
            mu *= SHRINKING
        share = m * mu / matrices.shape[1]
        if criterion.kinked:
            slope = criterion.slope(mean_of(matrices, w), share)
            g = slope.along(matrices)
        step = _newton(slope, matrices, g, w, s, mu)
        if step is None:
            break
        moved = _moved(criterion, matrices, (w, s, nu), step, (mu, share), g, slope)
        if moved is None:
            break
        w, s, nu, slope = moved
        if criterion.kinked:  # in units of its own value
            slope = criterion.slope(mean_of(matrices, w), share)
        g = slope.along(matrices)
    return best


def mean_of(matrices: Array, weights: Array) -> Array:
    """sum_i w_i F_i, (p, p)."""
    return np.asarray(np.tensordot(weights, matrices, axes=1))


def _newton(slope: Slope, matrices: Array, g: Array, w: Array, s: Array, mu: float) -> tuple[Array, Array, float] | None:
    size = np.sqrt(w / s)
    system = -slope.curvature(matrices) * np.outer(size, size)
    system[np.diag_indices_from(system)] += 1.0
    sides = np.column_stack([g + mu / w, np.ones(len(w))]) * size[:, None]
    if not (np.isfinite(system).all() and np.isfinite(sides).all()):
        return None
    with_g, with_one = (np.linalg.solve(system, sides) * size[:, None]).T
    nu = float(with_g.sum() - (1.0 - w.sum())) / float(with_one.sum())
    dw = with_g - nu * with_one
    return dw, mu / w - s - s / w * dw, nu


def _moved(
    criterion: Criterion,
    matrices: Array,
    at: tuple[Array, Array, float],
    step: tuple[Array, Array, float],
    towards: tuple[float, float],
    g: Array,
    slope_now: Slope,
) -> tuple[Array, Array, float, Slope] | None:
    """The longest step on which weights and s stay positive and the residuals shrink."""
    (w, s, nu), (dw, ds, new_nu), (mu, share) = at, step, towards
    falling = np.concatenate([-dw / w, -ds / s]).max()
    length = min(1.0, TO_THE_BOUNDARY / max(falling, 1e-300))
    now = _merit(slope_now, g, at, mu)
    for _ in range(40):
        new = w + length * dw, s + length * ds, nu + length * (new_nu - nu)
        try:
            slope = criterion.slope(mean_of(matrices, new[0]), share, slope_now.size)
        except np.linalg.LinAlgError:
            length /= 2
            continue
        merit = _merit(slope, slope.along(matrices), new, mu)
        if merit <= (now if criterion.kinked else (1 - 0.01 * length) * now):
            return *new, slope
        length /= 2
    return None


def _merit(slope: Slope, g: Array, at: tuple[Array, Array, float], mu: float) -> float:
    """What falls from step to step: the residuals, or of what is smoothed the function itself with its barrier."""
    w, s, nu = at
    if slope.criterion.kinked:
        return -slope.smooth - mu * float(np.log(w).sum())
    return _residual(g, w, s, nu, mu)


def _residual(g: Array, w: Array, s: Array, nu: float, mu: float) -> float:
    return float(np.sqrt(np.square(g + s - nu).sum() + np.square(w * s - mu).sum() + (1 - w.sum()) ** 2))
