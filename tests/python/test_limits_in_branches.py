"""A limit that belongs to a branch of the equations holds where the branch is taken, and nowhere else."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fisherpoint as fp

pytestmark = pytest.mark.kernels


def clocked(rate: str, *parameters: str) -> fp.SymbolicModel:
    """x' = rate, with a clock, p' = v as a further state, and y = x."""
    return fp.SymbolicModel(
        f=["1", rate, "v"],
        g=["x"],
        states={"clock": "s", "x": "1", "p": "1"},
        inputs={"v": "1"},
        parameters={name: "1" for name in parameters},
        outputs={"y": "1"},
        check_units=False,
    )


@pytest.mark.parametrize("duration", [0.5, 0.7, 1.0, 1.5, 2.0, 3.0])
def test_infusion_of_an_estimated_duration(duration: float) -> None:
    model = clocked("where(clock < T_i, D/T_i, 0) - k*x", "T_i", "D", "k")
    theta, t, h = np.array([duration, 1.2, 0.3]), 5.0, 1e-6

    def right(T_i: float, D: float, k: float) -> float:
        return float(D / T_i / k * (1 - np.exp(-k * T_i)) * np.exp(-k * (t - T_i)))

    slopes = [(right(*(theta + h * e)) - right(*(theta - h * e))) / (2 * h) for e in np.eye(3)]
    done = fp.sensitivities(model, fp.Experiments([[0.0, 0.0, 0.0]], [[0.0]], [t]), theta, rtol=1e-8)
    assert done.status[0] == 0
    np.testing.assert_allclose(done.y[0, 0], right(*theta), rtol=1e-7)
    np.testing.assert_allclose(done.dy_dtheta[0, 0], slopes, rtol=1e-5)


BRANCHES = {
    "divisor": "where(clock < 1, 1/(p - 3), 1)",
    "root": "where(clock < 1, sqrt(4 - p), 1)",
    "logarithm": "where(clock > 1, 1, log(4 - p))",
    "power": "where(clock < 1, (4 - p)**a, 1)",
    "and": "where(clock > 0.25 and clock < 1, 1/(p - 3), 1)",
    "or": "where(clock < 0.25 or clock > 1, 1, 1/(p - 3))",
    "not": "where(not (clock > 0.25 and clock < 1), 1, 1/(p - 3))",
    "nested": "where(clock < 1, where(clock < 0.5, 1/(p - 3), 2/(p - 3.5)), 1)",
    "maximum": "where(clock < 1, 1/max(p - 3, -2), 1)",
    "step": "heaviside(1 - clock)*where(clock < 1, 1/(p - 3), 0) + 1",
}
TAKEN = {
    "divisor": lambda t, p: 1 / (p - 3) if t < 1 else 1,
    "root": lambda t, p: np.sqrt(4 - p) if t < 1 else 1,
    "logarithm": lambda t, p: 1 if t > 1 else np.log(4 - p),
    "power": lambda t, p: (4 - p) ** 0.7 if t < 1 else 1,
    "and": lambda t, p: 1 / (p - 3) if 0.25 < t < 1 else 1,
    "or": lambda t, p: 1 if t < 0.25 or t > 1 else 1 / (p - 3),
    "not": lambda t, p: 1 / (p - 3) if 0.25 < t < 1 else 1,
    "nested": lambda t, p: (1 / (p - 3) if t < 0.5 else 2 / (p - 3.5)) if t < 1 else 1,
    "maximum": lambda t, p: 1 / max(p - 3, -2) if t < 1 else 1,
    "step": lambda t, p: (1 / (p - 3) if t < 1 else 0) + 1,
}


@pytest.mark.parametrize("kind", BRANCHES)
@pytest.mark.parametrize("speed", [0.5, 1.9])
def test_limit_is_passed_where_its_branch_is_not_taken(kind: str, speed: float) -> None:
    """p goes from 0 to beyond 4, which is where the limits are, after the branch has been left."""
    model = clocked(BRANCHES[kind], "a")
    end = 5 / speed
    done = fp.sensitivities(model, fp.Experiments([[0.0, 0.0, 0.0]], [[speed]], [end]), {"a": 0.7}, rtol=1e-9)
    pieces, x = [0.0, 0.25, 0.5, 1.0, end], 0.0
    for start, stop in itertools.pairwise(pieces):

        def rate(t: float, _: np.ndarray, start: float = start, stop: float = stop) -> list[float]:
            return [TAKEN[kind](min(max(t, start + 1e-12), stop - 1e-12), speed * t)]

        x = solve_ivp(rate, (start, stop), [x], rtol=1e-11, atol=1e-12).y[0, -1]
    assert done.status[0] == 0
    assert abs(done.y[0, 0] - x) < 1e-8


@pytest.mark.parametrize("kind", ["divisor", "root", "logarithm", "power", "and", "or", "not", "nested"])
def test_limit_holds_where_its_branch_is_taken(kind: str) -> None:
    done = fp.simulate(clocked(BRANCHES[kind], "a"), fp.Experiments([[0.0, 0.0, 0.0]], [[5.0]], [2.0]), {"a": 0.7})
    assert done.statuses[0] == fp.Status.left_domain


def test_limit_that_does_not_hold_behind_the_switch() -> None:
    model = clocked("where(clock < 1, 1, sqrt(p))", "a")
    points = fp.Experiments([[0.0, 0.0, -1.0]] * 2, [[0.0]] * 2, [0.9, 1.1])
    done = fp.simulate(model, points, {"a": 1.0})
    assert [str(status) for status in done.statuses] == ["ok", "left_domain"]


def test_divisor_of_another_sign_in_the_other_branch() -> None:
    """The divisor jumps from 1 to -1 with the switch, and is zero nowhere."""
    model = clocked("1/(where(clock < 1, 2, 0) - a)", "a")
    done = fp.sensitivities(model, fp.Experiments([[0.0, 0.0, 0.0]], [[0.0]], [3.0]), {"a": 1.0})
    assert done.status[0] == 0
    np.testing.assert_allclose([done.y[0, 0], done.dy_dtheta[0, 0, 0]], [-1.0, 3.0], atol=1e-6)


@pytest.mark.long
def test_compiled_model_has_the_same_limits() -> None:
    model = clocked(BRANCHES["nested"], "a")
    points = fp.Experiments([[0.0, 0.0, 0.0]] * 2, [[1.9], [5.0]], [2.5, 2.0])
    try:
        compiled = model.compile()
    except RuntimeError as error:
        pytest.skip(str(error))
    plain, done = fp.simulate(model, points, {"a": 0.7}), fp.simulate(compiled, points, {"a": 0.7})
    assert list(done.status) == list(plain.status) == [0, int(fp.Status.left_domain)]
    np.testing.assert_allclose(done.y[0], plain.y[0], rtol=1e-9)
