"""Equations have a value where what the user wrote has one, whatever SymPy makes of it."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
import sympy

import fisherpoint as fp
from fisherpoint.models.surfaces.printing import to_text


def of_text(rate: str, output: str = "k*x", **options: Any) -> fp.SymbolicModel:
    described = {"states": {"x": "1"}, "inputs": {"u": "1"}, "parameters": {"k": "1"}, "outputs": {"y": "1"}}
    return fp.SymbolicModel([rate], [output], **described, check_units=False, **options)


def of_function(rate: Any) -> fp.SymbolicModel:
    given = {"states": {"x": "1"}, "inputs": {"u": "1"}, "parameters": {"k": "1"}, "outputs": {"y": "1"}}
    return fp.model(**given, check_units=False)(lambda x, u, p: ([rate(x.x, u.u, p.k)], [p.k * x.x]))


WRITTEN: dict[str, tuple[Any, list[str]]] = {
    "sqrt(x)*sqrt(x)": (lambda x, u, k: fp.math.sqrt(x) * fp.math.sqrt(x), ["x > 0"]),
    "sqrt(x)**2": (lambda x, u, k: fp.math.sqrt(x) ** 2, ["x > 0"]),
    "(x**0.5)**2": (lambda x, u, k: (x**0.5) ** 2, ["x > 0"]),
    "x**1.5*x**0.5": (lambda x, u, k: x**1.5 * x**0.5, ["x > 0"]),
    "x**k*x**(-k)": (lambda x, u, k: x**k * x ** (-k), ["x > 0"]),
    "sqrt(2*x + 1)**2": (lambda x, u, k: fp.math.sqrt(2 * x + 1) ** 2, ["2*x + 1 > 0"]),
    "x/x": (lambda x, u, k: x / x, ["x other than 0"]),
    "u*x/x": (lambda x, u, k: u * x / x, ["x other than 0"]),
    "x**2/x": (lambda x, u, k: x**2 / x, ["x other than 0"]),
    "0*log(x)": (lambda x, u, k: 0 * fp.math.log(x), ["x > 0"]),
    "log(x) - log(x)": (lambda x, u, k: fp.math.log(x) - fp.math.log(x), ["x > 0"]),
    "exp(log(x))": (lambda x, u, k: fp.math.exp(fp.math.log(x)), ["x > 0"]),
    "sin(asin(x))": (lambda x, u, k: fp.math.sin(fp.math.asin(x)), ["1 - x > 0", "x + 1 > 0"]),
    "u + sqrt(u*x)**2": (lambda x, u, k: u + fp.math.sqrt(u * x) ** 2, ["u*x > 0"]),
    "max(sqrt(x)**2, 1)": (lambda x, u, k: fp.math.max(fp.math.sqrt(x) ** 2, 1), ["x > 0"]),
    # What is defined everywhere is no limit.
    "log(exp(x))": (lambda x, u, k: fp.math.log(fp.math.exp(x)), []),
    "sqrt(x**2)": (lambda x, u, k: fp.math.sqrt(x**2), []),
    "x - x": (lambda x, u, k: x - x, []),
    "sqrt(max(x - 1, 0))**2": (lambda x, u, k: fp.math.sqrt(fp.math.max(x - 1, 0)) ** 2, []),
    # What says the same is no further one.
    "x*sqrt(x)": (lambda x, u, k: x * fp.math.sqrt(x), ["x > 0"]),
    "sqrt(4*x)": (lambda x, u, k: fp.math.sqrt(4 * x), ["x > 0"]),
    "1/(x*u)": (lambda x, u, k: 1 / (x * u), ["u other than 0", "x other than 0"]),
}


def limits(model: fp.SymbolicModel) -> list[str]:
    return [model.limit_text(place) for place in range(len(model.domain))]


@pytest.mark.parametrize("text", WRITTEN)
def test_the_domain_is_that_of_what_is_written(text: str) -> None:
    """In text and in a function alike, also when it is printed, stored and read again."""
    function, expected = WRITTEN[text]
    for model in (of_text(text), of_function(function)):
        assert limits(model) == expected
        (rate,) = model.equations.rates
        assert limits(of_text(to_text(rate))) == expected
        assert limits(pickle.loads(pickle.dumps(model))) == expected
        assert len(limits(model.free_start("x"))) == len(expected)


def test_a_point_beyond_is_no_point() -> None:
    """x' = -sqrt(x)*sqrt(x) from -1 has no value, as -sqrt(x)**2 of numbers has none."""
    points = fp.Experiments(np.array([[-1.0], [1.0]]), np.zeros((2, 1)), np.array([0.5, 0.5]))
    for model in (of_text("-sqrt(x)*sqrt(x)"), of_function(lambda x, u, k: -fp.math.sqrt(x) * x**0.5)):
        found = fp.simulate(model, points, [1.0])
        assert [fp.Status(status) for status in found.status] == [fp.Status.left_domain, fp.Status.ok]
        assert found.x[1, 0] == pytest.approx(np.exp(-0.5), rel=1e-5)
        assert fp.broken_limits(model, points, [1.0])[0] == "x > 0 at the start"


