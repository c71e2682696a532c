"""Equations as text: what they mean, and what is refused quickly, in one line that names the equation and the column."""

from __future__ import annotations

import math
import time
from typing import Any

import pytest
import sympy
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fisherpoint.basics.formulas import MAX_DEPTH
from fisherpoint.models.equation_text import parse_equation
from fisherpoint.models.expressions import symbol
from fisherpoint.models.surfaces.evaluate import evaluate
from fisherpoint.models.surfaces.printing import to_text

SYMBOLS = {name: symbol(name) for name in ("x", "y", "k", "p_A", "N", "E")}
VALUES = {"x": 0.7, "y": -1.3, "k": 2.5, "p_A": 3.0, "N": 4.0, "E": 5.0}


def parse(text: object) -> Any:
    return parse_equation(text, SYMBOLS, "equations.x")


def value(expression: Any) -> float:
    return float(evaluate([expression], {SYMBOLS[name]: number for name, number in VALUES.items()})[0])


X, Y, K = VALUES["x"], VALUES["y"], VALUES["k"]


@pytest.mark.parametrize(
    ("text", "expected"),
    {
        "-k*sqrt(x) + p_A*y": -K * math.sqrt(X) + 3.0 * Y,
        "x**0.5": math.sqrt(X),
        "(2*x)**-1": 1 / (2 * X),
        "2**x": 2**X,
        "x - y - k": X - Y - K,
        "x/k/2": X / K / 2,
        "-x**2": -(X**2),
        "2*pi*x": 2 * math.pi * X,
        "1e-320*x": 1e-320 * X,
        "x/3 + 1/3": X / 3 + 1 / 3,
        "sqrt(2)*x": math.sqrt(2) * X,
        "(4*x)**0.5": math.sqrt(4 * X),
        "(-4*y)**0.3": (-4 * Y) ** 0.3,
        "where(x > 0 and y <= 1, x, -y)": X,
        "where(x < 0 or not y > 0, 1, 2)*x": X,
        "where(0 < x < 0.5, x, 3*x)": 3 * X,
        "where(x > y, where(y > 0, 1, 2), 3)*x": 2 * X,
        "max(x, y, 0.8)": 0.8,
        "min(x, y, 0)": Y,
        "max(3, 4)*x": 4 * X,
        "abs(y)*sign(y)*heaviside(x)": Y,
        "atan2(y, x)": math.atan2(Y, X),
        "exp(x) + log(k) + sin(x) + cos(x) + tan(x)": math.exp(X) + math.log(K) + math.sin(X) + math.cos(X) + math.tan(X),
        "asin(x) + acos(x) + atan(y)": math.pi / 2 + math.atan(Y),
        "sinh(x) + cosh(x) + tanh(x)": math.sinh(X) + math.cosh(X) + math.tanh(X),
        "N*E": 20.0,
        "x +\n  y": X + Y,
    }.items(),
)
def test_what_a_text_means_and_that_its_print_means_the_same(text: str, expected: float) -> None:
    expression = parse(text)
    assert value(expression) == pytest.approx(expected, rel=1e-14)
    again = parse(to_text(expression))
    assert again == expression
    assert to_text(again) == to_text(expression)


def test_a_root_is_a_root_however_it_is_written() -> None:
    assert parse("x**0.5") == parse("sqrt(x)") == parse("x**(1/2)")


def test_a_long_sum_is_not_deep() -> None:
    assert parse("+".join(["x*y"] * 1000)) == 1000 * SYMBOLS["x"] * SYMBOLS["y"]


