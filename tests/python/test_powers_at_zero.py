"""Powers above 1 of a state that is zero: their derivative there is zero, however the power is calculated."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fisherpoint as fp

pytestmark = pytest.mark.kernels

EXPONENTS = (1.5, 2.5, 1.25, 3.5)


def decay(rate: str, *parameters: str) -> fp.SymbolicModel:
    """An amount b that is used up, and its integral z."""
    return fp.SymbolicModel(
        f=[rate, "b"], g=["b", "z"], states={"b": "1", "z": "1"}, inputs={}, parameters=dict.fromkeys(parameters, "1"),
        outputs={"b": "1", "z": "1"}, check_units=False,
    )  # fmt: skip


def at(b: float, t: float) -> fp.Experiments:
    return fp.Experiments([[b, 0.0]], np.empty((1, 0)), [t])


@pytest.mark.parametrize("e", EXPONENTS)
@pytest.mark.parametrize("rate", ["-k*b**{e}", "-(k*b)**{e}", "-k*b*b**({e} - 1)", "-k*b**{e} - b/2"])
def test_rest_at_zero_has_no_derivative(rate: str, e: float) -> None:
    done = fp.sensitivities(decay(rate.format(e=e), "k"), at(0.0, 2.0), [0.7], rtol=1e-8)
    assert str(done.statuses[0]) == "ok"
    assert not done.y.any() and not done.dy_dtheta.any()


@pytest.mark.parametrize("e", EXPONENTS)
def test_a_rise_from_zero(e: float) -> None:
    """b' = q - k b**e from b = 0."""

    def right(q: float, k: float) -> float:
        done = solve_ivp(lambda _, b: q - k * abs(b) ** e, (0, 2), [0.0], "DOP853", rtol=1e-12, atol=1e-14)
        return float(done.y[0, -1])

    q, k, h = 0.8, 0.7, 1e-5
    done = fp.sensitivities(decay(f"q - k*b**{e}", "q", "k"), at(0.0, 2.0), [q, k], rtol=1e-9)
    slopes = [(right(q + h, k) - right(q - h, k)) / (2 * h), (right(q, k + h) - right(q, k - h)) / (2 * h)]
    assert str(done.statuses[0]) == "ok"
    assert done.y[0, 0] == pytest.approx(right(q, k), abs=1e-8)
    np.testing.assert_allclose(done.dy_dtheta[0, 0], slopes, atol=1e-7)


def test_it_rises_from_a_rest_at_its_limit() -> None:
    """Nothing flows until t = 1; what comes then makes b rise like a parabola from 0, where b**1.5 ends to have a value."""
    model = fp.SymbolicModel(
        f=["1", "q*max(t - 1, 0) - k*b**1.5"], g=["b"], states={"t": "1", "b": "1"}, inputs={}, parameters={"q": "1", "k": "1"},
        outputs={"b": "1"}, check_units=False,
    )  # fmt: skip
    right = solve_ivp(lambda t, b: 0.5 * (t - 1) - abs(b) ** 1.5, (1, 3), [0.0], "DOP853", rtol=1e-12, atol=1e-14).y[0, -1]
    done = fp.simulate(model, at(0.0, 3.0), [0.5, 1.0], rtol=1e-9)
    assert str(done.statuses[0]) == "ok"
    assert done.y[0, 0] == pytest.approx(right, abs=1e-8)


@pytest.mark.parametrize("start", [[0.0, 0.0], [-1e-18, 0.0], [0.3, 0.1 + 0.2], [1e-18, 0.0]])
@pytest.mark.parametrize("power", ["sqrt(h - c)", "(h - c)**1.5", "(h - c)**n"])
def test_a_start_that_rounding_has_put_below_a_limit(power: str, start: list[float]) -> None:
    model = fp.SymbolicModel(
        f=[f"q - k*{power}", "0"], g=["h - c"], states={"h": "1", "c": "1"}, inputs={}, parameters=dict.fromkeys("qkn", "1"),
        outputs={"y": "1"}, check_units=False,
    )  # fmt: skip
    theta = [0.8, 0.7, 0.6]
    starts = fp.Experiments([start, [0.0, 0.0]], np.empty((2, 0)), [1.0, 1.0])
    done = fp.sensitivities(model, starts, theta, rtol=1e-9)
    assert [str(status) for status in done.statuses] == ["ok", "ok"]
    np.testing.assert_allclose(done.y[0], done.y[1], atol=1e-10)
    np.testing.assert_allclose(done.dy_dtheta[0], done.dy_dtheta[1], atol=1e-8)
