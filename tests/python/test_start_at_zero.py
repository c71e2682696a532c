"""Trajectories that start where every state is zero, with and without a rate there."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fisherpoint as fp


@fp.model(states={"y": "1"}, parameters={"a": "1", "b": "1/s"}, outputs={"y": "1"})
def growth(x, u, p):  # type: ignore[no-untyped-def]
    return [p.b * (p.a - x.y)], [x.y]


@fp.model(states={"x": "m", "v": "m/s"}, inputs={"u": "m/s2"}, parameters={"k": "1/s2", "d": "1/s"}, outputs={"x": "m"})
def oscillator(x, u, p):  # type: ignore[no-untyped-def]
    return [x.v, u.u - p.k * x.x - p.d * x.v], [x.x]


@pytest.mark.filterwarnings("ignore:y. expected its natural size")
@pytest.mark.parametrize("method", ["RK45", "DOP853"])
@pytest.mark.parametrize("a", [15.0, 1e-6, 1e6])
def test_a_rate_from_zero(a: float, method: str) -> None:
    """Whatever the size of the solution next to its scale, 1."""
    b, dt = 0.5, np.array([1e-6, 1e-3, 0.1, 1.0, 10.0])
    points = fp.Experiments(np.zeros((5, 1)), np.zeros((5, 0)), dt)
    done = fp.sensitivities(growth, points, [a, b], rtol=1e-9, method=method)
    assert not done.status.any()
    left = np.exp(-b * dt)
    scale = max(a, 1.0)
    np.testing.assert_allclose(done.y[:, 0], a * (1 - left), rtol=1e-7, atol=1e-8 * scale)
    np.testing.assert_allclose(done.dy_dtheta[:, 0], np.column_stack([1 - left, a * dt * left]), rtol=1e-6, atol=1e-8 * scale)


@pytest.mark.parametrize("method", ["RK45", "DOP853"])
def test_rest_at_zero(method: str) -> None:
    points = fp.Experiments(np.zeros((2, 2)), [[0.0], [1.0]], [2.0, 2.0])
    done = fp.simulate(oscillator, points, [4.0, 0.0], rtol=1e-9, method=method)
    assert not done.status.any()
    np.testing.assert_array_equal(done.x[0], 0.0)
    np.testing.assert_allclose(done.x[1], [(1 - np.cos(4.0)) / 4, np.sin(4.0) / 2], atol=1e-8)


@pytest.mark.parametrize("b", [0.5, 0.6, 0.9, 1.0, 2.3])
def test_a_divisor_that_rises_like_a_root(b: float) -> None:
    """x' = r - V x^b/(K + x^b), whose divisor has no rate at 0 where b < 1: time as an integral over x, which ends at r t."""
    model = fp.SymbolicModel(["r - V*x**b/(K + x**b)"], ["x"], {"x": "1"}, {}, dict.fromkeys("rVKb", "1"), check_units=False)
    theta = np.array([0.7, 0.5, 0.4, b])
    done = fp.sensitivities(model, fp.Experiments([[0.0]], [[]], [1.7]), theta, rtol=1e-10)
    assert done.status[0] == fp.Status.ok

    def end(theta: np.ndarray) -> float:
        r, V, K, b = theta
        # By s = x^(1/3), so that the power is smooth.
        rate = lambda t, s: [(r - V * s[0] ** (3 * b) / (K + s[0] ** (3 * b))) / (3 * max(s[0], 1e-300) ** 2)]  # noqa: E731
        first = 1e-9  # up to here x is r t to 1e-14
        return float(solve_ivp(rate, (first, 1.7), [(r * first) ** (1 / 3)], "DOP853", rtol=1e-12, atol=1e-14).y[0, -1] ** 3)

    assert done.x[0, 0] == pytest.approx(end(theta), abs=1e-7)
    h = 1e-4
    slopes = [(end(theta + e) - end(theta - e)) / (2 * h) for e in h * np.eye(4)]
    np.testing.assert_allclose(done.dx_dtheta[0, 0], slopes, atol=1e-5)