REFUSED = {
    "k*(c + 1": "column 3: expected a closing bracket for this \\(; given '\\(c \\+ 1'",
    "k*c) + 1": "column 4: expected an opening bracket before this \\); given '\\) \\+ 1'",
    "__import__('os').system('true')": "column 1: expected names, numbers",
    "x.real": "column 1: expected names",
    "1 + x.__class__": "column 5: expected names",
    "(lambda: x)()": "column 1: expected names",
    "x[0]": "column 1: expected names",
    "'x'": "column 1: expected names",
    "f'{x}'": "column 1: expected names",
    "[x for x in y]": "column 1: expected names",
    "x if y > 0 else 0": "column 1: expected names",
    "(x := 3)": "column 2: expected names",
    "True": "column 1: expected names",
    "1j*x": "column 1: expected names",
    "x ^ 2": r"column 1: expected powers written as \*\*",
    "x > 0": r"column 1: expected a comparison only as the condition of where\(\)",
    "2*foo": "column 3: expected the names x, y, k, p_A, N, E; given 'foo'",
    "x + gamma(x)": "column 5: expected the functions sqrt, exp",
    "eval(x)": "column 1: expected the functions",
    "sin(x, y)": r"column 1: expected 1 arguments of sin\(\)",
    "max(x)": r"column 1: expected 2 to 32 arguments of max\(\)",
    "max(*x)": r"column 1: expected 2 to 32 arguments of max\(\)",
    "sqrt(x=1)": "column 1: expected the functions",
    "where(x, 1, 2)": "column 7: expected a condition such as h > 0",
    "where(x == 0, 1, 2)": r"column 7: expected <, <=, > or >=, as == holds for no length of time: write abs\(a - b\) < width",
    "where(x != 0, 1, 2)": "column 7: expected <, <=, > or >=, as == holds",
    "where(x > 0 & y > 0, 1, 2)": r"column 11: expected brackets around each comparison beside &, \| and ~: \(a > 0\) & \(b > 0\)",
    "where(x & y, 1, 2)": "column 7: expected a condition such as h > 0",
    "(x > 0) & (y > 0)": "column 1: expected a comparison only as the condition of where",
    "x % 2": "column 1: expected no %, //, floor, ceil or round, which jump again and again: write each jump as where",
    "x // 2": "column 1: expected no %, //, floor",
    "2*floor(x)": "column 3: expected no %, //, floor",
    "round(x)": "column 1: expected no %, //, floor",
    "1 + 2/0": "column 7: expected no division by zero",
    "x/(y - y)": "column 4: expected no division by zero",
    "0**-1*x": "column 1: expected no division by zero",
    "1e999": "column 1: expected finite numbers",
    "9" * 400: "column 1: expected finite numbers",
    "9" * 5000: "column",
    "1e300*1e300*x": "column 1: expected finite numbers",
    "x*1e300*1e300": "expected finite real numbers",
    "exp(1000)*x": r"column 1: expected exp\(\) of numbers for which it has a value",
    "exp(exp(exp(800)))": "column 9: expected",
    "sqrt(-1)*x": r"column 1: expected sqrt\(\) of numbers for which it has a value",
    "(-1)**0.5*x": "column 1: expected finite real numbers",
    "(-2)**x": "column 1: expected a positive number",
    "x**1000000": "column 1: expected exponents of at most 1000",
    "x**10**10**10": "column 4: expected exponents of at most 1000",
    "((((2*x)**1000)**1000)**1000)**1000": "column",
    "((x**1000)**1000)**1000": "expected exponents of at most 1000",
    "": "column 1: expected names",
    "x +": "column",
    "x\0": "column 2: expected names",
    "x;y": "column",
    "(x) + y)": "column 8",
    "\ud800x": "expected names",
    "(" * 100_000 + "x" + ")" * 100_000: "expected a formula of at most 10000 characters",
    "(" * 4000 + "x" + ")" * 4000: f"column {MAX_DEPTH + 1}: expected terms nested at most {MAX_DEPTH} deep",
    "-" * 9000 + "x": "expected",
    "-" * 200 + "x": "expected terms nested",
    "**".join(["x"] * 3000): "expected",
    "not " * 2000 + "x": "expected",
    "x*" * 10_000 + "x": "expected a formula of at most 10000 characters",
    None: "expected a formula as text",  # type: ignore[dict-item]
    3.5: "expected a formula as text",  # type: ignore[dict-item]
}


@pytest.mark.parametrize("text", REFUSED, ids=lambda text: str(text)[:30].encode("ascii", "replace").decode())
def test_what_is_no_equation_is_refused_at_once_in_one_line(text: str) -> None:
    started = time.perf_counter()
    with pytest.raises(ValueError, match=REFUSED[text]) as caught:
        parse(text)
    message = str(caught.value)
    assert time.perf_counter() - started < 1.0
    assert message.startswith("equations.x: ") and "given" in message
    assert "\n" not in message and len(message) < 400


def test_the_column_counts_characters_not_bytes_from_the_text_as_given() -> None:
    with pytest.raises(ValueError, match="column 9: expected the names"):
        parse("  x  +\n foo")
    with pytest.raises(ValueError, match="column 5: expected the names ä; given 'b'"):
        parse_equation("2*ä*b", {"ä": symbol("ä")}, "equations.ä")


ATOMS = st.sampled_from([*SYMBOLS, "0", "1", "2", "3.5", "1e-3", "1e200", "pi", "x > 0", "foo", "'s'", "x.y", ""])


def _calls(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    names = st.sampled_from(["sqrt", "exp", "log", "abs", "sign", "heaviside", "max", "min", "where", "atan2", "tanh", "asin", "f"])
    operators = st.sampled_from(["+", "-", "*", "/", "**", "^", ">", "<=", " and ", " if ", ","])
    return st.one_of(
        st.builds("({}{}{})".format, inner, operators, inner),
        st.builds("{}{}{}".format, inner, operators, inner),
        st.builds("{}({})".format, names, inner),
        st.builds("{}({}, {})".format, names, inner, inner),
        st.builds("where({} > {}, {}, {})".format, inner, inner, inner, inner),
        st.builds("-{}".format, inner),
    )


@pytest.mark.parametrize("text", ["where(x > y, 0, x)**x", "where(x > y, where(x > 1, -1, y), 2)**y", "0**x"])
def test_no_branch_under_an_exponent_that_varies_is_a_number_that_is_not_positive(text: str) -> None:
    with pytest.raises(ValueError, match="expected a positive number under an exponent that varies"):
        parse(text)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.recursive(ATOMS, _calls, max_leaves=12) | st.text(max_size=40))
def test_any_text_is_an_expression_that_prints_and_reads_again_or_one_line(text: str) -> None:
    try:
        expression = parse(text)
    except ValueError as error:
        assert str(error).startswith("equations.x: ") and "\n" not in str(error)
        return
    assert isinstance(expression, sympy.Expr)
    assert expression.free_symbols <= set(SYMBOLS.values())
    assert isinstance(parse(to_text(expression)), sympy.Expr)
