"""Models as Python functions: the tanks example, what a mistake says, and models as objects."""

from __future__ import annotations

import copy
import math
import pickle
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

import fisherpoint as fp

TANKS: dict[str, Any] = {
    "states": {"h1": "m", "h2": ("m", 0.1)},
    "inputs": {"u": "V"},
    "parameters": {"k1": "m^0.5/s", "k2": "m^0.5/s", "k3": "m^0.5/s", "k4": "m/(V s)"},
    "outputs": {"y": "m"},
}
THETA = [0.05, 0.04, 0.06, 0.03]


@fp.model(**TANKS)
def tanks(x: Any, u: Any, p: Any) -> Any:
    return [-p.k1 * fp.math.sqrt(x.h1) + p.k4 * u.u, p.k2 * fp.math.sqrt(x.h1) - p.k3 * fp.math.sqrt(x.h2)], [x.h2]


def test_tanks_run_with_exact_sensitivities() -> None:
    def end(theta: list[float]) -> float:
        def rates(_: float, h: Any) -> list[float]:
            return [-theta[0] * math.sqrt(h[0]) + theta[3] * 1.5, theta[1] * math.sqrt(h[0]) - theta[2] * math.sqrt(h[1])]

        return float(solve_ivp(rates, (0.0, 3.0), [0.5, 0.3], rtol=1e-11, atol=1e-13).y[1, -1])

    done = fp.sensitivities(tanks, fp.Experiments([[0.5, 0.3]], [1.5], [3.0]), THETA, rtol=1e-10)
    assert done.status.tolist() == [0]
    assert done.y[0, 0] == pytest.approx(end(THETA), rel=1e-9)
    for k, step in enumerate(1e-4 * np.eye(4)):
        difference = (end(list(THETA + step)) - end(list(THETA - step))) / 2e-4
        assert done.dy_dtheta[0, 0, k] == pytest.approx(difference, rel=1e-5)
    assert tanks.domain == ("h1", "h2") and tanks.name == "tanks"


def test_sympy_matrices_lists_and_texts_are_the_same_model() -> None:
    h1, h2, u, k1, k2, k3, k4 = sympy.symbols("h1 h2 u k1 k2 k3 k4")
    f = sympy.Matrix([-k1 * sympy.sqrt(h1) + k4 * u, k2 * sympy.sqrt(h1) - k3 * sympy.sqrt(h2)])
    by_symbols = fp.SymbolicModel(f, sympy.Matrix([h2]), **TANKS, name="tanks")
    texts = ["-k1*sqrt(h1) + k4*u", "k2*h1**0.5 - k3*sqrt(h2)"]
    assert tanks == by_symbols == fp.SymbolicModel(texts, ["h2"], **TANKS, name="tanks")
    t = sympy.Symbol("t")
    moving = {h1: sympy.Function("h1")(t), h2: sympy.Function("h2")(t)}  # as sympy.physics.mechanics has them
    assert tanks == fp.SymbolicModel(f.subs(moving), [moving[h2]], **TANKS, name="tanks")


def test_states_are_reached_by_name_place_and_unpacking() -> None:
    @fp.model(**TANKS, name="tanks")
    def by_place(x: Any, u: Any, p: Any) -> Any:
        h1, h2 = x
        assert len(x) == 2 and x[1] is h2
        return [-p.k1 * fp.math.sqrt(h1) + p.k4 * u[0], p.k2 * fp.math.sqrt(h1) - p.k3 * fp.math.sqrt(h2)], [h2]

    assert by_place == tanks


