"""Flows through orifices that reverse, valves that open, weirs and tanks that run dry, against an integration of their own."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fisherpoint as fp

pytestmark = pytest.mark.kernels

Case = tuple[list[str], list[str], list[str], Callable[..., Any], Callable[..., Any]]
"""Equations, states, parameters; the rates of (x, theta, sides) with each side held, and what is zero on the surfaces."""


def root(value: float) -> float:
    return float(np.sqrt(abs(value)))


CASES: dict[str, Case] = {
    "orifice": (
        ["1", "-p + a*sin(clock)", "k*(sign(p - q)*sqrt(abs(p - q)))"],
        ["clock", "p", "q"],
        ["k", "a"],
        lambda x, th, s: [1.0, -x[1] + th[1] * np.sin(x[0]), th[0] * s[0] * root(x[1] - x[2])],
        lambda x, th: [x[1] - x[2]],
    ),
    "orifice with a density": (
        ["1", "-p + a*sin(clock)", "k*where(p > q, sqrt(2*(p - q)/1.5), -sqrt(2*(q - p)/1.5))"],
        ["clock", "p", "q"],
        ["k", "a"],
        lambda x, th, s: [1.0, -x[1] + th[1] * np.sin(x[0]), th[0] * s[0] * root(2 * (x[1] - x[2]) / 1.5)],
        lambda x, th: [x[1] - x[2]],
    ),
    "relief valve": (
        ["1", "a*(1 + sin(1.5*clock)) - k*sqrt(max(p - p_s, 0)) - 0.1*p", "p"],
        ["clock", "p", "z"],
        ["k", "a", "p_s"],
        lambda x, th, s: [
            1.0,
            th[1] * (1 + np.sin(1.5 * x[0])) - (th[0] * root(x[1] - th[2]) if s[0] > 0 else 0.0) - 0.1 * x[1],
            x[1],
        ],
        lambda x, th: [x[1] - th[2]],
    ),
    "weir": (
        ["1", "a*(1 + cos(2*clock)) - where(h > h_m, k*(h - h_m)**1.5, 0) - 0.3*h", "h"],
        ["clock", "h", "z"],
        ["k", "a", "h_m"],
        lambda x, th, s: [
            1.0,
            th[1] * (1 + np.cos(2 * x[0])) - (th[0] * abs(x[1] - th[2]) ** 1.5 if s[0] > 0 else 0.0) - 0.3 * x[1],
            x[1],
        ],
        lambda x, th: [x[1] - th[2]],
    ),
    "drag": (
        ["1", "a*cos(1.3*clock) - k*sign(v)*abs(v)**1.5", "v"],
        ["clock", "v", "z"],
        ["k", "a"],
        lambda x, th, s: [1.0, th[1] * np.cos(1.3 * x[0]) - th[0] * s[0] * abs(x[1]) ** 1.5, x[1]],
        lambda x, th: [x[1]],
    ),
}


def model_of(case: Case) -> fp.SymbolicModel:
    equations, states, parameters, *_ = case
    named = {name: "1" for name in states}
    outputs = {f"y_{name}": "1" for name in states[1:]}
    return fp.SymbolicModel(equations, states[1:], named, {}, {name: "1" for name in parameters}, outputs, check_units=False)


def right(case: Case, x0: Any, theta: Any, end: float) -> Any:
    """The end of a trajectory whose steps end on the surfaces, with f continued evenly past them."""
    rates, heights = case[3:]
    x, t = np.array(x0, dtype=float), 0.0
    h = np.array(heights(x, theta))
    ahead = np.array(heights(x + 1e-6 * np.array(rates(x, theta, np.ones(len(h)))), theta))
    side = np.where(np.where(np.abs(h) > 1e-12, h, ahead) > 0, 1.0, -1.0)
    while t < end:
        since = t

        def met(s: float, z: Any, since: float = since, up: float = float(side[0])) -> float:
            return float(up * heights(z, theta)[0]) if s > since + 1e-9 else 1.0

        met.terminal = True  # type: ignore[attr-defined]
        held = partial(lambda side, _, z: rates(z, theta, side), side)
        done = solve_ivp(held, (t, end), x, "DOP853", events=met, rtol=1e-13, atol=1e-14, max_step=end / 50)
        t, x = float(done.t[-1]), done.y[:, -1]
        side = -side
    return x[1:]


def drawn(case: Case, rng: np.random.Generator) -> tuple[list[float], list[float], float]:
    """A start, parameters and a duration, some on grids of tenths or quarters, and some starts on the surface."""

    def nice(low: float, high: float) -> float:
        value = rng.uniform(low, high)
        return float([round(value, 1), round(4 * value) / 4, value][rng.integers(3)])

    theta = [nice(0.3, 1.0) for _ in case[2]]
    start = [0.0, nice(0.0, 1.5), nice(0.0, 1.5)]
    if len(theta) > 2 and start[1] == theta[2]:  # where the surface depends on theta, finite differences start off it
        start[1] += 0.25
    return start, theta, nice(1.0, 8.0)


@pytest.mark.parametrize("kind", CASES)
@pytest.mark.parametrize("seed", range(6))
def test_states_and_sensitivities_over_roots(kind: str, seed: int) -> None:
    case = CASES[kind]
    x0, theta, end = drawn(case, np.random.default_rng([seed, len(kind)]))
    points = fp.Experiments([x0], np.empty((1, 0)), [end])
    model = model_of(case)
    states = fp.simulate(model, points, theta, rtol=1e-9)
    slopes = fp.sensitivities(model, points, theta, rtol=1e-8)
    assert [str(states.statuses[0]), str(slopes.statuses[0])] == ["ok", "ok"], (x0, theta, end)
    np.testing.assert_allclose(states.y[0], right(case, x0, theta, end), atol=1e-8)
    np.testing.assert_allclose(slopes.y[0], states.y[0], atol=1e-7)
    e = 1e-5 * np.eye(len(theta))
    expected = np.array([(right(case, x0, theta + d, end) - right(case, x0, theta - d, end)) / 2e-5 for d in e]).T
    np.testing.assert_allclose(slopes.dy_dtheta[0], expected, atol=1e-5 * (1 + np.abs(expected).max()))


@pytest.mark.parametrize("kind", ["orifice", "relief valve"])
def test_start_on_the_surface(kind: str) -> None:
    case = CASES[kind]
    x0, theta, end = [0.0, 0.5, 0.5], [0.7, 0.9, 0.5][: len(case[2])], 1.5
    points, model = fp.Experiments([x0], np.empty((1, 0)), [end]), model_of(case)
    slopes = fp.sensitivities(model, points, theta, rtol=1e-8)
    assert slopes.status[0] == 0
    np.testing.assert_allclose(slopes.y[0], right(case, x0, theta, end), atol=1e-8)
    if kind == "orifice":  # where the surface depends on theta, finite differences start off it
        e = 1e-5 * np.eye(len(theta))
        expected = np.array([(right(case, x0, theta + d, end) - right(case, x0, theta - d, end)) / 2e-5 for d in e]).T
        np.testing.assert_allclose(slopes.dy_dtheta[0], expected, atol=1e-6)


RATES = ("-k*sqrt(max(h, 0))", "where(h > 0, -k*sqrt(h), 0)", "where(h > 0, -k*sqrt(max(h, 0)), 0)")


@pytest.mark.parametrize("rate", RATES)
def test_tank_that_runs_dry_rests(rate: str) -> None:
    """h = (1 - k t/2)^2 until 2/k, and 0 from there on; z is its integral, 2/(3 k) (1 - (1 - k t/2)^3)."""
    tank = fp.SymbolicModel(
        f=[rate, "h"], g=["h", "z"], states={"h": "1", "z": "1"}, inputs={}, parameters={"k": "1"},
        outputs={"h": "1", "z": "1"}, check_units=False,
    )  # fmt: skip
    for k, t in [(1.0, 1.0), (1.0, 2.5), (1.0, 4.0), (0.5, 3.9), (2.0, 50.0)]:
        done = fp.sensitivities(tank, fp.Experiments([[1.0, 0.0]], np.empty((1, 0)), [t]), {"k": k}, rtol=1e-8)
        a = max(1 - k * t / 2, 0.0)
        s = min(t, 2 / k)
        assert done.status[0] == 0
        np.testing.assert_allclose(done.y[0], [a**2, 2 / (3 * k) * (1 - a**3)], atol=1e-8)
        slopes = [-a * s, -2 / (3 * k**2) * (1 - a**3) + a**2 * s / k]
        np.testing.assert_allclose(done.dy_dtheta[0, :, 0], slopes, atol=1e-6)


@pytest.mark.parametrize("rate", RATES)
def test_tank_is_filled_again(rate: str) -> None:
    """Dry from 2 to 3, then filled: h = w^2 with t = 3 - (2/k) (w + (q/k) log(1 - k w/q)), by an inflow in f or another input."""
    k, q, end = 1.0, 0.8, 5.0
    low, high = 0.0, q / k
    for _ in range(200):
        w = (low + high) / 2
        low, high = (w, high) if -(2 / k) * (w + (q / k) * np.log1p(-k * w / q)) < end - 3 else (low, w)
    by_clock = fp.SymbolicModel(
        f=["1", f"{rate} + where(clock > t_f, q, 0)"], g=["h"], states={"clock": "1", "h": "1"}, inputs={},
        parameters={"k": "1", "q": "1", "t_f": "1"}, outputs={"y": "1"}, check_units=False,
    )  # fmt: skip
    done = fp.sensitivities(by_clock, fp.Experiments([[0.0, 1.0]], np.empty((1, 0)), [end]), [k, q, 3.0], rtol=1e-8)
    assert done.status[0] == 0
    assert abs(done.y[0, 0] - w**2) < 1e-8
    assert abs(done.dy_dtheta[0, 0, 2] + (q - k * w)) < 1e-6  # it is the same later
    by_input = fp.SymbolicModel(
        f=[f"{rate} + u*q"], g=["h"], states={"h": "1"}, inputs={"u": "1"}, parameters={"k": "1", "q": "1"},
        outputs={"y": "1"}, check_units=False,
    )  # fmt: skip
    runs = fp.Runs([[1.0]], [[[0.0], [0.0], [1.0]]], [[1.5, 1.5, 2.0]])
    along = fp.simulate(by_input, runs, [k, q], rtol=1e-9)
    assert along.status[0] == 0
    np.testing.assert_allclose(along.x[0, :, 0], [1.0, 1 / 16, 0.0, w**2], atol=1e-8)


def test_root_of_what_is_negative_is_still_outside() -> None:
    model = fp.SymbolicModel(
        f=["where(h < 1, sqrt(h), 0) - 1"], g=["k*h"], states={"h": "1"}, inputs={}, parameters={"k": "1"},
        outputs={"y": "1"}, check_units=False,
    )  # fmt: skip
    done = fp.simulate(model, fp.Experiments([[0.5]], np.empty((1, 0)), [9.0]), [1.0])
    assert done.statuses[0] == fp.Status.left_domain


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("h0", [0.0, 0.1, 0.5])
def test_a_sample_where_it_is_filled_again(rate: str, h0: float) -> None:
    """It rests when the sample is taken, in the instant in which the inflow begins; or it does not yet."""
    tank = fp.SymbolicModel(
        f=["1", f"{rate} + where(clock > t_f, q, 0)"], g=["h"], states={"clock": "1", "h": "1"}, inputs={},
        parameters={"k": "1", "q": "1", "t_f": "1"}, outputs={"y": "1"}, check_units=False,
    )  # fmt: skip
    for dt in (0.79, 0.8):
        done = fp.simulate(tank, fp.Experiments([[0.2, h0]], np.empty((1, 0)), [dt]), [1.4, 0.9, 1.0], rtol=1e-10)
        assert done.status[0] == fp.Status.ok
        np.testing.assert_allclose(done.x[0, 1], max(np.sqrt(h0) - 0.7 * dt, 0.0) ** 2, atol=1e-8)


@pytest.mark.filterwarnings("ignore:.* expected its natural size")
@pytest.mark.parametrize("form", ["k*max(h, 0)**b", "where(h > 0, k*h**b, 0)"])
@pytest.mark.parametrize("rtol", [1e-6, 1e-8, 1e-10])
def test_one_step_from_a_surface_back_to_it(form: str, rtol: float) -> None:
    """h rises from 0 and falls back in one step of DOP853, as the power is 1: the sensitivities take it on the same side."""
    model = fp.SymbolicModel(
        f=["2*(u - r)", f"r - d*h - {form}", "q*h - z"], g=["h", "z"], states=dict.fromkeys("rhz", "1"), inputs={"u": "1"},
        parameters=dict.fromkeys("kbdq", "1"), outputs={"h": "1", "z": "1"}, check_units=False,
    )  # fmt: skip
    theta, h = np.array([2.0, 1.0, 0.1, 1.2]), 1e-4
    for dt in (0.2, 0.5, 2.7):
        points = fp.Experiments([[0.2, 0.0, 0.8]], [[-0.9]], [dt])
        done = fp.sensitivities(model, points, theta, rtol=rtol, method="DOP853")
        ends = [[fp.simulate(model, points, theta + s * e, rtol=1e-12).x[0] for s in (1, -1)] for e in h * np.eye(4)]
        slopes = np.array([(up - down) / (2 * h) for up, down in ends]).T
        assert done.status[0] == fp.Status.ok
        np.testing.assert_allclose(done.x, fp.simulate(model, points, theta, rtol=1e-12).x, atol=30 * rtol)
        np.testing.assert_allclose(done.dx_dtheta[0], slopes, atol=1e-6 + 30 * rtol)
