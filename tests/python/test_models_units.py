"""Units are read, not converted: what is one, and where one that is none goes wrong."""

from __future__ import annotations

import pytest

from fisherpoint.models.units import check_unit


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
        "": "a unit expected before its end",
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
