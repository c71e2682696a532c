"""Whether f jumps on a surface or has a kink there: models of known answer, and sensitivities next to another integrator."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import fisherpoint as fp
from fisherpoint.models.surfaces.evaluate import evaluate


def model(rate: str, constants: dict[str, float] | None = None, domain: tuple[str, ...] = ()) -> fp.SymbolicModel:
    """Three states, with the rate of the first."""
    return fp.SymbolicModel(
        [rate, "b*x", "k*x"],
        ["x"],
        dict.fromkeys(("x", "y", "v"), "1"),
        dict.fromkeys(("u", "w"), "1"),
        dict.fromkeys(("a", "b", "k"), "1"),
        constants={"c": 105.0} if constants is None else constants,
        domain=domain,
    )


MANY = " and ".join(f"u > {i}*a" for i in range(30))

JUMPS = {
    # what is zero for most inputs, parameters or states, and not for others
    "3*heaviside(u - 5)*heaviside(x - 1)": "x - 1",
    "3*heaviside(-1e6 - u)*heaviside(x - 1)": "x - 1",
    "max(c - 100, 0)*heaviside(x - 1)": "x - 1",
    "-k*heaviside(u - 12)*sign(v)": "v",
    "-k*where(abs(u) > 1e-9, 0, 1)*sign(v)": "v",
    "where(a < -300, heaviside(x), 1)": "x",
    "min(w, a)*sign(v)": "v",
    "max(u - 1e4, 0)*sign(v)": "v",
    "(abs(u) - u)*sign(v)": "v",
    "(where(u > 1, 1, 0) - where(w > 1, 1, 0))*sign(v)": "v",
    "where(u > 1 and w > 2 and a > 3 and b > 4 and k > 5, 1, 0)*sign(v)": "v",
    f"where({MANY}, 1, 0)*sign(v)": "v",
    "where(not (u > 1 or w > 2), sign(v), 0)": "v",
    "where(u > 1, where(u > 2, where(u > 3, sign(v), v), v), v)": "v",
    "max(x - 1000, 0)*sign(v)": "v",
    "where(y > 50, sign(v), 0) + 0*heaviside(y - 50)": ("y - 50", "v"),
    # small beside what does not jump
    "1e12*y + heaviside(x)": "x",
    "k*(1e12*y + heaviside(x))": "x",
    "heaviside(x - 1)*(1e9*(x - 1) + 1e-3)": "x - 1",
    "1e9*max(x, 0) + 1e-6*heaviside(x)": "x",
    "1e-200*heaviside(x)": "x",
    # a surface of several parts, on some of which f jumps
    "where(x*y > 0, x, 0)": "x*y",
    "where(x*y + x > 0, x, 0)": "x*y + x",
    "where(x**2 - 3*x + 2 > 0, x - 1, 0)": "x**2 - 3*x + 2",
    "where((x - 1)*(x - 2) > 0, x - 1, 0)": "(x - 2)*(x - 1)",
    "where(x**2 > y, x - sqrt(y), 0)": "x**2 - y",
    # what is the same at one side of another surface only
    "where(v > 0, heaviside(x), x)": ("v", "x"),
    "where(x < a, 0, where(x < b, x - a, b - a))": "x - a",
    # by way of another surface
    "sign(x + heaviside(u - 9)*sign(v))": ("v", "x + heaviside(u - 9)*sign(v)"),
}

KINKS = {
    # max, min and abs of what is continuous, with poles, without a point where they are equal, of any size
    "max(1/(x - 1), 5)": "1/(x - 1) - 5",
    "abs(1/x)": "x",
    "x*log(abs(x))": "x",
    "max(1/(1 + x**2), 0)": "1/(x**2 + 1)",
    "max(exp(-x), -1)": "1 + exp(-x)",
    "k*max(tanh(x), 2)": "tanh(x) - 2",
    "max(1e200*x, 1e-200*a)": "1e+200*x - 1e-200*a",
    "min(exp(1000*x), exp(-1000*x))": "exp(-1000*x) - exp(1000*x)",
    "abs(x)**0.3": "x",
    "abs(sin(x)*exp(y))": "sin(x)",
    "max(c*x, a*y)/max(u, w)": "a*y - c*x",
    "k*sqrt(max(x - a, 0)) - b*max(min(x - a, c), 0)": ("x - a", "x - a - c", "min(c, x - a)"),
    # what is written with conditions, but is continuous
    "heaviside(x) + heaviside(-x)": "x",
    "max(c - 200, 0)*heaviside(x - 1)": "x - 1",
    "where(x > a, where(u > 5, b*(x - a), (x - a)**2), 0)": "x - a",
    "where(u > 0, max(x, 0), min(x, 0))": "x",
    "where(x < 1, 2*x, where(x < 2, x + 1, 3))": ("x - 2", "x - 1"),
    "where(x < 0.1, 3*x, where(x < 0.2, 0.3 + 2*(x - 0.1), 0.5 + 0.7*(x - 0.2)))": ("x - 0.2", "x - 0.1"),
    "where(x > 1 and v > 2, (x - 1)*(v - 2), 0)": ("x - 1", "v - 2"),
    "where(u > 1, x, 0)*where(u > 1, heaviside(x), 1)": "x",
    "where(x**2 > y, x - sqrt(y), 0) + log(x)": "x**2 - y",
    "sign(v)*(cosh(v) - 1)": "v",
    "where(x**3 + x > a, (x**3 + x - a)*k, sin(x**3 + x - a))": "x**3 - a + x",
    "heaviside(abs(x) - a)*(x**2 - a**2)": ("x", "abs(x) - a"),
}


def listed(names: str | tuple[str, ...]) -> list[str]:
    return sorted([names] if isinstance(names, str) else names)


@pytest.mark.parametrize("rate", JUMPS)
def test_a_jump_is_one_where_f_differs_for_any_value_of_what_else_there_is(rate: str) -> None:
    assert sorted(model(rate).jumps) == listed(JUMPS[rate])


@pytest.mark.parametrize("rate", KINKS)
def test_what_is_continuous_whatever_else_there_is_has_kinks_alone(rate: str) -> None:
    found = model(rate)
    assert found.jumps == ()
    assert sorted(found.kinks) == listed(KINKS[rate])


def test_constants_are_what_they_are_until_they_are_estimated() -> None:
    rate = "max(c - 100, 0)*heaviside(x - 1)"
    assert model(rate, {"c": 105.0}).jumps == ("x - 1",)
    below = model(rate, {"c": 95.0})
    assert below.kinks == ("x - 1",)
    assert below.estimate("c").jumps == ("x - 1",)
    assert model(rate, {"c": 105.0}).estimate("c").fix(c=95.0).kinks == ("x - 1",)


def test_an_order_that_the_domain_tells_is_used() -> None:
    rate = "where(x < a, 0, where(x < b, x - a, b - a))"
    assert model(rate, domain=("b - a",)).jumps == ()
    assert model("heaviside(a - b)*sign(v)", domain=("b - a",)).jumps == ()
    assert model("heaviside(b - a)*sign(v)", domain=("b - a",)).jumps == ("v",)


def test_a_jump_among_many_kinks_is_found() -> None:
    rate = f"where({' and '.join(f'x > {i}*a' for i in range(12))}, x, 1)"
    assert len(model(rate).jumps) == 12
    rate = f"where({' and '.join(f'x > {i}*a' for i in range(12))}, 1, 1)*x"
    assert len(model(rate).jumps) == 0


def brake(u: float) -> Any:
    return lambda x, p: [x[1], -(p[1] * np.sign(x[1]) if u > 12 else 0.0) - p[0] * x[0]]


def play(x: Any, p: Any) -> list[float]:
    return [x[1], -p[0] * (x[0] - 0.5 if x[0] > 0.5 else x[0] + 0.5 if x[0] < -0.5 else 0.0) - p[1] * x[1]]


BRAKE = ["w", "-T_b*heaviside(u - 12)*sign(w) - p*x"]
SWITCHED: dict[str, tuple[list[str], Any, float, list[float], list[float], float]] = {
    # rates of x and w, the same in Python, input, start, parameters p and T_b, duration
    "an input": (
        ["p + heaviside(u - 5)*3*heaviside(x - 1)", "0*w"],
        lambda x, p: [p[0] + (3.0 if x[0] > 1 else 0.0), 0.0],
        12.0,
        [0.0, 1.0],
        [1.0, 1.0],
        2.0,
    ),
    "a constant": (
        ["p + max(c - 100, 0)*heaviside(x - 1)", "0*w"],
        lambda x, p: [p[0] + (5.0 if x[0] > 1 else 0.0), 0.0],
        0.0,
        [0.0, 1.0],
        [1.0, 1.0],
        2.0,
    ),
    "a brake": (BRAKE, brake(24.0), 24.0, [-1.0, 2.0], [3.0, 0.8], 1.5),
    "no brake": (BRAKE, brake(6.0), 6.0, [-1.0, 2.0], [3.0, 0.8], 0.5),
    "play": (
        ["w", "-p*where(x > 0.5, x - 0.5, where(x < -0.5, x + 0.5, 0)) - T_b*w"],
        play,
        0.0,
        [1.0, 0.0],
        [9.0, 0.2],
        2.5,
    ),
    "a limiter": (
        ["p*min(max(u - 3*x, -1), 1)", "T_b*max(x, 0.5)"],
        lambda x, p: [p[0] * min(max(2.0 - 3 * x[0], -1.0), 1.0), p[1] * max(x[0], 0.5)],
        2.0,
        [0.0, 0.0],
        [1.5, 0.7],
        1.2,
    ),
}


@pytest.mark.parametrize("case", SWITCHED)
def test_sensitivities_with_conditions_are_differences_of_another_integrator_or_the_jump_is_met(case: str) -> None:
    rates, by_hand, u, x0, theta, duration = SWITCHED[case]

    accurate: dict[str, Any] = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-12, "max_step": duration / 300}

    def end(at: Any) -> Any:
        return solve_ivp(lambda _, x: by_hand(x, at), (0.0, duration), x0, **accurate).y[:, -1]

    constants = {"c": 105.0} if case == "a constant" else {}
    found = fp.SymbolicModel(rates, ["x"], {"x": "1", "w": "1"}, {"u": "1"}, {"p": "1", "T_b": "1"}, constants=constants)
    done = fp.sensitivities(found, fp.Experiments([x0], [[u]], [duration]), theta, rtol=1e-9)
    differences = np.column_stack([(end(theta + step) - end(theta - step)) / 2e-4 for step in 1e-4 * np.eye(2)])
    crossed = {"an input": 5.0, "a constant": 7.0, "a brake": differences[0, 0]}
    if case in crossed:  # where f is held on the side of the start, the state goes on as if it had not jumped
        assert differences[0, 0] == pytest.approx(crossed[case], rel=1e-3)
        assert done.status.tolist() == [fp.Status.met_jump]
    else:
        assert done.status.tolist() == [fp.Status.ok]
        np.testing.assert_allclose(done.dx_dtheta[0], differences, rtol=1e-3, atol=1e-4)


ATOMS = st.sampled_from(["x", "y", "x", "y", "u", "w", "a", "b", "c", "1", "2", "0.3", "1e3"])


def _joined(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    return st.one_of(
        st.builds("({} {} {})".format, inner, st.sampled_from("+-*"), inner),
        st.builds("{}({})".format, st.sampled_from(["sign", "heaviside", "abs", "tanh"]), inner),
        st.builds("{}({}, {})".format, st.sampled_from(["max", "min"]), inner, inner),
        st.builds("where({} > {}, {}, {})".format, inner, inner, inner, inner),
        st.builds("where({} > {} {} {} <= {}, {}, {})".format, inner, inner, st.sampled_from(["and", "or"]), *[inner] * 4),
    )


@settings(max_examples=60, deadline=None)
@given(st.recursive(ATOMS, _joined, max_leaves=10), st.integers(0, 2**32))
def test_wherever_f_jumps_on_a_line_a_jump_is_named(rate: str, seed: int) -> None:
    try:
        found = model(rate)
    except ValueError:
        return  # such as a division by zero
    rng, equations = np.random.default_rng(seed), found.equations
    size = 10.0 ** rng.uniform(-3, 3, size=(2, 8)) * rng.choice([-1, 1], size=(2, 8))
    start, slope, u, theta = size[0, :3], size[1, :3], size[0, 3:5], size[0, 5:]
    known = {**equations.constants, **dict(zip((*equations.inputs, *equations.parameters), (*u, *theta), strict=True))}

    def f(t: Any) -> Any:
        x = start[:, None] + slope[:, None] * t
        return np.broadcast_to(evaluate(equations.rates[:1], known | dict(zip(equations.states, x, strict=True)))[0], np.shape(t))

    t = np.sort(np.tan(rng.uniform(-1.5, 1.5, 300)))
    low, high, size_f = t[:-1], t[1:], np.abs(f(t)).max()
    for _ in range(60):  # towards the larger of two steps
        middle = (low + high) / 2
        lower = np.abs(f(middle) - f(low)) > np.abs(f(high) - f(middle))
        low, high = np.where(lower, low, middle), np.where(lower, middle, high)
    jumping = np.abs(f(high) - f(low)) > 1e-6 * size_f
    aside = 1e-8 * np.maximum(np.abs(low), 1e-3)
    for before, after in zip((low - aside)[jumping], (high + aside)[jumping], strict=True):
        values = found.switching(start + slope * np.array([[before], [after]]), u, theta)[:, : len(found.jumps)]
        assert (values[0] * values[1] <= 0).any(), (rate, before, after)


@pytest.mark.parametrize(
    "branch",
    [
        "sign(heaviside(u) * sign(a - 1) - 1)",
        "sign(heaviside(u) * heaviside(a - 1) - 1)",
        "sign(sign(a - 1) * sign(u) * sign(u) - 1)",
        "sign(sign(a - 1) + sign(u))",
        "where(heaviside(u) * sign(a - 1) >= 1, 1, 0)",
        "where(heaviside(u) * sign(a - 1) > 1, 1, 0)",
        "heaviside(heaviside(u) * heaviside(a - 1) - 1)",
    ],
)
def test_a_condition_that_is_zero_itself_on_one_side(branch: str) -> None:
    """Where a condition takes the value 0 on a whole side, the sign there is 0, and neither 1 nor -1."""
    model = fp.SymbolicModel(["1", branch], ["x"], {"a": "1", "x": "1"}, {"u": "1"}, {"p": "1"})
    below, above = (model.rhs([[a, 0.0]] * 2, [[1.0], [-1.0]], [1.0])[:, 1] for a in (0.5, 1.5))
    assert ("a - 1" in model.jumps) == bool((below != above).any())


@pytest.mark.parametrize(
    "rate",
    [
        "-100 * (x - cos(y / 1e-12)) + p * sign(2 * x + 0.3)",
        "0.001 * (-100 * (x - cos(y / 1e-12)) + p * sign(2 * x + 0.3))",
        "-100 * (x - cos(y / 1e-11)) + (p / 1e-9) * heaviside(2 * x + 0.3)",
    ],
)
@pytest.mark.parametrize("names", ["xyp", "zyp", "yzq", "abc", "qrs"])
def test_a_jump_beside_a_term_that_is_huge_where_it_is_looked_at(rate: str, names: str) -> None:
    """The names decide in which order random numbers are drawn: in one of five, at least, the cosine hid the jump."""
    x, y, p = names
    rate = re.sub(r"\b[xyp]\b", lambda found: names["xyp".index(found[0])], rate)
    model = fp.SymbolicModel([rate, "1"], [x], {x: "1", y: "1"}, {}, {p: "1"})
    assert f"2*{x} + 0.3" in model.jumps
