"""Units of equations that do not fit, and what is no mistake."""

from __future__ import annotations

import pickle
import warnings
from pathlib import Path
from typing import Any

import pytest

import fisherpoint as fp
from fisherpoint.design.file.configuration import load_config
from fisherpoint.models.codec import model_from_json, model_to_json

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"

UNITS = {"states": {"x": "m", "T": "K"}, "inputs": {"u": "V"}, "parameters": {"k": "1/s", "c": "m/(s V)", "E": "kJ/mol", "n": "1"}}


def mistakes(rate: str, output: str = "x", unit: str = "m", **units: Any) -> tuple[str, ...]:
    return fp.SymbolicModel([rate, "0"], [output], **(UNITS | units), outputs={"y": unit}, check_units=False).mistakes_in_units


@pytest.mark.parametrize(
    ("rate", "parameters", "expected"),
    [
        ("-k*x", {"k": "1/h"}, "equations.x: expected 1/s, as time is in s, given -k*x in 0.0002778 1/s"),
        ("u - k*x", {"k": "1/min"}, "equations.x: expected 1/s, as time is in s, given -k*x in 0.01667 1/s"),
        ("m*x/(n + x)", {"m": "1/d", "n": "1"}, "equations.x: expected 1/s, as time is in s, given m*x/(n + x) in 1.157e-05 1/s"),
        ("-k*x", {"k": "1/s"}, None),
        ("-k*x/3600", {"k": "1/h"}, None),  # a number that may carry a unit
        ("-k*x", {"k": "1"}, None),
        ("-k*x", {"k": "1/ms"}, None),  # no unit in which one forgets what time is in
    ],
)
def test_a_stated_time_is_certain_beside_one(rate: str, parameters: dict[str, str], expected: str | None) -> None:
    model = fp.SymbolicModel([rate], ["x"], {"x": "1"}, {"u": "1"}, parameters, {"y": "1"}, check_units=False)
    assert model.mistakes_in_units == (() if expected is None else (expected,))


@pytest.mark.parametrize(
    ("state", "constant", "told"), [("K", "degC", True), ("degC", "K", True), ("degC", "°C", False), ("K", "K", False)]
)
def test_temperatures_have_one_zero(state: str, constant: str, told: bool) -> None:
    given = (["-k*(T - T_a)"], ["T"], {"T": state}, {}, {"k": "1/s"}, {"y": state})
    found = fp.SymbolicModel(*given, constants={"T_a": (25.0, constant)}, check_units=False).mistakes_in_units
    of = ("T_a", "T") if constant == "degC" else ("T", "T_a")
    text = f"equations.T: {of[0]} in degC and {of[1]} in K cannot be added, as 0 degC is 273.15 K: expected one unit of both"
    assert found == ((text,) if told else ())
    other = fp.SymbolicModel(["-k*where(T > T_a, T, 0)"], *given[1:], constants={"T_a": (25.0, constant)}, check_units=False)
    assert bool(other.mistakes_in_units) == told


@pytest.mark.parametrize(
    ("rate", "expected"),
    [
        ("x**2 - k*x", "equations.x: x**2 in m2 and -k*x in m/s cannot be added"),
        ("u - k*x", "equations.x: u in kg m2/(s3 A) and -k*x in m/s cannot be added"),
        ("c*u - k*x**2", "equations.x: c*u in m/s and -k*x**2 in m2/s cannot be added"),
        ("k*x**2", "equations.x: expected m/s, given k*x**2 in m2/s"),
        ("-k*sqrt(x)", "equations.x: expected m/s, given -k*sqrt(x) in m^0.5/s"),
        ("-k*x*exp(-x)", "equations.x: expected a number without unit in exp(), given -x in m"),
        ("-k*x*tanh(u)", "equations.x: expected a number without unit in tanh(), given u in kg m2/(s3 A)"),
        ("-k*x*sin(T)", "equations.x: expected a number without unit in sin(), given T in K"),
        ("c*u - k*x**2/2", "equations.x: c*u in m/s and -k*x**2/2 in m2/s cannot be added"),
        ("-k*x*2**T", "equations.x: expected an exponent without unit, given T in K"),
        ("k*max(x, T)", "equations.x: T in K and x in m cannot be compared"),
        ("k*where(x > T, x, 1)", "equations.x: x in m and T in K cannot be compared"),
        ("k*where(x > 1, x, T)", "equations.x: x in m and T in K cannot be given by turns"),
        ("k*x*atan2(x, T)", "equations.x: x in m and T in K cannot be divided in atan2()"),
    ],
)
def test_a_mistake_names_equation_terms_and_units(rate: str, expected: str) -> None:
    assert expected in mistakes(rate)


