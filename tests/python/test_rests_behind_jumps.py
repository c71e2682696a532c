"""Behind a jump where nothing moves the jump's own surface, trajectories rest; and stiff ones whose first step is tiny."""

from __future__ import annotations

import numpy as np
import pytest

import fisherpoint as fp

pytestmark = pytest.mark.kernels


def depot(**more: str) -> fp.SymbolicModel:
    """A depot d that empties at the rate r into c, and is filled by u."""
    return fp.SymbolicModel(
        f=["u - where(d > 0, r, 0)", "where(d > 0, r, 0) - k*c"],
        g=["c", "d"],
        states={"d": "1", "c": "1"},
        inputs={"u": "1/s"},
        parameters={"r": "1/s", "k": "1/s"},
        outputs={"y": "1", "d": "1"},
    )


def right(r: float, k: float, t: float) -> float:
    return float(r / k * (1 - np.exp(-k / r)) * np.exp(-k * (t - 1 / r)))


@pytest.mark.parametrize("t", [1.0, 2.0, 5.0, 7.25])
@pytest.mark.parametrize("r", [2.0, 1.7, 4.0])
def test_what_is_used_up_rests(r: float, t: float) -> None:
    done = fp.sensitivities(depot(), fp.Experiments([[1.0, 0.0]], [[0.0]], [t]), {"r": r, "k": 0.3}, rtol=1e-8)
    h = 1e-6
    slopes = [(right(r + h, 0.3, t) - right(r - h, 0.3, t)) / (2 * h), (right(r, 0.3 + h, t) - right(r, 0.3 - h, t)) / (2 * h)]
    assert done.status[0] == 0
    np.testing.assert_allclose(done.y[0], [right(r, 0.3, t), 0.0], atol=1e-8)
    np.testing.assert_allclose(done.dy_dtheta[0, 0], slopes, atol=1e-6)
    assert (done.dy_dtheta[0, 1] == 0).all()  # exactly: rounding would look like information


def test_start_at_rest() -> None:
    done = fp.sensitivities(depot(), fp.Experiments([[0.0, 1.0]], [[0.0]], [2.0]), {"r": 2.0, "k": 0.3}, rtol=1e-8)
    assert done.status[0] == 0
    np.testing.assert_allclose(done.y[0], [np.exp(-0.6), 0.0], atol=1e-8)
    np.testing.assert_allclose(done.dy_dtheta[0, 0], [0.0, -2 * np.exp(-0.6)], atol=1e-7)


def test_it_is_filled_again() -> None:
    """Empty from 0.5 s to 1 s; then u = 3 is more than flows out, or u = 1 is less, which passes through at once."""
    for u, d in ((3.0, 1.0), (1.0, 0.0)):
        runs = fp.Runs([[1.0, 0.0]], [[[0.0], [0.0], [u]]], [[0.5, 0.5, 1.0]])
        done = fp.simulate(depot(), runs, {"r": 2.0, "k": 0.3}, rtol=1e-9)
        inflow = min(u, 2.0)
        c = right(2.0, 0.3, 1.0) * np.exp(-0.3) + inflow / 0.3 * (1 - np.exp(-0.3))
        assert done.status[0] == 0
        np.testing.assert_allclose(done.x[0, -1], [d, c], atol=1e-7)


def test_integrator_with_a_saturation() -> None:
    """x rises to 1 and stays; behind it y goes on. x is there at (1 - x0)/r."""
    model = fp.SymbolicModel(
        f=["where(x < 1, r, 0)", "x - k*y"],
        g=["x", "y"],
        states={"x": "1", "y": "1"},
        inputs={},
        parameters={"r": "1/s", "k": "1/s"},
        outputs={"a": "1", "b": "1"},
        check_units=False,
    )
    r, k, t = 0.5, 0.4, 4.0

    def end(r: float, k: float) -> float:
        s = 1 / r
        y = r / k * s - r / k**2 * (1 - np.exp(-k * s))
        return float(y * np.exp(-k * (t - s)) + (1 - np.exp(-k * (t - s))) / k)

    done = fp.sensitivities(model, fp.Experiments([[0.0, 0.0]], np.empty((1, 0)), [t]), [r, k], rtol=1e-8)
    h = 1e-6
    slopes = [(end(r + h, k) - end(r - h, k)) / (2 * h), (end(r, k + h) - end(r, k - h)) / (2 * h)]
    assert done.status[0] == 0
    np.testing.assert_allclose(done.y[0], [1.0, end(r, k)], atol=1e-8)
    np.testing.assert_allclose(done.dy_dtheta[0, 1], slopes, atol=1e-6)
    np.testing.assert_allclose(done.dy_dtheta[0, 0], 0.0, atol=1e-12)


def test_first_step_far_below_the_duration() -> None:
    """A fast reaction of 1e-14 s in a minute: the floor of steps is the rounding of the time that has been reached."""
    model = fp.SymbolicModel(
        f=["k*(1 - a) - b*a", "b*a"],
        g=["c"],
        states={"a": "1", "c": "1"},
        inputs={},
        parameters={"k": "1/s", "b": "1/s"},
        outputs={"y": "1"},
    )
    done = fp.simulate(model, fp.Experiments([[0.0, 0.0]], np.empty((1, 0)), [60.0]), {"k": 1e15, "b": 0.1})
    assert done.status[0] == 0
    np.testing.assert_allclose(done.y[0, 0], 6.0, rtol=1e-5)
