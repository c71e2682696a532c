"""Trajectories that cross a kink and come back over it within what would be one step, against integrals in closed form."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

import fisherpoint as fp

pytestmark = pytest.mark.kernels
TOLERANCES = (1e-4, 1e-6, 1e-8)


@pytest.mark.parametrize("method", ["RK45", "DOP853"])
@pytest.mark.parametrize("rtol", TOLERANCES)
def test_an_oscillator_that_rises_over_an_edge_and_falls_back(rtol: float, method: str) -> None:
    model = fp.SymbolicModel(
        ["k * max(s - a, 0)", "3 * c", "-3 * s"], ["x"], {"x": "1", "s": "1", "c": "1"}, {}, {"k": "1", "a": "1"}
    )
    a = np.linspace(0.02, 0.985, 200)
    points = fp.Experiments(np.tile([0.0, 0.0, 1.0], (200, 1)), np.zeros((200, 0)), np.ones(200))
    result = fp.simulate(model, points, np.column_stack([np.ones(200), a]), rtol=rtol, method=method)
    assert (result.status == fp.Status.ok).all()
    # Above a the sine runs from t = asin(a) / 3 to (pi - asin(a)) / 3, or to the end.
    first, last = np.arcsin(a) / 3, np.minimum((np.pi - np.arcsin(a)) / 3, 1.0)
    truth = (np.cos(3 * first) - np.cos(3 * last)) / 3 - a * (last - first)
    np.testing.assert_allclose(result.y[:, 0], truth, rtol=0, atol=10 * rtol)


@pytest.mark.parametrize("rtol", TOLERANCES)
def test_a_bump_that_a_step_could_jump_over(rtol: float) -> None:
    model = fp.SymbolicModel(["1.0", "p * max(1 - (a - 5)**2, 0)"], ["x"], {"a": "1", "x": "1"}, {}, {"p": "1"})
    starts = np.column_stack([np.random.default_rng(0).uniform(-1, 3, 500), np.zeros(500)])
    result = fp.sensitivities(model, fp.Experiments(starts, np.zeros((500, 0)), np.full(500, 10.0)), {"p": 1.0}, rtol=rtol)
    assert (result.status == fp.Status.ok).all()
    np.testing.assert_allclose(result.y[:, 0], 4 / 3, rtol=0, atol=10 * rtol)
    np.testing.assert_allclose(result.dy_dtheta[:, 0, 0], 4 / 3, rtol=10 * rtol)


@pytest.mark.parametrize("edge", [-1e-7, 0.0, 1e-7])
def test_a_kink_that_is_only_touched(edge: float) -> None:
    """h = (a - 5)^2 + edge comes next to zero, touches it, or dips below it for a moment."""
    model = fp.SymbolicModel(
        ["1.0", "p * max((a - 5)**2 + c, 0)"], ["x"], {"a": "1", "x": "1"}, {}, {"p": "1"}, constants={"c": (edge, "1")}
    )
    starts = np.column_stack([np.linspace(0.0, 3.0, 100), np.zeros(100)])
    result = fp.simulate(model, fp.Experiments(starts, np.zeros((100, 0)), np.full(100, 4.0)), {"p": 1.0})
    crosses = starts[:, 0] + 4.0 > 5.0
    assert (result.status[crosses] == fp.Status.ok).all()
    truth = [
        quad(lambda a: max((a - 5) ** 2 + edge, 0.0), a0, a0 + 4.0, points=[5.0], epsabs=1e-12)[0] for a0 in starts[crosses, 0]
    ]
    np.testing.assert_allclose(result.y[crosses, 0], truth, rtol=0, atol=1e-5)


def test_rest_on_a_kink_within_rounding() -> None:
    """The level settles at the edge of the overflow, where its distance from the edge is nothing but rounding."""
    model = fp.SymbolicModel(
        ["u - k * sqrt(h) - w * max(h - a, 0)"], ["h"], {"h": "m"}, {"u": "1"}, {"k": "1", "w": "1"}, constants={"a": (0.7, "m")}
    )
    points = fp.Experiments(np.linspace(0.1, 2.0, 200)[:, None], np.full((200, 1), np.sqrt(0.7)), np.full(200, 60.0))
    result = fp.simulate(model, points, {"k": 1.0, "w": 50.0})
    assert (result.status == fp.Status.ok).all()
    np.testing.assert_allclose(result.y[:, 0], 0.7, atol=1e-5)


def test_a_record_that_swings_over_a_kink() -> None:
    model = fp.SymbolicModel(["v", "-9 * (x - c)", "abs(x - 0.5)"], ["z"], {"x": "1", "v": "1", "z": "1"}, {}, {"c": "1"})
    for centre in np.linspace(0.3, 0.7, 21):
        t = np.linspace(0.0, 10.0, 26)
        record = fp.simulate_record(model, t, np.zeros((26, 0)), {"c": centre}, (centre + 0.4, 0.0, 0.0), rtol=1e-6)
        assert record.status == fp.Status.ok
        inner = np.concatenate([[0.0], np.cumsum([_swing(centre, a, b) for a, b in pairwise(t)])])
        np.testing.assert_allclose(record.y[:, 0], inner, atol=1e-4)


def _swing(centre: float, begin: float, end: float) -> float:
    return float(quad(lambda t: abs(centre + 0.4 * np.cos(3 * t) - 0.5), begin, end, limit=200, epsabs=1e-9)[0])


@pytest.mark.parametrize("method", ["RK45", "DOP853"])
@pytest.mark.parametrize("rtol", TOLERANCES)
def test_a_power_behind_an_edge(rtol: float, method: str) -> None:
    """From an edge on, f rises like t^1.5: the embedded error of order 5(4) is a tenth of the error, or of the other sign."""
    duration, c = 6.934e-3, np.linspace(1e-4, 5e-3, 200)
    points = fp.Experiments(np.tile([0.0, -1.43], (200, 1)), np.zeros((200, 0)), np.full(200, duration))
    model = fp.SymbolicModel(
        ["1000.0", "-100 * (x - p) + 1000 * max(a - 1000 * c, 0)**1.5"], ["x"], {"a": "1", "x": "1"}, {}, {"p": "1", "c": "1"}
    )
    result = fp.simulate(model, points, np.column_stack([np.full(200, 0.8732), c]), rtol=rtol, method=method)
    assert (result.status == fp.Status.ok).all()
    expected = 0.8732 - 2.3032 * np.exp(-100 * duration)
    truth = [expected + 1e3**2.5 * quad(lambda s, c=c: s**1.5 * np.exp(-100 * (duration - c - s)), 0, duration - c)[0] for c in c]
    np.testing.assert_allclose(result.y[:, 0], truth, rtol=0, atol=60 * rtol)


def test_a_bump_behind_the_edge_that_a_trajectory_starts_on() -> None:
    """Of states far below their natural sizes, where the first step spans the bump."""
    size = ("1", 1e4)
    model = fp.SymbolicModel(["1.0", "-1.0", "max(c * max(s - a, 0), 0)"], ["x"], {"s": size, "c": size, "x": size}, {}, {"a": "1"})
    a = np.linspace(0.05, 0.9, 200)
    points = fp.Experiments(np.column_stack([a, 1 - a, 0 * a]), np.zeros((200, 0)), np.full(200, 1.5))
    result = fp.simulate(model, points, a[:, None], rtol=1e-4)
    np.testing.assert_allclose(result.y[:, 0], (1 - a) ** 3 / 6, rtol=0, atol=1e-6)


@pytest.mark.parametrize("method", ["RK45", "DOP853"])
@pytest.mark.parametrize("rtol", TOLERANCES)
def test_a_bump_from_rest_on_an_edge_that_ends_on_another(rtol: float, method: str) -> None:
    """c max(s - a, 0) rests at zero up to s = a, and is zero again at c = 0: between, a step has no sign of it at either end."""
    model = fp.SymbolicModel(["1.0", "-1.0", "max(c * max(s - a, 0), 0)"], ["x"], {"s": "1", "c": "1", "x": "1"}, {}, {"a": "1"})
    a = np.linspace(0.05, 0.9, 200)
    points = fp.Experiments(np.tile([0.0, 1.0, 0.0], (200, 1)), np.zeros((200, 0)), np.full(200, 1.5))
    result = fp.sensitivities(model, points, a[:, None], rtol=rtol, method=method)
    assert (result.status == fp.Status.ok).all()
    np.testing.assert_allclose(result.y[:, 0], (1 - a) ** 3 / 6, rtol=0, atol=10 * rtol)
    np.testing.assert_allclose(result.dy_dtheta[:, 0, 0], -((1 - a) ** 2) / 2, rtol=0, atol=10 * rtol)
