"""Dead zones and laps of which the width is estimated, and integrators that stop while their actuator is at its limit."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fisherpoint as fp
from filippov import NoAnswer, System, course, derivatives

pytestmark = [pytest.mark.kernels, pytest.mark.filterwarnings("ignore:.* expected its natural size")]

Array = np.ndarray[Any, Any]

COUNT = int(os.environ.get("FISHERPOINT_JUMP_POINTS", "16"))

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
    f"where(({RAW} > um and r > y) or ({RAW} < -um and r < y), 0, ki*(r - y))",
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


def servo() -> System:
    """The same by sides: below the upper limit, above the lower one, and below the reference."""

    def f(x: Array, u: Array, p: Array, s: Array) -> list[float]:
        kp, ki, um, T = p
        error = u[0] - x[0]
        held = (s[0] < 0 and s[2] > 0) or (s[1] < 0 and s[2] < 0)
        force = um if s[0] < 0 else -um if s[1] < 0 else kp * error + x[1]
        return [(force - x[0]) / T, 0.0 if held else ki * error]

    def h(x: Array, u: Array, p: Array) -> list[float]:
        raw = p[0] * (u[0] - x[0]) + x[1]
        return [p[2] - raw, raw + p[2], u[0] - x[0]]

    return System(f, h, np.ones(2), 2)


@pytest.mark.long
@pytest.mark.parametrize("clamp", CLAMPED)
def test_an_integrator_that_stops_at_the_limit(clamp: str) -> None:
    model, rng, count = controlled(clamp), np.random.default_rng(1), COUNT
    p = rng.uniform([0.5, 0.5, 0.5, 0.5], [3, 2, 2, 2], (count, 4))
    starts = np.column_stack([np.where(rng.random(count) < 0.5, 0.0, rng.uniform(-1, 1, count)), np.zeros(count)])
    r, dt = rng.uniform(0.3, 2, count) * rng.choice([-1, 1], count), rng.uniform(0.1, 8, count)
    points = fp.Experiments(starts, r[:, None], dt)
    done = fp.sensitivities(model, points, p, rtol=1e-9)
    assert not done.status.any(), done.statuses
    answers = 0
    for k in range(count):
        try:
            beside = course(servo(), starts[k], r[[k]], p[k], dt[k])
        except NoAnswer:
            continue
        answers += 1
        np.testing.assert_allclose(done.x[k], beside.x, atol=1e-8, err_msg=str(k))
        if k % 4 == 0:
            s, error = derivatives(servo(), starts[k], r[[k]], p[k], dt[k], beside)
            off = np.max(np.abs(done.dx_dtheta[k] - s) - 2 * error, axis=0)
            assert (off <= 1e-6 * np.max(np.abs(s), axis=0) + 1e-7)[~np.isnan(off)].all(), (k, off)
    assert answers > count / 2


@pytest.mark.parametrize("place", range(3))
@pytest.mark.parametrize("clamp", CLAMPED)
def test_no_tolerance_loses_where_a_clamp_is_met_with_its_saturation(clamp: str, place: int) -> None:
    """Under a reference that moves: steps may end so near to both that rounding is all that is left."""
    error = "(0.8*cos(3*tau) + r - y)"
    moving = clamp.replace("(r - y)", error).replace("r > y", f"{error} > 0").replace("r < y", f"{error} < 0")
    saturated = f"(max(min({RAW}, um), -um) - y)/T".replace("(r - y)", error)
    states, parameters = dict.fromkeys(("tau", "y", "i"), "1"), dict.fromkeys(("kp", "ki", "um", "T"), "1")
    model = fp.SymbolicModel(["1", saturated, moving], ["y"], states, {"r": "1"}, parameters, check_units=False)
    x0, r, dt, theta = [
        ([2.3, 0.6, 0.0], -0.3, 1.6, [2.3, 1.7, 0.7, 0.9]),
        ([2.5, -0.5, 0.0], 0.3, 3.9, [1.7, 1.9, 0.9, 1.6]),
        ([1.651083981277384, -0.4456470989669652, -0.07028887682068996], -0.425366091117532, 2.90695385185021,
         [2.280910013199703, 1.6254481037595832, 0.5732383569065254, 0.6387193964282233]),
    ][place]  # fmt: skip
    points = fp.Experiments([x0], [[r]], [dt])
    for method in ("RK45", "DOP853"):
        done = [fp.simulate(model, points, theta, rtol=rtol, method=method) for rtol in 10.0 ** -np.arange(6, 12, 0.25)]
        assert {str(one.statuses[0]) for one in done} == {"ok"}
        assert np.ptp([one.x[0] for one in done[8:]], axis=0).max() < 1e-6


@pytest.mark.parametrize("rtol", [1e-6, 1e-8, 1e-9])
def test_a_slide_along_a_saturation_that_ends_within_its_first_step(rtol: float) -> None:
    """The kink of the saturation lies on the clamp's surface, also behind the end of the slide."""
    e, raw = "(A*sin(2*tau) - y)", "(kp*(A*sin(2*tau) - y) + i)"
    model = fp.SymbolicModel(
        ["1", f"(max(min({raw}, um), -um) - y)/T", f"where(abs({raw}) < um or {e}*{raw} < 0, ki*{e}, 0)"], ["y", "i"],
        dict.fromkeys(["tau", "y", "i"], "1"), {}, dict.fromkeys(["A", "kp", "ki", "um", "T"], "1"), {"y": "1", "i": "1"},
        check_units=False,
    )  # fmt: skip
    ends = np.linspace(0.05, 3, 120)
    points = fp.Experiments([[2.9711191468900235, 0.7399586178325254, 0.23993096966623112]] * 120, np.empty((120, 0)), ends)
    done = fp.simulate(model, points, [0.8, 1.75, 1.25, 0.85, 1.25], rtol=rtol)
    fine = fp.simulate(model, points, [0.8, 1.75, 1.25, 0.85, 1.25], rtol=1e-11)
    assert not done.status.any() and not fine.status.any(), (done.statuses, fine.statuses)
    np.testing.assert_allclose(done.x, fine.x, atol=10 * rtol)
