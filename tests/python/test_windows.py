"""A published problem with windows of continuous measurements, solved with trajectories of the engine."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bench.windows import LEVELS, MOST, PUBLISHED, X_WINDOWS, best_shares, model, plan_from, trace_of_inverse, windows_of


def test_the_information_of_windows_is_that_of_an_independent_integration() -> None:
    u = np.random.default_rng(0).random(LEVELS)

    def rates(t: float, z: np.ndarray) -> list[float]:
        x, y, xa, xb, ya, yb = z[:6]
        w = u[min(int(t / 0.25), LEVELS - 1)]
        jacobian = np.array([[1 - y - 0.4 * w, -x], [y, -1 + x - 0.2 * w]])
        tangents = jacobian @ np.array([[xa, xb], [ya, yb]]) + np.array([[-x * y, 0], [0, x * y]])
        return [x - x * y - 0.4 * w * x, -y + x * y - 0.2 * w * y, *tangents.ravel(), xa * xb, yb * yb]

    z = np.array([0.5, 0.7, 0, 0, 0, 0, 0, 0])
    for k in range(LEVELS):
        z = solve_ivp(rates, (k / 4, k / 4 + 0.25 - 1e-12), z, rtol=1e-10, atol=1e-12).y[:, -1]
    windows = windows_of(model(), u[None])[0]
    assert windows[:X_WINDOWS, 1].sum() == pytest.approx(z[6], rel=1e-7)
    assert windows[X_WINDOWS:, 2].sum() == pytest.approx(z[7], rel=1e-7)


def test_the_shares_of_windows_are_the_best() -> None:
    rng = np.random.default_rng(1)
    windows = windows_of(model(), rng.random((1, LEVELS)))[0]
    shares, gap = best_shares(windows)
    value = float(trace_of_inverse(shares @ windows))
    assert gap <= 1e-9 * value and shares.min() >= 0 and shares.max() <= 1
    assert shares[:X_WINDOWS].sum() == pytest.approx(MOST["x"]) and shares[X_WINDOWS:].sum() == pytest.approx(MOST["y"])
    for _ in range(50):
        other = np.zeros(len(shares))
        other[rng.permutation(X_WINDOWS)[:8]] = 1
        other[X_WINDOWS + rng.permutation(80)[:26]] = 1
        assert float(trace_of_inverse(other @ windows)) >= value


def test_the_published_value_is_reached() -> None:
    start = (np.arange(LEVELS) // 6 % 2).astype(float)
    plan = plan_from(model(), start)
    assert plan.value <= PUBLISHED and plan.value == pytest.approx(PUBLISHED, rel=1e-6)
