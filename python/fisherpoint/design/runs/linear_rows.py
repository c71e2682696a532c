"""log det F, or another criterion, of runs or points near given ones: rows and distances to limits to first order, F and costs
exactly from these.

F is the square of rows J, and a cost the square of what a distance to a limit is short of. So the criterion bends by itself where J
and the distances change in proportion to the free numbers, as in the method of Gauss and Newton: its maximum within some distance
is near the true one, much further than along the gradient.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ..goal.determinant import log_det_slopes
from ..goal.scenario_average import Average
from .tuning import AscentTuning


@dataclass(frozen=True, eq=False)
class LinearRows:
    """L runs on R plants to first order in their numbers.

    Parameters
    ----------
    rows : ndarray, (R, L, m, p)
        J, whitened. R plants, or scenarios.
    row_slopes : ndarray, (L, d, R, m, p)
        By the numbers of each run.
    distances : ndarray, (R, L, c)
        To limits, in standard deviations; none where nothing is paid.
    distance_slopes : ndarray, (L, d, R, c)
    previous : ndarray, (R, p, p)
    average : Average
        Over the plants.
    kappa : float
    variable : ndarray of int, (L, d)
        Which variable each number is; runs may share one. -1 of those that stay.
    slopes : callable
        Of matrices F (R, p, p) and rows (R, k, p), the criterion (R,) and its derivatives by F times the rows; None where an F is
        singular.
    tuning : AscentTuning
    """

    rows: Array
    row_slopes: Array
    distances: Array
    distance_slopes: Array
    previous: Array
    average: Average
    kappa: float
    variable: NDArray[np.intp]
    slopes: Callable[[Array, Array], tuple[Array, Array] | None] = log_det_slopes
    tuning: AscentTuning = field(default_factory=AscentTuning)

    def value_and_gradient(self, step: Array) -> tuple[float, Array]:
        """The criterion less costs after a step (n,) of all variables, and its gradient (n,); -inf where F is singular."""
        runs, plants, m, p = *self.rows.shape[1::-1], *self.rows.shape[2:]
        of_runs = np.append(step, 0.0)[self.variable]  # (L, d)
        slopes = self.row_slopes.reshape(runs, -1, plants * m * p)
        rows = _sum(of_runs, slopes).reshape(runs, plants, m, p).swapaxes(0, 1) + self.rows
        rows = rows.reshape(plants, runs * m, p)
        f = rows.swapaxes(1, 2) @ rows + self.previous
        found = self.slopes(f, rows)
        if found is None:
            return -np.inf, np.zeros(len(step))
        value, parts = self.average.softened(found[0])
        by_rows = (2 / plants * parts)[:, None, None] * found[1]
        by_rows = by_rows.reshape(plants, runs, m, p).swapaxes(0, 1).reshape(runs, -1)
        gradient = _products(slopes, by_rows)
        if self.distances.size:
            slopes = self.distance_slopes.reshape(runs, -1, plants * self.distances.shape[2])
            there = _sum(of_runs, slopes).reshape(runs, plants, -1).swapaxes(0, 1) + self.distances
            short = np.maximum(0.0, self.kappa - there)
            cost = self.tuning.distance_cost
            value -= cost / plants * float(np.square(short).sum())
            gradient = gradient + 2 * cost / plants * _products(slopes, short.swapaxes(0, 1).reshape(runs, -1))
        moving = self.variable >= 0
        return value, np.asarray(np.bincount(self.variable[moving], gradient[moving], len(step)), dtype=np.float64)

    def best_step(self, lower: Array, upper: Array, late: Callable[[], bool] | None = None) -> Array:
        """The step (n,) between bounds, zero among them, after which the criterion is about largest, to first order.

        Where it is `late`, the best so far.

        By a projected quasi-Newton method (limited-memory BFGS in the numbers that are free to move; Nocedal and Wright, Numerical
        Optimization, sections 7.2 and 16.7).
        """
        tuning, step = self.tuning, np.zeros(len(lower))
        value, slope = self.value_and_gradient(step)
        first = value
        pairs: deque[tuple[Array, Array]] = deque(maxlen=tuning.linear_pairs)
        for _ in range(tuning.linear_iterations):
            free = ~(((step <= lower) & (slope < 0.0)) | ((step >= upper) & (slope > 0.0)))
            if not slope[free].any() or (late is not None and late()):
                break
            direction = _quasi_newton(np.where(free, slope, 0.0), free, pairs)
            if not pairs:
                direction *= np.max(upper - lower) / np.max(np.abs(direction))
            for length in 4.0 ** -np.arange(tuning.linear_halvings):
                tried = np.clip(step + length * direction, lower, upper)
                there, slope_there = self.value_and_gradient(tried)
                if there > value + tuning.linear_slope_share * slope @ (tried - step):
                    break
            else:
                if not pairs:
                    break
                pairs.clear()  # once more along the gradient
                continue
            gain = there - value
            pairs.append((tried - step, slope - slope_there))
            step, value, slope = tried, there, slope_there
            if gain < tuning.linear_least_gain * (value - first):
                break
        return step

    def within(self, reach: float) -> LinearRows:
        """Return the rows without the distances that no step by less than `reach` makes too short."""
        least = self.distances - reach * np.abs(self.distance_slopes).sum(axis=1).swapaxes(0, 1)
        near = (least < self.kappa).any(axis=(0, 1))
        return LinearRows(
            self.rows,
            self.row_slopes,
            np.ascontiguousarray(self.distances[..., near]),
            np.ascontiguousarray(self.distance_slopes[..., near]),
            self.previous,
            self.average,
            self.kappa,
            self.variable,
            self.slopes,
            self.tuning,
        )


def _quasi_newton(slope: Array, free: NDArray[np.bool_], pairs: Iterable[tuple[Array, Array]]) -> Array:
    """The direction of an ascent, by changes of place and of slope so far."""
    bent = [(s * free, y * free) for s, y in pairs]
    bent = [(s, y) for s, y in bent if s @ y > 1e-10 * np.sqrt((s @ s) * (y @ y))]
    direction, parts = slope.copy(), []
    if not bent:
        return direction
    for s, y in reversed(bent):
        part = (s @ direction) / (s @ y)
        direction -= part * y
        parts.append(part)
    s, y = bent[-1]
    direction *= (s @ y) / (y @ y)
    for (s, y), part in zip(bent, reversed(parts), strict=True):
        direction += (part - (y @ direction) / (s @ y)) * s
    return direction


# Many small products, on threads of this project's own: BLAS would start threads for each.
def _sum(weights: Array, of: Array) -> Array:
    """Sum over d of (L, d, x), with weights (L, d)."""
    return np.asarray(np.einsum("ld,ldx->lx", weights, of))


def _products(of: Array, by: Array) -> Array:
    """Products over x of (L, d, x) with (L, x)."""
    return np.asarray(np.einsum("ldx,lx->ld", of, by))
