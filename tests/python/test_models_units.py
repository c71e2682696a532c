"""Units: what is one, where one that is none goes wrong, and what numbers are in another."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.basics.units import UNITS, check_unit, converted


@pytest.mark.parametrize(
    "unit",
    """m|Pa|m3/(s sqrt(Pa))|N s/m|1|rad/s|mol/L|degC|V|%|m^0.5/s|m**0.5/s|kg m^2 s^-2|s-1|1/(s bar)|g/L/h|m·s|W/(m2 K)|1/s|°C|µm
    |sqrt(kg m)|(mol/L)^-0.5 s""".replace("\n", "").split("|"),
)
def test_units_that_are_used(unit: str) -> None:
    assert check_unit(unit.strip(), "states.x") == unit.strip()


@pytest.mark.parametrize(
    ("unit", "part"),
    {
        "m^": r"'\^' at column 2",
        "m//s": "a unit expected before '/s' at column 3",
        "m/": "a unit expected before its end",
        "/s": "a unit expected before '/s' at column 1",
        "furlong": "unknown unit 'furlong' at column 1",
        "N furlong": "unknown unit 'furlong' at column 3",
        "(m": r"'\)' expected before its end",
        "m)": r"the end expected before '\)' at column 2",
        "m s^x": r"'\^x' at column 4",
        "__import__('os')": "column 1",
        "m\0": "column 2",
        "m" * 1000: "expected a unit such as",
        5: "given 5",
        None: "given None",
    }.items(),
)
def test_what_is_no_unit_is_named_with_its_place(unit: str, part: str) -> None:
    with pytest.raises(ValueError, match=part) as caught:
        check_unit(unit, "states.x")
    assert str(caught.value).startswith("states.x: expected a unit such as 'm3/(s sqrt(Pa))', given")
    assert len(str(caught.value)) < 250


@pytest.mark.parametrize("empty", ["", " "])
@pytest.mark.parametrize("make", [fp.SymbolicModel, fp.CallableModel])
@pytest.mark.filterwarnings("ignore:CallableModel")
def test_an_empty_unit_means_dimensionless_wherever_one_is_given(make: Any, empty: str, tmp_path: Path) -> None:
    f, g = (["-k*x"], ["x"]) if make is fp.SymbolicModel else (lambda x, u, p: [-p.k * x.x], lambda x, u, p: [x.x])
    model = make(f, g, {"x": (empty, 1.0)}, {"u": empty}, {"k": empty}, {"y": empty}, constants={"c": (1.0, empty)})
    quantities = (*model.states, *model.inputs, *model.parameters, *model.outputs, *model.constant_quantities)
    assert [quantity.unit for quantity in quantities] == ["1"] * 5
    assert fp.Quantity("x", empty) == fp.Quantity("x", "1")
    (tmp_path / "points.csv").write_text(f"x [{empty}],u [%],dt\n1,50,1\n")
    points = fp.Experiments.from_csv(tmp_path / "points.csv", model)
    assert (points.x0[0, 0], points.u[0, 0]) == (1.0, 0.5)


def test_an_empty_unit_in_a_file_means_dimensionless() -> None:
    from_toml = pytest.importorskip(
        "fisherpoint.models.toml_to_model", reason="needs the extras", exc_type=ImportError
    ).model_from_toml
    text = """
