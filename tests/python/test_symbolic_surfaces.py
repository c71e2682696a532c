"""What a model finds in its equations: switching surfaces, jump or kink, and where f and g have a value."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
import sympy as sp

import fisherpoint as fp
from fisherpoint.models.surfaces.evaluate import evaluate


def model(rate: str, **changes: Any) -> fp.SymbolicModel:
    """Three states, with the rate of the first."""
    arguments: dict[str, Any] = {
        "f": [rate, "b*x", "k*x"],
        "g": ["b*x + k*y"],
        "states": dict.fromkeys(("x", "y", "v"), "1"),
        "inputs": {"u": "1"},
        "parameters": dict.fromkeys(("a", "b", "k"), "1"),
        "outputs": {"z": "1"},
    }
    return fp.SymbolicModel(**(arguments | changes))


@pytest.mark.parametrize(
    ("f", "jumps", "kinks"),
    [
        ("a*sign(v)", ["v"], []),
        ("sign(v)*v", [], ["v"]),
        ("heaviside(x)", ["x"], []),
        ("x*heaviside(x)", [], ["x"]),
        ("x*heaviside(x) + y*heaviside(-x)", ["x"], []),
        ("abs(v)", [], ["v"]),
        ("max(x - a, 0)", [], ["x - a"]),
        ("min(k*(x - a), b)", [], ["k*(x - a) - b"]),
        ("max(x, y, v)", [], ["v - x", "max(v, x) - y"]),
        ("where(x > a, b*(x - a), 0)", [], ["x - a"]),
        ("where(x > a, b, 0)", ["x - a"], []),
        ("where(a >= x, b, 0)", ["a - x"], []),
        ("where(x > a and y > 0, x - a, 0)", ["y"], ["x - a"]),
        ("where(x > 0 or y > 0, 1, 0)", ["x", "y"], []),
        ("where(x > 0, where(y > 0, x*y, 0), 0)", [], ["y", "x"]),
        ("where(x**2 + y**2 < 1, 1 - x**2 - y**2, 0)", [], ["x**2 + y**2 - 1"]),
        ("where(x**2 + y**2 < 1, 1, 0)", ["x**2 + y**2 - 1"], []),
        ("a*where(sin(x) > b, sin(x) - b, 0)", [], ["sin(x) - b"]),
        ("where(x > 1, x, y)**where(x > 1, x, y)", ["x - 1"], []),
        ("x**where(x > 0, x, y)", ["x"], []),
        ("exp(where(x > y, x, 1))", ["x - y"], []),
        ("where(exp(x)*y > b, exp(2*x)*y**2 - b**2, 0)", [], ["y*exp(x) - b"]),
        ("a*(sqrt(x*x + 1) - 1)*sign(x)", [], ["x"]),
        ("sqrt(x**2)", [], ["x"]),
        # one surface, however it is scaled or turned
        ("sign(-2*v) + 3*sign(v) + abs(3*v)", ["v"], []),
        ("abs(x - y) + abs(2*y - 2*x)", [], ["x - y"]),
        ("sign(v*exp(x))", ["v"], []),
        # from the inside out: f jumps at v = 0 only by way of the other surface
        ("abs(abs(x) - 1)", [], ["x", "abs(x) - 1"]),
        ("sign(x + sign(v))", ["v", "x + sign(v)"], []),
        # the condition is zero on all of a side
        ("x*heaviside(x*heaviside(x))", [], ["x"]),
        ("where(max(x, 0) > 0, x, 0)", [], ["x"]),
        ("max(x, 0)*heaviside(a*max(x, 0))", [], ["x"]),
        ("max(heaviside(x)*x, 0)", [], ["x"]),
        # what no state enters cannot be crossed
        ("sign(u)*x + abs(a)*x + max(u, a)*x", [], []),
        ("sign(2 + sign(v))*x", [], ["v"]),
    ],
)
def test_surfaces_and_their_kinds(f: str, jumps: list[str], kinks: list[str]) -> None:
    found = model(f)
    assert sorted(found.jumps) == sorted(jumps)
    assert sorted(found.kinks) == sorted(kinks)


@pytest.mark.parametrize(
    "f",
    [
        "x*heaviside(x) + y*heaviside(-x)",
        "min(k*(x - a), b)",
        "max(x, y, v, 0.5)",
        "where(x > a and (y > 0 or not v >= u), x - a, where(u < 1, y, k))",
        "abs(abs(x) - 1) + sign(x + sign(v))",
        "sign(-2*v) + 3*sign(v) + abs(3*v)",
        "where(u >= 1, 1, 2)*x + where(1 >= u, 3, 4)*x",
        "b/max(x**2, 1)",
    ],
)
def test_f_by_sides_is_f(f: str) -> None:
    found, rng = model(f), np.random.default_rng(1)
    programs, surfaces = found.structure.programs, len(found.jumps + found.kinks)
    x, u, theta = rng.normal(size=(200, 3)), rng.normal(size=(200, 1)), rng.normal(size=(200, 3))
    u[:20] = 1.0
    side = np.ones((200, surfaces))
    for _ in range(surfaces + 1):  # a surface may read the side of another
        side = np.where(programs.surfaces.evaluate(theta, u, x, side, x)[:, :surfaces] > 0, 1.0, -1.0)
    equations = found.equations
    columns = zip([*equations.states, *equations.inputs, *equations.parameters], [*x.T, *u.T, *theta.T], strict=True)
    expected = np.column_stack(evaluate(equations.rates, dict(columns)))
    np.testing.assert_allclose(programs.rates.evaluate(theta, u, x, side, x), expected, rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(found.rhs(x, u, theta), expected, rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize(
    ("f", "poles", "domain"),
    [
        ("sqrt(x)", [], ["x"]),
        ("1/x", ["x"], []),
        ("1/sqrt(x)", [], ["x"]),
        ("x**1.5 + x**a", [], ["x"]),
        ("x**-2 + x**3", ["x"], []),
        ("log(x*y)", [], ["x*y"]),
        ("asin(x)", [], ["1 - x", "x + 1"]),
        ("tan(x)", ["cos(x)"], []),
        ("1/(x - y) + 1/(y - x)", ["x - y"], []),
        ("x/(k + x)", ["k + x"], []),
        ("1/x + sqrt(2*x)", [], ["x"]),  # a root keeps its argument from zero
        ("sqrt(u)*x", [], ["u"]),
        ("sqrt(sqrt(x) + y)", [], ["sqrt(x) + y", "x"]),
        ("sqrt(x)/(1 + x)", [], ["x"]),  # positive as x is
        ("1/(1 + x**2) + sqrt(1 + exp(x)) + 1/(abs(x) + 1)", [], []),
        ("sqrt(a)*x/b", [], []),  # of the parameters alone
        ("sign(v)*sqrt(abs(v)) + where(x > 0, sqrt(x), 0) + where(y < 0, sqrt(-2*y), 1)", [], []),
        ("where(x > 0, sqrt(x), 0) + sqrt(x)", [], ["x"]),
    ],
)
def test_domain(f: str, poles: list[str], domain: list[str]) -> None:
    found = model(f)
    assert list(found.poles) == poles
    assert list(found.domain) == poles + domain


def test_the_angle_has_a_value_off_the_negative_axis() -> None:
    found = model("atan2(y, x)")
    limits = found.limits([[1.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, 1e-9, 0.0]], [0.0], np.ones(3))
    assert (limits[:, 0] > 0).tolist() == [True, True, False]


def test_a_branch_that_is_not_taken_forbids_nothing() -> None:
    found = model("where(x > 0, sqrt(x + a), b)")
    limit = found.limits([[1.0, 0.0, 0.0], [-5.0, 0.0, 0.0]], [0.0], np.ones(3))[:, 0]
    assert limit.tolist() == [2.0, 1.0]
    assert found.rhs([-5.0, 0.0, 0.0], 0.0, [1.0, 7.0, 1.0])[0] == 7.0


def test_limits_of_the_output_count_and_its_branches_are_no_surfaces() -> None:
    found = model("x", g=["log(y) + max(x, v)"])
    assert found.domain == ("y",)
    assert found.jumps == found.kinks == ()
    assert found.output([[1.0, 1.0, 3.0], [2.0, 1.0, -1.0]], [0.0], np.ones(3)).ravel().tolist() == [3.0, 2.0]


def test_conditions_of_the_user_count_once() -> None:
    found = model("x/(y - v)", domain=["2*y - 2*v", "x"])
    assert found.domain == ("y - v", "x") and found.poles == ()


def test_limits_of_parameters_are_checked_with_them() -> None:
    found = model("x/a + y/(a - b) + sqrt(k)")
    assert found.theta([1.0, 2.0, 3.0]).tolist() == [1.0, 2.0, 3.0]
    for theta, expected in (
        ([0.0, 1.0, 1.0], "a: expected a number other than 0, given 0"),
        ([1.0, 1.0, 1.0], "a - b: expected a number other than 0, given 0"),
        ([1.0, 2.0, -1.0], "k: expected a positive number, given -1"),
        ([[1.0, 2.0, 1.0], [1.0, 2.0, 0.0]], "k: expected a positive number, given 0"),
    ):
        with pytest.raises(ValueError, match=expected):
            found.theta(theta)
    with pytest.raises(ValueError, match=r"constants\.c: expected a positive number, given -1"):
        model("sqrt(c)*x", constants={"c": (-1.0, "m")})


def test_a_start_at_a_pole_or_on_a_surface_is_refused_by_name() -> None:
    found = model("1/y + sign(v)")
    points = fp.Experiments([[1.0, 1.0, 1.0], [1.0, 0.0, 1.0]], [0.0, 0.0], [0.1, 0.1])
    with pytest.raises(
        ValueError, match=r"points: expected starts off y = 0, a divisor of the model or an argument of its roots; .* points\[1\]"
    ):
        fp.simulate(found, points, np.ones(3))
    on_surface = fp.Experiments([[1.0, 1.0, 0.0]], [0.0], [0.1])
    with pytest.raises(ValueError, match=r"off the switching surface v = 0, .* given v = 0 in points\[0\]"):
        fp.simulate(found, on_surface, np.ones(3), jumps="exclude")
    with pytest.raises(ValueError, match=r"x: expected y other than 0; given x = \[1\. 0\. 1\.\]"):
        found.rhs([1.0, 0.0, 1.0], 0.0, np.ones(3))
    region = fp.ExperimentRegion({"x": (0, 1), "y": (0, 0), "v": (1, 2), "u": (0, 1), "dt": (0.1, 1)})
    with pytest.raises(ValueError, match=r"region\['y'\]: expected bounds off the pole y = 0"):
        region.check(found)


def test_a_kink_is_crossed_and_a_jump_ends_the_trajectory_where_it_is_excluded() -> None:
    points = fp.Experiments([[-1.0, 0.0, -1.0]], [0.0], [2.0])
    settings: dict[str, Any] = {"parameters": {"a": "1", "b": "1"}, "g": ["x*a"]}
    kink = model("", f=["where(x > 0, a + b*x, a)", "0*x", "1"], **settings)
    done = fp.simulate(kink, points, [1.0, 0.5], rtol=1e-9)
    assert done.status.tolist() == [fp.Status.ok]
    assert done.x[0, 0] == pytest.approx((np.exp(0.5) - 1) / 0.5, rel=1e-8)  # starts at 0 after one second
    jump = model("", f=["where(v > 0, 2*a, b)", "0*x", "1"], **settings)
    threshold = model("", f=["where(v > b, 2*a, b)", "0*x", "1"], **settings)
    assert fp.simulate(threshold, points, [1.0, 0.5], jumps="exclude").status.tolist() == [fp.Status.met_jump]
    done = fp.simulate(threshold, points, [1.0, 0.5])
    assert done.status.tolist() == [fp.Status.ok] and done.x[0, 0] == pytest.approx(-1 + 0.5 * 1.5 + 2.0 * 0.5, rel=1e-9)
    # The time of this one does not depend on the parameters.
    done = fp.simulate(jump, points, [1.0, 0.5], jumps="exclude")
    assert done.status.tolist() == [fp.Status.ok] and done.x[0, 0] == pytest.approx(-1 + 0.5 + 2.0, rel=1e-9)


def test_what_is_drained_by_a_root_and_filled_below_rests_on_the_surface() -> None:
    drained = fp.SymbolicModel(["where(x > 0, -a*sqrt(x), b)"], ["x"], {"x": "m"}, {}, {"a": "1", "b": "1"})
    points = fp.Experiments([[1.0], [1.0], [-1.0], [-1.0]], np.empty((4, 0)), [1.0, 3.0, 0.5, 3.0])
    done = fp.simulate(drained, points, [1.0, 1.0])
    assert not done.status.any()
    np.testing.assert_allclose(done.x[:, 0], [0.25, 0.0, -0.5, 0.0], rtol=1e-5, atol=1e-12)


H, U, P = sp.symbols("h u p")
INSIDE = {
    "text": "where(where(h > 0.5, h, p) > 0.4, u, p)",
    "of both sides": "where(max(h - 0.5, 0) > where(h > p, 1, 0.1), u, p)",
    "joined": "where(not where(h > 0.5, h, p) > 0.4 or u > 2, u, p)",
    "where": fp.math.where((fp.math.where(H > 0.5, H, P) > 0.4) & (U > 0), U, P),
    "Piecewise": sp.Piecewise((U, sp.Piecewise((H, H > 0.5), (P, True)) > 0.4), (P, True)),
    "ITE": fp.math.where(sp.ITE(H > 0.5, H > 0.4, P > 0.4), U, P),
}


@pytest.mark.parametrize("kind", INSIDE)
def test_cases_inside_a_condition_are_as_good_as_others(kind: str) -> None:
    made = fp.SymbolicModel([INSIDE[kind]], ["h"], {"h": "1"}, {"u": "1"}, {"p": "1"})
    points = fp.Experiments([[0.3], [0.3], [0.9]], [[0.7], [0.7], [0.7]], [0.1] * 3)
    # The second has a p below 0.4.
    y = fp.simulate(made, points, [[1.2], [0.2], [0.6]]).y[:, 0]
    first, second, third = {"of both sides": (1.2, 0.2, 0.6), "joined": (1.2, 0.7, 0.6)}.get(kind, (0.7, 0.2, 0.7))
    np.testing.assert_allclose(y, [0.3 + 0.1 * first, 0.3 + 0.1 * second, 0.9 + 0.1 * third], rtol=1e-9)
    freed = made.free_start("h")
    shifted = fp.simulate(freed, points, [[1.2, 0.0], [0.2, 0.0], [0.6, 0.0]]).y[:, 0]
    np.testing.assert_allclose(shifted, y, rtol=1e-12)


@pytest.mark.parametrize("condition", [sp.Xor(H > 1, U > 0), sp.Implies(H > 1, U > 0)])
def test_other_ways_to_join_conditions_are_refused_in_words(condition: Any) -> None:
    with pytest.raises(ValueError, match=r"^equations\.h: expected conditions that are joined by &, \| and ~, given "):
        fp.SymbolicModel([fp.math.where(condition, U, P)], ["h"], {"h": "m"}, {"u": "m/s"}, {"p": "m/s"})


@pytest.mark.parametrize("method", ["RK45", "DOP853"])
def test_what_is_left_and_met_again_within_a_step_is_seen(method: str) -> None:
    # max(sin(x), b, 0) is zero from pi to 4, then b > 0 up to 6: a step from 4 to 6 has zeros at both ends.
    model = fp.SymbolicModel(
        f=["p * y", "1 + max(sin(x), max(1 - (x - 5)**2, 0), 0)", "1.2 * x + max(q, tanh(z), 0)"],
        g=["x"],
        states={"x": "1", "y": "1", "z": "1"},
        inputs={},
        parameters={"p": "1", "q": "1"},
    )
    x0 = np.random.default_rng(0).uniform([0.0, -0.4, -2.0], [0.3, 0.0, -1.0], (2000, 3))
    points = fp.Experiments(x0, np.empty((2000, 0)), np.full(2000, 5.58))
    rough, fine = (fp.simulate(model, points, [0.5074, -4.2], rtol=rtol, method=method) for rtol in (1e-4, 1e-10))
    assert (rough.status == fp.Status.ok).all()
    assert np.abs(rough.x - fine.x).max() < 5e-3


@pytest.mark.parametrize(
    ("rate", "limit"),
    [
        ("sqrt(sqrt(max(x, 0)) + y)", "y + sqrt(max(0, x))"),
        ("log(where(x > 0 and y > 0, sqrt(max(x, 0)), y))", "where(x > 0 and y > 0, sqrt(max(0, x)), y)"),
        ("1/(max(x, 0)**1.5 - y)", "max(0, x)**(3/2) - y"),
        ("log(where(not x > 0 or y > 1, sqrt(max(y, 0)), a) - 1)", "where(x <= 0 or y > 1, sqrt(max(0, y)), a) - 1"),
        ("sqrt(where(a > 0, sqrt(max(y, 0)), x) - 1)", "where(a > 0, sqrt(max(0, y)), x) - 1"),
        ("sqrt(max(sqrt(max(x, 0)), y) - 1)", "max(y, sqrt(max(0, x))) - 1"),
        ("1/(sign(x)*sqrt(max(y, 0)) - a)", "sign(x)*sqrt(max(0, y)) - a"),
        ("sqrt(heaviside(x)*max(y, 0) - a)**3", "heaviside(x)*max(0, y) - a"),
    ],
)
def test_limits_are_called_as_they_are_written(rate: str, limit: str) -> None:
    model = fp.SymbolicModel([rate, "1"], ["x*a"], {"x": "1", "y": "1"}, {}, {"a": "1"}, check_units=False)
    assert limit in model.domain


def test_no_name_of_a_surface_or_limit_has_what_the_user_did_not_write() -> None:
    """Random nests of branches, roots and logarithms."""
    rng = np.random.default_rng(0)

    def term(depth: int) -> str:
        if depth == 0:
            return str(rng.choice(["x", "y", "a", "1", "2"]))
        one, two, three = (term(int(rng.integers(depth))) for _ in range(3))
        forms = [
            "sqrt(max({0}, 0))",
            "log({0} + {1})",
            "max({0}, {1})**1.5",
            "where({0} > {1} and y > 0, {2}, {1})",
            "abs({0})*{1}",
        ]
        forms += [
            "sign({0}) - {1}",
            "1/({0} - {1})",
            "where(not ({0} > 1 or x < {1}), {2}, 0)",
            "heaviside({0})*{1}",
            "sqrt({0} + {2})",
        ]
        return "(" + str(rng.choice(forms)).format(one, two, three) + ")"

    made = 0
    for _ in range(60):
        try:
            model = fp.SymbolicModel([term(3), "1"], ["x*a"], {"x": "1", "y": "1"}, {}, {"a": "1"}, check_units=False)
        except ValueError:  # a division by zero, a root of a negative number
            continue
        made += 1
        for name in (*model.jumps, *model.kinks, *model.domain):
            assert not re.search("Select|_side|Dummy|Piecewise|_[0-9]", name)
            fp.SymbolicModel([name, "1"], ["x*a"], {"x": "1", "y": "1"}, {}, {"a": "1"}, check_units=False)
    assert made > 20
