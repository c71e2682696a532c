"""A number is the same however it is written: 0.0 is 0, x**2.0 is x**2 and x**0.5 is sqrt(x)."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
import sympy

import fisherpoint as fp

RATES = [
    "where(max(x, 0) > 0, x, 0)",
    "max(x, 0)",
    "min(x, 0) - k",
    "sqrt(max(x - 1, 0))",
    "sqrt(max(0, x - 1))*k",
    "-sqrt(max(x, 0))",
    "max(x, 0)**1.5",
    "max(x - c, 0)**1.5",
    "max(x, 0)**2",
    "max(x, 0)**1",
    "where(x > 0, 1, 0) - k*x",
    "where(x > 0, 1, -1)",
    "where(x > 0, 0, 1)*sqrt(abs(x))",
    "where(x > 0, sqrt(x), 0)",
    "where(x >= 1, x**2, 1)",
    "sqrt(where(x > 0, x, 0)*k)",
    "where(where(x > 0, 1, 0) > 0, x, 0)",
    "where(heaviside(x) > 0, x, -1)",
    "where(sign(x) > 0, x, -1)",
    "where(x > 0 and x < 1, 1, 0) - 1*x",
    "where(not (x > 0), 0, x)",
    "where(abs(x) < 1, 0, sign(x))",
    "where(k*0 > 0, x, 1)",
    "where(c > 0, x, 1)",
    "where(d*x > c, x - 1, x + 1)",
    "sqrt(max(x - c, 0))*d",
    "sign(x - 0)",
    "-sign(1*x)",
    "heaviside(x)*1 - 0",
    "heaviside(u)*x - 0",
    "abs(-1*x)",
    "abs(x)**3 - abs(x)**1",
    "abs(x - 1) - abs(1 - x) + x",
    "1/x",
    "x**-1",
    "x**-2",
    "x**0 + x",
    "(x**2)**0.5",
    "(x**1)**2",
    "1*x - 0*u",
    "0*x + 1",
    "x/(1 - 0*x)",
    "1 - 1*sqrt(1 - x**2)",
    "asin(x/2)**1",
    "log(max(x, 1))",
    "where(x > 1, log(x), 0)",
    "max(min(1*x, 1), -1)",
    "x**d + u**(2*d)",
]

STARTS = np.array([-1.5, -1.0, -0.7, 0.0, 0.3, 0.5, 1.0, 1.7])
INPUTS = np.array([-1.0, 0.0, 1.0])


def as_floats(text: str) -> str:
    """The text with whole numbers written as floats."""
    return re.sub(r"(?<![\w.])(\d+)(?![\w.])", r"\1.0", text)


def model_of(rate: Any, constants: dict[str, float]) -> fp.SymbolicModel:
    described = {"states": {"x": "1"}, "inputs": {"u": "1"}, "parameters": {"k": "1"}}
    return fp.SymbolicModel([rate], ["k*x"], **described, constants=constants, check_units=False)


def facts(model: fp.SymbolicModel) -> tuple[tuple[int, ...], str]:
    return tuple(map(len, (model.jumps, model.kinks, model.domain, model.poles, model.crossable))), str(model.structure.rates)


def same_trajectories(one: fp.SymbolicModel, other: fp.SymbolicModel) -> None:
    starts = STARTS[STARTS != 0] if one.poles and not one.kinks else STARTS  # a start on a divisor is refused
    x, u = (grid.reshape(-1, 1) for grid in np.meshgrid(starts, INPUTS))
    points = fp.Experiments(x, u, np.full(len(x), 0.8))
    a, b = (fp.sensitivities(model, points, [1.3]) for model in (one, other))
    np.testing.assert_array_equal(a.status, b.status)
    np.testing.assert_array_equal(a.y, b.y)
    np.testing.assert_array_equal(a.dy_dtheta, b.dy_dtheta)


@pytest.mark.parametrize("rate", RATES)
def test_whole_numbers_as_floats_in_text(rate: str) -> None:
    """The same surfaces, domain, trajectories and statuses."""
    written = as_floats(rate)
    assert written != rate
    one, other = model_of(rate, {"c": 0, "d": 1}), model_of(written, {"c": 0.0, "d": 1.0})
    assert facts(one) == facts(other)
    same_trajectories(one, other)


@pytest.mark.parametrize("rate", [rate for rate in RATES if not re.search("where|heaviside", rate)])
def test_whole_numbers_as_floats_from_sympy(rate: str) -> None:
    """The same, where SymPy has worked with the floats."""
    x, u, k, c, d = sympy.symbols("x u k c d", real=True)
    names = {"x": x, "u": u, "k": k, "c": c, "d": d, "max": sympy.Max, "min": sympy.Min, "abs": sympy.Abs, "sqrt": sympy.sqrt}
    names |= {name: getattr(sympy, name) for name in ("log", "asin", "sign")}
    one, other = (model_of(sympy.sympify(eval(text, names)), {"c": 0.0, "d": 1.0}) for text in (rate, as_floats(rate)))
    assert facts(one)[0] == facts(other)[0]
    same_trajectories(one, other)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("where(x > c, d, 0)", "where(x > 0, 1, 0)"),
        ("sqrt(max(x, c))*d", "sqrt(max(x, 0))*1"),
        ("where(max(x, c) > c, x, c)", "where(max(x, 0) > 0, x, 0)"),
        ("max(x - c, c)**1.5", "max(x, 0)**1.5"),
    ],
)
def test_constants_of_zero_and_one(one: str, other: str) -> None:
    """A constant of which the value is 0.0 or 1.0 gives the same trajectories as the same number as an int."""
    models = [model_of(one, {"c": c, "d": d}) for c, d in ((0, 1), (0.0, 1.0), (np.float64(0.0), np.float64(1.0)))]
    assert facts(models[0]) == facts(models[1]) == facts(models[2])
    same_trajectories(models[0], models[1])


def test_a_condition_with_a_float_holds_where_it_does() -> None:
    """x' = x for x > 0, else 0: below zero x must not move; a start there is refused or stays, whatever the zero is."""
    for zero in ("0", "0.0", "-0.0", "0e3"):
        model = model_of(f"where(max(x, {zero}) > 0, x, 0)", {})
        found = fp.simulate(model, fp.Experiments(np.array([[-0.7]]), np.zeros((1, 1)), np.array([0.8])), [1.0])
        assert found.status[0] != fp.Status.ok or found.x[0, 0] == -0.7


def test_a_root_beside_its_edge_with_a_float() -> None:
    """Below the edge sqrt(max(x - 0.5, 0.0)) is zero."""
    for zero in ("0", "0.0", "0.0*k", "0.5 - 0.5"):
        model = model_of(f"sqrt(max(x - 0.5, {zero}))", {})
        found = fp.simulate(model, fp.Experiments(np.array([[-0.7], [0.2]]), np.zeros((2, 1)), np.array([0.8, 0.8])), [1.0])
        assert not found.status.any()
        np.testing.assert_array_equal(found.x[:, 0], [-0.7, 0.2])


def test_units_of_whole_floats() -> None:
    """2.0 is a plain number, as 2 is: what it multiplies has its unit."""
    for two in ("2", "2.0"):
        with pytest.warns(UserWarning, match="cannot be added"):
            fp.SymbolicModel([f"{two}*k*x + x**2"], ["x"], {"x": "m"}, {}, {"k": "1/s"})