def test_what_crosses_a_divisor_that_cancels_leaves_the_domain() -> None:
    points = fp.Experiments(np.array([[-1.0], [1.0]]), np.zeros((2, 1)), np.array([2.0, 2.0]))
    found = fp.simulate(of_text("x/x"), points, [1.0])
    assert [fp.Status(status) for status in found.status] == [fp.Status.left_domain, fp.Status.ok]


def test_a_branch_that_is_not_taken_has_no_limit() -> None:
    """sqrt(x)*sqrt(x) where x > 1, else -1: fine for x < 0."""
    points = fp.Experiments(np.array([[-1.0], [2.0]]), np.zeros((2, 1)), np.array([0.1, 0.1]))
    for model in (
        of_text("where(x > 1, sqrt(x)*sqrt(x), -1)"),
        of_text("2*where(x > 1, sqrt(x)*sqrt(x), -1) - where(x > 1, sqrt(x)*sqrt(x), -1)"),
        of_function(lambda x, u, k: fp.math.where(x > 1, fp.math.sqrt(x) * fp.math.sqrt(x), -1)),
    ):
        assert not fp.simulate(model, points, [1.0]).status.any()
    inside = of_text("where(x > 0, sqrt(x - 1)**2, -1)")
    found = fp.simulate(inside, fp.Experiments(np.array([[0.5], [-0.5]]), np.zeros((2, 1)), np.array([0.1, 0.1])), [1.0])
    assert [fp.Status(status) for status in found.status] == [fp.Status.left_domain, fp.Status.ok]
    assert not fp.simulate(of_text("0*where(x > 1, 1/(x - 5), 0) - 1"), points, [1.0]).status.any()


def test_outputs_and_conditions_of_the_domain_too() -> None:
    assert limits(of_text("-x", "k*sqrt(x)*sqrt(x)")) == ["x > 0"]
    assert limits(of_text("-x", domain=["sqrt(x)*sqrt(x) - 1"])) == ["x - 1 > 0", "x > 0"]
    with pytest.raises(ValueError, match=r"equations\.y: expected an output that depends on something"):
        of_text("-x", "0*log(x) + 1")


def test_divisors_of_parameters_alone_are_checked_with_them() -> None:
    model = of_text("k/k*x")
    model.theta([1.0])
    with pytest.raises(ValueError, match="k: expected a number other than 0, given 0"):
        model.theta([0.0])


def test_derivatives_are_those_of_what_is_left() -> None:
    points = fp.Experiments(np.array([[0.3], [2.0]]), np.zeros((2, 1)), np.array([0.7, 0.4]))
    one, other = (fp.sensitivities(of_text(rate), points, [0.8]) for rate in ("-k*sqrt(x)*sqrt(x)", "-k*x"))
    np.testing.assert_array_equal(one.dy_dtheta, other.dy_dtheta)


def test_sympy_functions_of_the_terms_of_a_function() -> None:
    """A function may use SymPy's functions, numbers and matrices on what it is given."""
    model = of_function(lambda x, u, k: sympy.pi * sympy.tanh(x) + (sympy.Matrix([[1.0, 2.0]]) * sympy.Matrix([x, u]))[0] - k)
    assert model.rhs([0.5], [2.0], [0.3]) == pytest.approx(np.pi * np.tanh(0.5) + 0.5 + 4.0 - 0.3)


def test_formulas_show_what_is_left() -> None:
    model = of_text("-sqrt(x)*sqrt(x) + u")
    assert "Defined" not in model._repr_latex_() and "Defined" not in str(model) and "sqrt(x)*sqrt(x)" in str(model)
    assert model.blocks == (("k",),) and model.shown_states == {}
    assert of_text("-k*x", "sqrt(x)**2").shown_states == {"x": "y"}