def test_numbers_that_sympy_keeps_exact_and_every_function() -> None:
    @fp.model(states={"x": "1"}, parameters={"a": "1"}, constants={"c": 2.0, "d": (3.0, "rad")})
    def all_of_them(x: Any, u: Any, p: Any) -> Any:
        f = (
            sympy.pi * x.x
            + sympy.sqrt(2) * p.c
            + fp.math.exp(-x.x) * fp.math.tanh(p.d)
            + fp.math.where((x.x > 0) & (p.a < 1), 1, 2)
        )
        return [f + fp.math.min(x.x, 3) + fp.math.max(x.x, p.a, 0) + fp.math.abs(x.x) * fp.math.heaviside(p.a)], [
            fp.math.log(2 + fp.math.sin(x.x))
        ]

    expected = math.pi * 0.5 + math.sqrt(2) * 2 + math.exp(-0.5) * math.tanh(3) + 1 + 0.5 + 0.7 + 0.5
    assert all_of_them.rhs([0.5], [], [0.7]) == pytest.approx([expected], rel=1e-14)
    assert all_of_them.output([0.5], [], [0.7]) == pytest.approx([math.log(2 + math.sin(0.5))])


def test_objects(capsys: pytest.CaptureFixture[str]) -> None:
    for again in (pickle.loads(pickle.dumps(tanks)), copy.copy(tanks), copy.deepcopy(tanks)):
        assert again == tanks and hash(again) == hash(tanks)
        assert again.rhs([0.5, 0.3], 1.0, THETA).tolist() == tanks.rhs([0.5, 0.3], 1.0, THETA).tolist()
    other = tanks.fix(k1=0.05)
    assert other != tanks and other.estimate("k1") != tanks  # k1 comes last now
    assert tanks != fp.SymbolicModel(["k1*h1", "h2"], ["h2"], **TANKS, name="tanks", check_units=False)
    assert repr(tanks) == "SymbolicModel('tanks', 2 states, 1 input, 4 parameters, 1 output)"
    print(fp.SymbolicModel(["-k*sign(v) + c*max(v, 1)"], ["v"], {"v": "m/s"}, {}, {"k": "m/s2"}, constants={"c": (2, "s-1")}))
    text = capsys.readouterr().out
    for part in ("k [m/s2]", "c = 2 [s-1]", "dv/dt = -k*sign(v) + c*max(v, 1)", "jumps       v = 0", "kinks       v - 1 = 0"):
        assert part in text
    assert "sqrt" in tanks._repr_latex_() and tanks._repr_latex_().startswith("$")


def test_importing_fisherpoint_does_not_import_sympy() -> None:
    code = "import sys, fisherpoint; assert 'sympy' not in sys.modules; fisherpoint.math; assert 'sympy' in sys.modules"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def make(f: Any = ("-k*x",), g: Any = ("x",), **changes: Any) -> fp.SymbolicModel:
    arguments = {"states": {"x": "m"}, "inputs": {"u": "V"}, "parameters": {"k": "1/s"}, "outputs": {"y": "m"}}
    return fp.SymbolicModel(f, g, **(arguments | changes))


def decorated(function: Callable[..., Any]) -> fp.SymbolicModel:
    return fp.model(states={"x": "m"}, inputs={"u": "V"}, parameters={"k": "1/s"}, outputs={"y": "m"})(function)


def branching(x: Any, u: Any, p: Any) -> Any:
    if x.x > 0:
        return [x.x], [x.x]
    return [p.k], [x.x]


def unknown_on_line_3(x: Any, u: Any, p: Any) -> Any:
    rate = -p.k * x.x
    return [rate + x.speed], [x.x]


