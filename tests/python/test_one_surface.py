"""A condition in several forms is one surface, where the forms are provably multiples of one another."""

from __future__ import annotations

import numpy as np
import pytest

import fisherpoint as fp


def model(first: str, second: str, **constants: tuple[float, str]) -> fp.SymbolicModel:
    """Each condition adds to the rate of x; c rises with time."""
    parameters = {name: "1" for name in ("a", "b", "c_m", "k") if name not in constants}
    return fp.SymbolicModel(
        ["1", f"where({first}, a, 0) + where({second}, b, 0) + 0*k*c_m"],
        ["x"],
        {"c": "1", "x": "1"},
        {"u": "1"},
        parameters,
        constants=constants,
        check_units=False,
    )


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("2*c > 2*c_m", "c/c_m > 1"),
        ("c > c_m", "c/c_m - 1 >= 0"),
        ("c - c_m > 0", "c_m - c < 0"),
        ("c*exp(k) > c_m*exp(k)", "c > c_m"),
        ("c/(k*c_m) > 1/k", "c > c_m"),
        ("x/c_m + c > u/c_m", "x + c_m*c > u"),
    ],
)
def test_multiples_are_one_surface(first: str, second: str) -> None:
    one = model(first, second)
    assert len(one.jumps) == 1 and one.crossable == one.jumps


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("k*c > k*c_m", "c > c_m"),  # k may be zero: the first is then zero everywhere
        ("c > c_m", "c > c_m + k"),
        ("u*c > u*c_m", "c > c_m"),
        ("x*c > x*c_m", "c > c_m"),
    ],
)
def test_what_may_be_zero_elsewhere_is_another(first: str, second: str) -> None:
    assert len(model(first, second).jumps) == 2


def test_constants_tell_the_side() -> None:
    assert len(model("k*c > k*c_m", "c > c_m", k=(-3.0, "1")).jumps) == 1
    below = model("c/c_m > 1", "c > c_m", c_m=(-2.0, "1"))
    assert len(below.jumps) == 1
    done = fp.sensitivities(below, fp.Experiments([[-3.0, 0.0]], [[0.0]], [6.0]), [0.5, 2.0, 1.0])
    np.testing.assert_allclose(done.x[0], [3.0, 0.5 * 1.0 + 2.0 * 5.0], rtol=1e-9)


@pytest.mark.parametrize("c_m", [2.0, -2.0])
def test_a_parameter_of_either_sign_tells_the_side(c_m: float) -> None:
    """c/c_m > 1 is c > c_m or c < c_m."""
    one = model("c > c_m", "c/c_m > 1")
    a, b, start, end = 0.5, 2.0, -3.0, 3.0
    done = fp.sensitivities(one, fp.Experiments([[start, 0.0]], [[0.0]], [end - start]), [a, b, c_m, 1.0])
    assert done.status[0] == fp.Status.ok
    above, below = end - c_m, c_m - start
    second = above if c_m > 0 else below
    np.testing.assert_allclose(done.x[0], [end, a * above + b * second], rtol=1e-9)
    slope = -a - b if c_m > 0 else b - a
    np.testing.assert_allclose(done.dx_dtheta[0, 1], [above, second, slope, 0.0], rtol=1e-9, atol=1e-12)


def test_what_reads_a_side_by_its_value_alone_does_not_forbid_to_cross() -> None:
    """|v| - w is continuous at v = 0, whatever w is; v - sign(x) is not at x = 0."""
    states, parameters = dict.fromkeys(("v", "x"), "1"), dict.fromkeys(("w", "k"), "1")
    zone = fp.SymbolicModel(["-v", "k*sign(v)*max(abs(v) - w, 0)"], ["x"], states, {"u": "1"}, parameters, check_units=False)
    assert zone.jumps == zone.crossable == ("v",)
    nested = fp.SymbolicModel(["where(v - sign(x) > 0, w, k)", "1"], ["x"], states, {"u": "1"}, parameters, check_units=False)
    assert set(nested.jumps) - set(nested.crossable) == {"x"}
