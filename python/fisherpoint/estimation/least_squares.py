"""Many nonlinear least-squares problems of one shape, advanced together by Levenberg and Marquardt's method.

Steps are measured by the length of their effect ||J s||: where residuals are in units of the noise, that is in standard errors.
Near a minimum the cost is flat to within its rounding and the integrator's, and steps are then taken without asking it.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ..quantity import Array, IntArray

CONVERGED, LIMIT, STALLED, NOT_EVALUABLE = 0, 1, 2, 3
ENDS = {
    CONVERGED: "converged",
    LIMIT: "not converged within the allowed iterations",
    STALLED: "no further step lowers the residuals",
    NOT_EVALUABLE: "a trajectory at the start is not ok",
}

TOLERANCE = 1e-8
"""Length of a Gauss-Newton step, in standard errors, from which on a problem is solved."""

FLAT = 1e-7
"""Expected decrease, as a share of 1 + the cost, from which on a decrease cannot be told."""

STRIDE = 10.0
"""Longest step of a coordinate, in units of max(1, |z|): past it, where the model is another one, trajectories cost most."""

NEGLIGIBLE = 1e-15
"""Share of the largest curvature, of columns scaled to length 1, up to which a direction is not moved along."""


class Residuals(Protocol):
    def __call__(self, z: Array, rows: NDArray[np.intp]) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Residuals (b, M) and their Jacobian (b, M, P) of the problems `rows` (b,) at z (b, P), and which can be evaluated."""


class Minima(NamedTuple):
    """z (B, P), cost (B,) = half the sum of squares, how each search ended (B,), and the iterations that each took (B,)."""

    z: Array
    cost: Array
    end: IntArray
    iterations: IntArray


def minimise(residuals: Residuals, z0: Array, lower: Array, upper: Array, max_iterations: int = 200) -> Minima:
    """Minimise half the sum of squared residuals of B problems of P coordinates each.

    Parameters
    ----------
    residuals : callable
    z0 : ndarray, (B, P)
        Starts within the bounds.
    lower, upper : ndarray, (P,)
    max_iterations : int

    Returns
    -------
    Minima
    """
    count = len(z0)
    z, everything = z0.copy(), np.arange(count)
    r, jacobian, ok = residuals(z, everything)
    cost, gradient, curvature = _quadratic(r, jacobian)
    damping, growth = np.full(count, 1e-3), np.full(count, 2.0)
    length = np.full(count, np.inf)  # of the last undamped step
    end, iterations = np.where(ok, LIMIT, NOT_EVALUABLE).astype(np.int32), np.zeros(count, dtype=np.int32)
    active = everything[ok]
    for _ in range(max_iterations):
        if not len(active):
            break
        iterations[active] += 1
        g, h = _held(gradient[active], curvature[active], z[active], lower, upper)
        size, values, vectors = _scaled_eigen(h)
        along = np.einsum("bij,bi->bj", vectors, g / size)
        moved = values > NEGLIGIBLE * values[:, -1:]
        squared = np.divide(along**2, values, out=np.zeros_like(along), where=moved)
        newton = np.sqrt(squared.sum(axis=1))
        flat = 0.5 * newton**2 <= FLAT * (1 + cost[active])
        divisor = values + np.where(flat, 0.0, damping[active])[:, None]
        part = np.divide(-along, divisor, out=np.zeros_like(along), where=moved)
        step = np.einsum("bij,bj->bi", vectors, part) / size
        step /= np.max(np.abs(step) / (STRIDE * np.maximum(1.0, np.abs(z[active]))), axis=1, initial=1.0)[:, None]

        done = newton <= TOLERANCE
        # Rounding and the integrator's tolerance end what the formula does not: steps that no longer become shorter.
        done |= flat & (newton >= 0.5 * length[active]) & (newton <= 1e-3)
        length[active] = np.where(flat, newton, np.inf)
        end[active[done]] = CONVERGED
        trial = np.clip(z[active] + step, lower, upper)
        new_r, new_jacobian, ok = residuals(trial, active)
        new_cost, new_gradient, new_curvature = _quadratic(new_r, new_jacobian)
        taken = trial - z[active]
        expected = -(gradient[active] * taken).sum(axis=1) - 0.5 * np.einsum("bi,bij,bj->b", taken, curvature[active], taken)
        gain = np.divide(cost[active] - new_cost, expected, out=np.full(len(active), -1.0), where=expected > 0)
        better = ok & (flat | (gain > 1e-4))
        rows = active[better]
        z[rows], cost[rows] = trial[better], new_cost[better]
        gradient[rows], curvature[rows] = new_gradient[better], new_curvature[better]
        damping[rows] *= np.maximum(0.1, 1 - (2 * np.clip(gain[better], 0.0, 1.0) - 1) ** 3)  # Nielsen's rule
        damping[rows], growth[rows] = np.maximum(damping[rows], 1e-12), 2.0
        worse = active[~better]
        damping[worse] *= growth[worse]
        growth[worse] *= 2.0
        lost = worse[damping[worse] > 1e12]
        end[lost] = np.where(end[lost] == CONVERGED, CONVERGED, STALLED)
        active = active[~done & ~np.isin(active, lost)]
    return Minima(z, cost, end, iterations)


def _quadratic(r: Array, jacobian: Array) -> tuple[Array, Array, Array]:
    """Cost (B,), gradient (B, P) and Gauss-Newton curvature (B, P, P)."""
    transposed = jacobian.transpose(0, 2, 1)
    return 0.5 * np.einsum("bm,bm->b", r, r), (transposed @ r[:, :, None])[:, :, 0], transposed @ jacobian


def _held(g: Array, h: Array, z: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Gradient and curvature without the coordinates that a bound holds."""
    held = ((z <= lower) & (g > 0)) | ((z >= upper) & (g < 0))
    if not held.any():
        return g, h
    g, h = np.where(held, 0.0, g), np.where(held[:, :, None] | held[:, None, :], 0.0, h)
    return g, h


def _scaled_eigen(h: Array) -> tuple[Array, Array, Array]:
    """Lengths of the columns of J (B, P), then eigenvalues and -vectors of the curvature with columns of length 1."""
    size = np.sqrt(np.einsum("bii->bi", h))
    size = np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(h / (size[:, :, None] * size[:, None, :]))
    return size, values, vectors