[model]
name = "m"
states = { x = "" }
inputs = { u = { unit = "" } }
parameters = { k = "" }
outputs = { y = "" }
constants = { c = { value = 2.0, unit = "" } }
[model.equations]
x = "u - k*x"
y = "c*x"
"""
    empty, one = from_toml(text), from_toml(text.replace('""', '"1"'))
    assert empty == one and empty.to_toml() == one.to_toml()


@pytest.mark.parametrize(
    ("value", "given", "wanted", "expected"),
    [
        (61.7, "bar", "Pa", 6170000.0),
        (12.3, "mm", "m", 0.0123),
        (7, "kPa", "bar", 0.07),
        (1.5, "min", "s", 90.0),
        (5.0, "%", "1", 0.05),
        (3.0, "mM", "mol/L", 0.003),
        (5.0, "mg/L", "kg/m3", 0.005),
        (1.0, "N s/m", "kg/s", 1.0),
        (2.0, "s^-1", "1/s", 2.0),
        (9.0, "cd", "cd", 9.0),
        (2.0, "dag/das", "g/s", 2.0),
        (1.0, "W h", "J", 3600.0),
        (1.0, "U/L", "mol/(m3 s)", 1e-3 / 60),
        (3.0, "L/min", "m3/s", 5e-5),
        (1.0, "m3/(s sqrt(bar))", "m3/(s sqrt(Pa))", 10**-2.5),
        (90.0, "deg", "rad", np.pi / 2),
        (60.0, "rpm", "rad/s", 2 * np.pi),
        (2.0, "rad/s", "1/s", 2.0),
        (3.0, "1/s", "rad/s", 3.0),
        (3.0, "mrad", "1", 3e-3),
        (4.0, "N m", "N m/rad", 4.0),
        (20.0, "degC", "K", 293.15),
        (293.15, "K", "°C", 20.0),
        (2.0, "1/degC", "1/K", 2.0),
    ],
)
def test_numbers_are_converted(value: float, given: str, wanted: str, expected: float) -> None:
    found = float(converted(np.array(value), given, wanted, "y"))
    irrational = any(part in given for part in ("sqrt", "deg", "rpm", "min", "U")) or wanted == "°C"
    assert found == (pytest.approx(expected, rel=1e-15) if irrational else expected)
    assert float(converted(np.array(found), wanted, given, "y")) == pytest.approx(value, rel=1e-14)


def test_prefixes_are_powers_of_ten() -> None:
    powers = dict(zip("qryzafpnum", range(-30, 0, 3), strict=True)) | {"c": -2, "d": -1, "da": 1, "h": 2}
    powers |= dict(zip("kMGTPEZYRQ", range(3, 33, 3), strict=True)) | {"µ": -6, "μ": -6}
    for prefix, power in powers.items():
        assert float(converted(np.array(1.0), f"{prefix}V", "V", "y")) == pytest.approx(
            float(f"1e{power}"), rel=0 if abs(power) < 23 else 1e-15
        )


def test_every_unit_has_a_value() -> None:
    for name in UNITS.keys() - {"degC", "°C"}:  # which in a product are differences
        assert converted(np.array(3.0), f"{name} s/s", name, "y") == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("given", "wanted", "message"),
    [
        ("Pa", "m", "expected a unit of what is in 'm', given 'Pa', which measures something else"),
        ("Hz", "rad/s", "measures something else"),
        ("kHz", "rad/s", "measures something else"),
        ("rpm", "1/s", "measures something else"),
        ("1/s", "rpm", "measures something else"),
        ("deg/s", "1/s", "measures something else"),
        ("1", "deg", "measures something else"),
        ("rad", "s", "measures something else"),
        ("ft", "m", "measures something else"),  # a femtotonne
        ("au", "1", "measures something else"),
        ("m^0.5", "m", "measures something else"),
        ("0 m", "m", "expected a unit of the size of 'm', given '0 m'"),
        ("1e400 m", "m", "of the size of"),
        ("((((((10^90)^90)^90)^90)^90)^90)^90 m", "m", "of the size of"),
        ("1e999999999", "1", "of the size of"),
        ("psi", "Pa", "unknown unit 'psi'"),
        ("m" * 101, "m", "expected a unit such as"),
    ],
)
def test_what_cannot_be_converted_says_why(given: str, wanted: str, message: str) -> None:
    with pytest.raises(ValueError, match=rf"^y: .*{message}"):
        converted(np.array(1.0), given, wanted, "y")
