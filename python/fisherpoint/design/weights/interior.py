"""The best weights of a few information matrices, by a primal-dual interior point method.

Maximised is log phi(sum_i w_i F_i) over weights that sum to 1. At the optimum tr(G F_i) + s_i = nu with s_i w_i = 0; the method
follows s_i w_i = mu to mu = 0 by Newton steps (Boyd and Vandenberghe, Convex Optimization, 2004, section 11.7). All weights are
positive on the way, so that M is regular also where the optimum is not, as "c" may have it. Where phi is the least of many, by
`inner`, what attains it is moved along with the weights.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...basics.values import Array
from ..goal.criteria import Criterion, Slope
from .interior_criteria import Inner, inner_of, mean_of
from .tuning import WeightsTuning


def best_weights(
    matrices: Array,
    criterion: Criterion,
    gap: float,
    tuning: WeightsTuning = WeightsTuning(),
    between_steps: Callable[[], None] = lambda: None,
) -> tuple[Array, Slope]:
    """Weights (m,) of matrices (m, p, p) with a regular mean, such that max_i tr(G F_i) <= 1 + gap; and the derivatives.

    Where rounding keeps the gap from being reached, the best weights that were met. `between_steps` is called before each step;
    what it raises ends the method.
    """
    w = _multiplied(matrices, criterion, tuning)
    inner = inner_of(criterion, matrices, w)
    g = inner.sensitivity
    nu = 1.1 * float(g.max())
    s = nu - g
    inner.begin(float(w @ s) / len(w))
    best, smallest = (w, inner), np.inf
    idle, since = 0, np.inf  # the gap before the first of the idle steps: small ones add up
    for _ in range(tuning.most_steps):
        between_steps()
        above = inner.gap
        idle, since = (0, above) if above < 0.9 * since else (idle + 1, since)
        if above < smallest:
            best, smallest = (w / w.sum(), inner), above
        if above <= gap or idle > tuning.most_idle_steps:
            break
        mu = tuning.shrinking * (float(w @ s) + inner.products) / (len(w) + inner.pairs)
        step = _newton(inner, w, s, mu)
        if step is None:
            break
        moved = _moved((w, s, nu, inner), step, mu, tuning.boundary_share)
        if moved is None:
            break
        w, s, nu, inner = moved
    return best[0], best[1].slope


def _multiplied(matrices: Array, criterion: Criterion, tuning: WeightsTuning) -> Array:
    """Weights to begin with: multiplications raise phi (Silvey, Titterington and Torsney 1978)."""
    w = np.full(len(matrices), 1.0 / len(matrices))
    for _ in range(tuning.multiplications):
        g = criterion.slope(mean_of(matrices, w), 1.0 / matrices.shape[1]).along(matrices)
        if g.max() < tuning.even_sensitivity:
            break
        w = w * np.sqrt(np.maximum(g, tuning.least_multiplier))
        w = (1 - tuning.spread_share) * w / w.sum() + tuning.spread_share / len(w)
    return w


_Step = tuple[Array, Array, float, tuple[Array | float, ...]]
"""Changes of w and s, the next nu, and what changes beside them."""


def _newton(inner: Inner, w: Array, s: Array, mu: float) -> _Step | None:
    size = np.sqrt(w / s)
    try:
        system, towards, level = inner.newton(mu)
        system = system * np.outer(size, size)
        system[np.diag_indices_from(system)] += 1.0
        sides = np.column_stack([towards + mu / w, np.ones(len(w)), *([] if level is None else [level[0]])]) * size[:, None]
        if not (np.isfinite(system).all() and np.isfinite(sides).all()):
            return None
        found = (np.linalg.solve(system, sides) * size[:, None]).T
        missing, dt = 1.0 - w.sum(), 0.0
        if level is None:
            nu = float(found[0].sum() - missing) / float(found[1].sum())
            dw = found[0] - nu * found[1]
        else:
            v, kappa, c = level
            both = np.array([[found[2].sum(), -found[1].sum()], [v @ found[2] - kappa, -(v @ found[1])]])
            dt, nu = np.linalg.solve(both, [missing - found[0].sum(), c - v @ found[0]]).tolist()
            dw = found[0] + dt * found[2] - nu * found[1]
    except np.linalg.LinAlgError:
        return None
    return dw, mu / w - s - s / w * dw, nu, inner.direction(dw, dt, mu)


def _moved(
    at: tuple[Array, Array, float, Inner], step: _Step, mu: float, boundary_share: float
) -> tuple[Array, Array, float, Inner] | None:
    """The longest step on which all that must be positive stays so and the residuals shrink."""
    (w, s, nu, inner), (dw, ds, new_nu, beside) = at, step
    falling = max(float(np.concatenate([-dw / w, -ds / s]).max()), inner.falling(beside))
    length = min(1.0, boundary_share / max(falling, 1e-300))
    now = _residual(at, mu)
    for _ in range(40):
        new = w + length * dw, s + length * ds, nu + length * (new_nu - nu)
        try:
            reached = *new, inner.moved(new[0], beside, length)
            if _residual(reached, mu) <= (1 - 0.01 * length) * now:
                return reached
        except np.linalg.LinAlgError:
            pass
        length /= 2
    return None


def _residual(at: tuple[Array, Array, float, Inner], mu: float) -> float:
    w, s, nu, inner = at
    own, sums = inner.residuals(mu), (1 - w.sum()) ** 2
    return float(np.sqrt(np.square(inner.sensitivity + s - nu).sum() + np.square(w * s - mu).sum() + sums + np.square(own).sum()))
