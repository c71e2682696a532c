"""Limits that the output alone reads hold where it is measured; and starts where powers in f are zero."""

from __future__ import annotations

import numpy as np
import pytest

import fisherpoint as fp

pytestmark = pytest.mark.kernels


def dose() -> fp.SymbolicModel:
    return fp.SymbolicModel(
        f=["-ka*d", "ka*d - ke*c"],
        g=["log(c/V)"],
        states={"d": "1", "c": "1"},
        inputs={},
        parameters={"ka": "1/s", "ke": "1/s", "V": "1"},
        outputs={"y": "1"},
    )


def right(ka: float, ke: float, V: float, t: np.ndarray) -> np.ndarray:
    return np.asarray(np.log(ka / (ka - ke) * (np.exp(-ke * t) - np.exp(-ka * t)) / V))


THETA, TIMES = np.array([1.2, 0.3, 10.0]), np.array([0.3, 1.0, 4.0, 12.0])
SLOPES = np.array([(right(*(THETA + 1e-6 * e), TIMES) - right(*(THETA - 1e-6 * e), TIMES)) / 2e-6 for e in np.eye(3)]).T


def test_logarithm_of_what_starts_at_zero() -> None:
    points = fp.Experiments([[1.0, 0.0]] * 4, np.empty((4, 0)), TIMES)
    done = fp.sensitivities(dose(), points, THETA, rtol=1e-9)
    assert not done.status.any()
    np.testing.assert_allclose(done.y[:, 0], right(*THETA, TIMES), atol=1e-8)
    np.testing.assert_allclose(done.dy_dtheta[:, 0], SLOPES, atol=1e-6)


def test_where_it_is_measured_the_limit_holds() -> None:
    model = fp.SymbolicModel(
        f=["-k"], g=["log(x)"], states={"x": "1"}, inputs={}, parameters={"k": "1"}, outputs={"y": "1"}, check_units=False
    )
    points = fp.Experiments([[1.0]] * 2, np.empty((2, 0)), [0.5, 1.5])
    done = fp.simulate(model, points, [1.0])
    assert [str(status) for status in done.statuses] == ["ok", "left_domain"]
    assert fp.sensitivities(model, points, [1.0]).statuses[1] == fp.Status.left_domain


def test_limit_of_the_rates_holds_on_the_way() -> None:
    """sqrt(x) is read by f and g: x = (1 - t)^2 - 0.25 has been below zero where it is measured."""
    model = fp.SymbolicModel(
        f=["1", "-2*(1 - clock)", "sqrt(x)"],
        g=["log(x)"],
        states={"clock": "1", "x": "1", "z": "1"},
        inputs={},
        parameters={"k": "1"},
        outputs={"y": "1"},
        check_units=False,
    )
    done = fp.simulate(model, fp.Experiments([[0.0, 0.75, 0.0]], np.empty((1, 0)), [2.0]), [1.0])
    assert done.statuses[0] == fp.Status.left_domain


@pytest.mark.parametrize("t", [5.0, 20.0, 60.0])
def test_what_only_decays_stays_positive(t: float) -> None:
    model = fp.SymbolicModel(
        f=["-k1*a", "k1*a - k2*b"],
        g=["log(a)", "log(b)"],
        states={"a": "1", "b": ("1", 1e-3)},
        inputs={},
        parameters={"k1": "1/s", "k2": "1/s"},
        outputs={"ya": "1", "yb": "1"},
    )
    k1, k2 = 2.0, 0.3
    done = fp.sensitivities(model, fp.Experiments([[1.0, 1e-3]], np.empty((1, 0)), [t]), [k1, k2])
    b = k1 / (k1 - k2) * (np.exp(-k2 * t) - np.exp(-k1 * t)) + 1e-3 * np.exp(-k2 * t)
    assert done.status[0] == 0
    np.testing.assert_allclose(done.y[0], [-k1 * t, np.log(b)], rtol=1e-5)
    np.testing.assert_allclose(done.dy_dtheta[0, 0], [-t, 0.0], rtol=1e-4, atol=1e-12)


STARTS = {
    "filled tank": (["q - k*sqrt(h)"], ["h"], [0.5, 0.7], ["q", "k"], [0.0]),
    "Hill function": (["a - V*x**n/(K**n + x**n)"], ["x"], [0.5, 0.9, 0.4, 1.7], ["a", "V", "K", "n"], [0.0]),
    "flat Hill function": (["a - V*x**n/(K**n + x**n)"], ["x"], [0.5, 0.9, 0.4, 0.6], ["a", "V", "K", "n"], [0.0]),
    "power": (["a - k*b**1.5"], ["b"], [0.5, 0.7], ["a", "k"], [0.0]),
}


@pytest.mark.parametrize("kind", STARTS)
def test_start_where_a_power_is_zero(kind: str) -> None:
    f, states, theta, parameters, x0 = STARTS[kind]
    model = fp.SymbolicModel(
        f, states, dict.fromkeys(states, "1"), {}, dict.fromkeys(parameters, "1"), {"y": "1"}, check_units=False
    )
    points = fp.Experiments([x0], np.empty((1, 0)), [2.0])
    done = fp.sensitivities(model, points, theta, rtol=1e-8)
    assert done.status[0] == 0
    e = 1e-5 * np.eye(len(theta))
    ends = [[fp.simulate(model, points, theta + s * d, rtol=1e-11).y[0, 0] for s in (1, -1)] for d in e]
    np.testing.assert_allclose(done.dy_dtheta[0, 0], [(a - b) / 2e-5 for a, b in ends], atol=1e-6)


def test_negative_start_is_outside() -> None:
    f, states, theta, parameters, _ = STARTS["filled tank"]
    model = fp.SymbolicModel(
        f, states, dict.fromkeys(states, "1"), {}, dict.fromkeys(parameters, "1"), {"y": "1"}, check_units=False
    )
    done = fp.simulate(model, fp.Experiments([[-0.1]], np.empty((1, 0)), [2.0]), theta)
    assert done.statuses[0] == fp.Status.left_domain
