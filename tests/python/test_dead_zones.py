"""Dead zones and laps of which the width is estimated, and integrators that stop while their actuator is at its limit."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fisherpoint as fp

pytestmark = [pytest.mark.kernels, pytest.mark.filterwarnings("ignore:.* expected its natural size")]

Array = np.ndarray[Any, Any]

COUNT = int(os.environ.get("FISHERPOINT_JUMP_POINTS", "40"))

PLAIN = "max(v - w, 0) + min(v + w, 0)"
FORMS = ["sign(v)*max(abs(v) - w, 0)", "where(abs(v) > w, v - w*sign(v), 0)", "where(v > w, v - w, where(v < -w, v + w, 0))"]


def behind(zone: str) -> fp.SymbolicModel:
    """A spool with a lag, and a cylinder that leaks."""
    return fp.SymbolicModel(
        ["(u*sin(clock) - v)/0.1", "1", f"k*({zone}) - x"],
        ["x"],
        dict.fromkeys(("v", "clock", "x"), "1"),
        {"u": "1"},
        dict.fromkeys("wk", "1"),
        check_units=False,
    )


def drawn(count: int) -> tuple[fp.Experiments, Array]:
    """On a grid of tenths: many start in the centre, at rest, or on an edge."""
    rng = np.random.default_rng(0)
    v = np.where(rng.random(count) < 0.4, 0.0, rng.integers(-10, 10, count) / 10)
    clock = np.where(rng.random(count) < 0.5, 0.0, rng.integers(0, 10, count) / 10)
    u = rng.integers(1, 11, count) * rng.choice([-1, 1], count) / 10
    points = fp.Experiments(np.column_stack([v, clock, np.zeros(count)]), u[:, None], rng.integers(1, 80, count) / 10)
    return points, np.column_stack([rng.integers(1, 8, count) / 10, rng.integers(5, 20, count) / 10])


@pytest.mark.parametrize("zone", FORMS)
def test_a_zone_of_estimated_width(zone: str) -> None:
    points, theta = drawn(COUNT)
    plain, done = (fp.sensitivities(behind(form), points, theta, rtol=1e-9) for form in (PLAIN, zone))
    assert not plain.status.any() and not done.status.any()
    np.testing.assert_allclose(done.x, plain.x, atol=1e-8)
    np.testing.assert_allclose(done.dx_dtheta, plain.dx_dtheta, atol=1e-6)
    for k in range(0, COUNT, 10):

        def rates(t: float, x: Array, k: int = k) -> list[float]:
            w, gain = theta[k]
            return [
                (points.u[k, 0] * np.sin(points.x0[k, 1] + t) - x[0]) / 0.1,
                1.0,
                gain * np.sign(x[0]) * max(abs(x[0]) - w, 0) - x[2],
            ]

        beside = solve_ivp(rates, (0, points.dt[k]), points.x0[k], rtol=1e-11, atol=1e-12, max_step=0.01)
        np.testing.assert_allclose(done.x[k], beside.y[:, -1], atol=1e-7)


RAW = "(kp*(r - y) + i)"
CLAMPED = [
    f"where(abs({RAW}) < um or (r - y)*{RAW} < 0, ki*(r - y), 0)",
    f"where({RAW} > um, where(r > y, 0, ki*(r - y)), where({RAW} < -um, where(r < y, 0, ki*(r - y)), ki*(r - y)))",
]


def controlled(clamp: str) -> fp.SymbolicModel:
    return fp.SymbolicModel(
        [f"(max(min({RAW}, um), -um) - y)/T", clamp],
        ["y"],
        {"y": "1", "i": "1"},
        {"r": "1"},
        dict.fromkeys(("kp", "ki", "um", "T"), "1"),
        check_units=False,
    )


def anti_windup(y: float, i: float, r: float, p: Array, dt: float) -> Array:
    """By modes: inside, at the limit with the integrator held, and along the limit, where both point at it."""
    kp, ki, um, T = p
    t, x, mode = 0.0, np.array([y, i]), None
    raw = lambda x: kp * (r - x[0]) + x[1]  # noqa: E731

    def inside(_: float, x: Array) -> list[float]:
        return [(np.clip(raw(x), -um, um) - x[0]) / T, ki * (r - x[0])]

    def held(_: float, x: Array) -> list[float]:
        return [(np.clip(raw(x), -um, um) - x[0]) / T, 0.0]

    def along(_: float, x: Array) -> list[float]:
        rate = (np.sign(raw(x)) * um - x[0]) / T
        return [rate, kp * rate]

    def growth(f: Any, x: Array) -> float:
        dy, di = f(0.0, x)
        return float(np.sign(raw(x)) * (di - kp * dy))

    mode = held if abs(raw(x)) > um and (r - x[0]) * raw(x) > 0 else inside
    while t < dt:
        events = [lambda _, x: abs(raw(x)) - um]
        if mode is along:
            events = [lambda _, x: growth(inside, x), lambda _, x: growth(held, x)]
        elif mode is held or abs(raw(x)) > um:
            events.append(lambda _, x: r - x[0])
        for event in events:
            event.terminal = True  # type: ignore[attr-defined]
        done = solve_ivp(mode, (t, dt), x, method="DOP853", rtol=1e-12, atol=1e-13, events=events, max_step=dt / 50)
        t, x = float(done.t[-1]), done.y[:, -1]
        if done.status == 0:
            break
        off = 1e-12
        up, down = growth(inside, x), growth(held, x)
        if abs(abs(raw(x)) - um) < 1e-9 and (r - x[0]) * raw(x) > 0:
            mode = along if up > off and down < -off else held if up > 0 else inside
        else:
            mode = inside
    return x


@pytest.mark.parametrize("clamp", CLAMPED)
def test_an_integrator_that_stops_at_the_limit(clamp: str) -> None:
    model, rng, count = controlled(clamp), np.random.default_rng(1), COUNT
    p = rng.uniform([0.5, 0.5, 0.5, 0.5], [3, 2, 2, 2], (count, 4))
    starts = np.column_stack([np.where(rng.random(count) < 0.5, 0.0, rng.uniform(-1, 1, count)), np.zeros(count)])
    r, dt = rng.uniform(0.3, 2, count) * rng.choice([-1, 1], count), rng.uniform(0.1, 8, count)
    points = fp.Experiments(starts, r[:, None], dt)
    done = fp.sensitivities(model, points, p, rtol=1e-9)
    assert not done.status.any(), done.statuses
    for k in range(count):
        beside = anti_windup(*starts[k], r[k], p[k], dt[k])
        np.testing.assert_allclose(done.x[k], beside, atol=1e-8, err_msg=str(k))
        for j in range(4 if k % 4 == 0 else 0):
            step = 1e-5 * np.eye(4)[j]
            ends = [anti_windup(*starts[k], r[k], p[k] + sign * step, dt[k]) for sign in (1, -1)]
            np.testing.assert_allclose(
                done.dx_dtheta[k, :, j], (ends[0] - ends[1]) / 2e-5, atol=3e-6, rtol=1e-5, err_msg=f"{k} {j}"
            )
