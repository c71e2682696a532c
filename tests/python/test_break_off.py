"""What rests on a jump because as much holds it as moves it: a force that is just what friction bears, and what it does next."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import fisherpoint as fp

pytestmark = [pytest.mark.kernels, pytest.mark.filterwarnings("ignore:.* expected its natural size")]

ROUNDED = (0.0, 2.2e-16, -2.2e-16, 6.6e-16)
FRICTIONS = (0.1, 0.3, 0.7, 1.0)


def model_of(rates: list[str], states: list[str], outputs: list[str]) -> fp.SymbolicModel:
    units = dict.fromkeys(states, "1")
    return fp.SymbolicModel(rates, outputs, units, {}, {"c": "1"}, check_units=False)


RAMP = model_of(["r", "0", "v", "F - c*sign(v)"], ["F", "r", "y", "v"], ["y", "v"])
TWO = model_of(["r", "0", "v", "F - c*sign(v)", "w", "0.5*F - 0.5*c*sign(w)"], ["F", "r", "y", "v", "z", "w"], ["y", "v", "z", "w"])


def moved(c: float, side: int, rate: float, duration: float) -> tuple[float, float, float]:
    """y, v and dv/dc of a mass at rest under the force side*c + rate*t: the same way at once, or the other way later."""
    way = 1.0 if side * rate > 0 else -1.0
    lost = 0.0 if way > 0 else 2 * c / abs(rate)
    time = max(duration - lost, 0.0)
    return side * way * abs(rate) * time**3 / 6, side * way * abs(rate) * time**2 / 2, -side * way * time


@pytest.mark.parametrize("model", [RAMP, TWO], ids=["one", "two at once"])
def test_how_the_force_changes_decides_whether_it_moves(model: fp.SymbolicModel) -> None:
    cases = list(itertools.product(FRICTIONS, (1, -1), (1.0, -1.0, 0.1), ROUNDED, (0.5, 2.0)))
    rest = np.zeros((len(cases), len(model.states)))
    rest[:, 0] = [side * c * (1 + off) for c, side, _, off, _ in cases]
    rest[:, 1] = [rate for _, _, rate, _, _ in cases]
    points = fp.Experiments(rest, np.empty((len(cases), 0)), [case[-1] for case in cases])
    theta = np.array([[case[0]] for case in cases])
    states, done = fp.simulate(model, points, theta, rtol=1e-9), fp.sensitivities(model, points, theta, rtol=1e-9)
    assert not states.status.any() and not done.status.any()
    right = np.array([moved(c, side, rate, duration) for c, side, rate, _, duration in cases])
    for first in range(2, len(model.states), 2):
        share = 1.0 if first == 2 else 0.5
        np.testing.assert_allclose(states.x[:, first : first + 2], share * right[:, :2], atol=1e-8)
        np.testing.assert_allclose(done.x[:, first : first + 2], share * right[:, :2], atol=1e-8)
        np.testing.assert_allclose(done.dx_dtheta[:, first + 1, 0], share * right[:, 2], atol=1e-7)


def test_the_derivative_is_that_of_differences() -> None:
    points = fp.Experiments([[0.3, 1.0, 0.0, 0.0], [0.3, -1.0, 0.0, 0.0], [0.3, 1.0, 0.0, -0.2]], np.empty((3, 0)), [1.5] * 3)
    done = fp.sensitivities(RAMP, points, [0.3], rtol=1e-10)
    step = 1e-5
    ends = [fp.simulate(RAMP, points, [0.3 + by], rtol=1e-12).x for by in (step, -step)]
    np.testing.assert_allclose(done.dx_dtheta[:, :, 0], (ends[0] - ends[1]) / (2 * step), atol=1e-4)


def test_a_force_that_stays_what_friction_bears() -> None:
    """It rests. A little less friction and it moves, a little more and it does not: no derivative."""
    for side, off in itertools.product((1, -1), ROUNDED):
        at_rest = fp.Experiments([[side * 0.3 * (1 + off), 0.0, 0.0, 0.0]], np.empty((1, 0)), [2.0])
        states = fp.simulate(RAMP, at_rest, [0.3])
        assert not states.status.any()
        np.testing.assert_allclose(states.x[0, 2:], 0.0, atol=1e-14)
        assert fp.sensitivities(RAMP, at_rest, [0.3]).status[0] == fp.Status.on_jump


@pytest.mark.parametrize("force", [0.3, -0.3])
def test_it_comes_to_rest_under_such_a_force(force: float) -> None:
    arrives = fp.Experiments([[force, 0.0, 0.0, -2 * force]], np.empty((1, 0)), [3.0])
    states, done = fp.simulate(RAMP, arrives, [0.3], rtol=1e-9), fp.sensitivities(RAMP, arrives, [0.3], rtol=1e-9)
    assert not states.status.any() and done.status[0] == fp.Status.on_jump
    np.testing.assert_allclose(states.x[0, 2:], [-force, 0.0], atol=1e-8)


def test_a_run_whose_force_becomes_what_friction_bears() -> None:
    model = fp.SymbolicModel(
        ["v", "F - c*sign(v) - k*y"], ["y", "v"], {"y": "1", "v": "1"}, {"F": "1"}, {"c": "1", "k": "1"}, check_units=False
    )
    for forces in ([0.0, 0.3, 0.5], [0.3, 0.3, 0.5], [0.1, 0.3, -0.3], [-0.3, 0.3, 0.5]):
        run = fp.Runs([[0.0, 0.0]], [[[force] for force in forces]], [[0.5] * 3])
        for k in (0.0, 1.0):
            states = fp.simulate(model, run, [0.3, k], rtol=1e-9)
            assert not states.status.any(), (forces, k, states.statuses)
            end = 0.2 * (0.125 if k == 0 else 1 - np.cos(0.5)) if forces[-1] == 0.5 else 0.0
            np.testing.assert_allclose(states.y[0, :, 0], [0.0, 0.0, end], atol=1e-8)


def test_a_tank_that_is_empty_has_a_derivative() -> None:
    """Nothing moves behind the jump whatever theta is."""
    tank = fp.SymbolicModel(["-where(x > 0, p/10, 0)"], ["x"], {"x": "1"}, {}, {"p": "1"}, check_units=False)
    done = fp.sensitivities(tank, fp.Experiments([[0.3], [0.0]], np.empty((2, 0)), [5.0] * 2), [1.0])
    assert not done.status.any() and not done.dx_dtheta.any()


def test_two_masses_of_which_one_is_about_to_break_off() -> None:
    """The spring is stretched by the share of friction that holds the second, and the first moves on."""
    model = fp.SymbolicModel(
        ["v", "w", "2*u - k*(y - z) - 0.2*v - c*(2*heaviside(v) - 1)", "k*(y - z) - 0.2*w - d*where(w > 0, 1, -1)"],
        ["y", "z"],
        dict.fromkeys(("y", "z", "v", "w"), "1"),
        {"u": "1"},
        dict.fromkeys("kcd", "1"),
        check_units=False,
    )
    points = fp.Experiments([[-0.5, -0.4, 0.2, 0.0]], [[0.7]], [3.7])
    states, done = (of(model, points, [3.0, 0.5, 0.3], rtol=1e-10) for of in (fp.simulate, fp.sensitivities))
    assert not states.status.any() and not done.status.any()
    right = [1.8350104060527328, 1.4558432981760983, 0.9390546921329516, 0.8051016139537563]  # mode by mode
    np.testing.assert_allclose(states.x[0], right, atol=1e-8)
    np.testing.assert_allclose(done.x[0], right, atol=1e-8)