@pytest.mark.parametrize(
    "rate",
    [
        "c*u - k*x",
        "-k*x*exp(-1000*E/(8.314*T))",  # numbers with units
        "-k*x*exp(u/(n*0.0259))",
        "-k*x*tanh(x/0.01)",
        "-k*(x - 0.3)",  # numbers that are added
        "-k*max(x, 0) - 2*k*x + k*abs(x)/3",
        "k*where(x > 0.3, x, 0)",
        "-k*sqrt(x**2)",
        "c*u*sign(x)*heaviside(u - 3)",
        "-k*x**n",  # a law that was fitted
        "-n*x + c*u",  # of n nobody said the unit
        "-k*x*log(T)",
        "-k*x*cos(x/x)",
        "9.81*n",
        "c*u - 0.1*x",
        "c*u - 0.5*x**2",
    ],
)
def test_what_may_be_meant_is_no_mistake(rate: str) -> None:
    assert mistakes(rate) == ()


def test_units_of_other_sizes_are_mistakes() -> None:
    minutes = UNITS["parameters"] | {"k": "1/min"}
    assert mistakes("-k*x", parameters=minutes) == ("equations.x: expected m/s, given -k*x in 0.01667 m/s",)
    assert mistakes("-60*k*x", parameters=minutes) == ()  # which may be the seconds of a minute
    assert mistakes("-k*x", unit="mm") == ("equations.y: expected 0.001 m, given x in m",)


def test_angles_have_no_unit_in_equations() -> None:
    joint = fp.SymbolicModel(
        ["w", "(M - b*w - G*sin(q))/J"],
        ["q"],
        {"q": "rad", "w": "rad/s"},
        {"M": "N m"},
        {"J": "kg m2", "b": "N m s/rad", "G": "N m"},
        {"q": "rad"},
    )
    assert joint.mistakes_in_units == ()
    assert mistakes("-k*x*sin(n*q)", states={"x": "m", "q": "deg"}) == ()
    assert "given q in 0.01745" in mistakes("-k*x*sin(q)", states={"x": "m", "q": "deg"})[0]


def test_conditions_are_checked_too() -> None:
    model = fp.SymbolicModel(["-k*x"], ["x"], {"x": "m"}, {}, {"k": "1/s"}, {"y": "m"}, domain=["x - k"], check_units=False).within(
        "x < 2"
    )
    assert model.mistakes_in_units == ("domain[0]: x in m and -k in 1/s cannot be added",)


def wrong(**options: bool) -> fp.SymbolicModel:
    return fp.SymbolicModel(["x**2 - k*x"], ["x"], {"x": "m"}, {}, {"k": "1/s"}, {"x": "m"}, name="wrong", **options)


WRONG = """
[model]
name = "wrong"
[model.states]
x = "m"
[model.parameters]
k = "1/s"
[model.outputs]
x = "m"
[model.equations]
x = "x**2 - k*x"
"""
MESSAGE = r"^units of wrong: equations.x: x\*\*2 in m2 and -k\*x in m/s cannot be added. If that is meant, check_units"


def test_a_warning_comes_once_and_can_be_switched_off(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match=MESSAGE) as told:
        model = wrong()
    assert told[0].filename == __file__
    # Models that are made of it, and copies, are quiet: any warning is an error in tests.
    assert wrong(check_units=False).mistakes_in_units == model.mistakes_in_units
    model.within("x < 3").free_start("x").fix(k=1.0).estimate("k")
    assert pickle.loads(pickle.dumps(model)) == model
    assert model_from_json(model_to_json(model)) == model
    for name, text in (("loud", WRONG), ("quiet", WRONG.replace('"wrong"\n', '"wrong"\ncheck_units = false\n'))):
        path = tmp_path / f"{name}.toml"
        path.write_text(text)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            assert fp.load_model(path).mistakes_in_units == model.mistakes_in_units
        assert [warning.filename for warning in caught] == [__file__] * (name == "loud")


def test_a_function_in_python_is_checked() -> None:
    with pytest.warns(UserWarning, match=MESSAGE) as told:

        @fp.model(states={"x": "m"}, parameters={"k": "1/s"}, outputs={"x": "m"})
        def wrong(x, u, p):  # type: ignore[no-untyped-def]
            return [x.x**2 - p.k * x.x], [x.x]

    assert told[0].filename == __file__

    @fp.model(states={"x": "m"}, parameters={"k": "1/s"}, outputs={"x": "m"}, check_units=False)
    def quiet(x, u, p):  # type: ignore[no-untyped-def]
        return [x.x**2 - p.k * x.x], [x.x]

    assert len(quiet.mistakes_in_units) == 1


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.toml")), ids=lambda path: path.stem)
def test_examples_have_no_mistakes(path: Path) -> None:
    assert load_config(path).build_model().symbolic().mistakes_in_units == ()