MISTAKES: dict[str, Callable[[], Any]] = {
    r"equations\.x: column 4: expected the names x, u, k; given 'q'": lambda: make(["-k*q"]),
    r"equations\.x: expected the names x, u, k; given unknown 'q'": lambda: make([sympy.Symbol("q")]),
    r"equations\.y: column 1: expected the functions sqrt.*; given 'gamma": lambda: make(g=["gamma(x)"]),
    r"equations\.y: expected the functions sqrt.*; given gamma": lambda: make(g=[sympy.gamma(sympy.Symbol("x"))]),
    r"equations\.x: expected finite real numbers, given a division by zero": lambda: make([sympy.zoo]),
    r"equations\.x: expected finite real numbers, given I": lambda: make([sympy.I * sympy.Symbol("x")]),
    r"equations\.x: expected exponents of at most 1000": lambda: make([sympy.Symbol("x") ** 100000]),
    r"equations\.x: expected an expression, given \[1\]": lambda: make([[1]]),
    r"f: expected 1 equations, one for each of x; given 2": lambda: make(["x", "k"]),
    r"g: expected 1 equations, one for each of y; given 0": lambda: make(g=[]),
    r"equations\.y: expected an output that depends on something, given 2.*c": lambda: make(g=["2*c"], constants={"c": 1.0}),
    r"states\.x: expected a unit such as .*given 'furlong'": lambda: make(states={"x": "furlong"}),
    r"parameters\.k: expected a unit such as .* unknown unit 'k'": lambda: make(parameters={"k": "k"}),
    r"constants\.c: expected a unit such as": lambda: make(constants={"c": (1.0, "m^")}),
    r"constants\.c: expected finite numbers": lambda: make(constants={"c": (math.nan, "m")}),
    r"states\.x\.scale: expected a positive number, given -1": lambda: make(states={"x": ("m", -1.0)}),
    r"inputs\.k: .*|parameters\.k: expected a name of its own, given one that is among the inputs": lambda: make(inputs={"k": "V"}),
    r"states\.'lambda': expected a name that is not in use": lambda: make(states={"lambda": "m"}),
    r"states\.'sqrt': expected a name that is not in use": lambda: make(states={"sqrt": "m"}),
    r"states\.'dt': expected a name that is not in use": lambda: make(states={"dt": "m"}),
    r"states\.'2x': expected a name of letters": lambda: make(states={"2x": "m"}),
    r"states\.'__class__': expected a name of letters": lambda: make(states={"__class__": "m"}),
    r"parameters: expected at least one, given none": lambda: make(["-x"], parameters={}),
    r"states: expected a state or an input, given neither": lambda: make([], ["k"], states={}, inputs={}),
    r"states: expected at most 1000, given 1001": lambda: make(["x"] * 1001, states={f"x{i}": "m" for i in range(1001)}),
    r"parameters: expected at most 1000, given 100000": lambda: make(parameters={f"2k{i}": "furlong" for i in range(100_000)}),
    r"inputs: expected at most 1000, given 100000": lambda: make(inputs={f"2k{i}": "furlong" for i in range(100_000)}),
    r"outputs: expected at most 1000, given 100000": lambda: make(outputs={f"2k{i}": "furlong" for i in range(100_000)}),
    r"constants: expected at most 1000, given 100000": lambda: make(constants={f"2k{i}": (1.0, "furlong") for i in range(100_000)}),
    r"states: expected at most 1000, given 100000": lambda: fp.model(states={f"2x{i}": "m" for i in range(100_000)}, parameters={})(
        len
    ),
    r"nominal: expected names of k; given unknown 'q'": lambda: make(nominal={"q": 1.0}),
    r"domain\[0\]: column 1: expected the names x, u, k; given 'z'": lambda: make(domain=["z"]),
    r"name: expected a name, given ''": lambda: make(name=""),
    r"branching, line 2: expected conditions.*where.* instead of if.*given x > 0": lambda: decorated(branching),
    r"unknown_on_line_3, line 3: x: expected one of x; given unknown 'speed'": lambda: decorated(unknown_on_line_3),
    r"<lambda>, line 1: expected .*fisherpoint\.math": lambda: decorated(lambda x, u, p: ([math.sqrt(x.x)], [x.x])),
    r"<lambda>: expected it to return f, g or f, g, domain": lambda: decorated(lambda x, u, p: [x.x]),
}


@pytest.mark.parametrize("expected", MISTAKES)
def test_a_mistake_is_one_line_that_names_the_place(expected: str) -> None:
    with pytest.raises((ValueError, TypeError), match=f"^({expected})") as caught:
        MISTAKES[expected]()
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 400
