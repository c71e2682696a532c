"""Expressions of SymPy as nodes: every function of the list against SymPy's own values, and what is refused."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from fisherpoint.models.tape.branch import Select
from fisherpoint.models.tape.differentiate import gradient
from fisherpoint.models.tape.from_sympy import nodes_of
from fisherpoint.models.tape.graph import Graph, Leaves
from fisherpoint.models.tape.program import TABLE, Program
from fisherpoint.models.tape.schedule import schedule
from oracle import Floats

X, Y, K, U, S = sp.symbols("x y k u s", real=True)
LEAVES = Leaves(parameters=1, inputs=1, states=2, sides=1)


def program_of(*expressions: Any, derivatives: bool = False) -> Program:
    graph = Graph(LEAVES)
    nodes = nodes_of(graph, expressions, dict(zip((K, U, X, Y, S), range(5), strict=True)))
    if derivatives:
        nodes += [row.get(leaf, graph.zero) for row in gradient(graph, nodes, LEAVES.x) for leaf in LEAVES.x]
    return schedule(graph, nodes)


def evaluate(program: Program, x: float, y: float, k: float = 1.3, u: float = 0.7, s: float = 1.0) -> Floats:
    return program.evaluate((k,), (u,), (x, y), (s,), (0, 0))[0]


EXPRESSIONS = [
    2 * X - Y / 3 + sp.pi * K - 7,
    -X * Y * K / (U * (X + 5) * (Y + 5)),
    X**5 - Y**-3 + X ** sp.Rational(3, 2) - sp.sqrt(Y) ** -3 + X ** sp.Rational(1, 3) + 2**Y + K**X + X**K + X**Y + sp.E**X,
    sp.exp(-K * X) * sp.log(Y) + sp.sin(X) * sp.cos(Y) + sp.tan(X / 4),
    sp.asin(X / 4) + sp.acos(Y / 4) + sp.atan(X * Y) + sp.sinh(X) + sp.cosh(Y) + sp.tanh(X - Y),
    sp.Abs(X - Y) * sp.sign(Y - 1) + sp.Min(X, Y, K) * sp.Max(X, U, Y) + sp.Heaviside(X - 1),
    sp.atan2(Y - 1, X - 1) + sp.atan2(-Y, X) + sp.atan2(K, U),
    sp.Piecewise((X**2, X > 2), (X * Y, (Y <= 1) & (X >= 1)), (sp.sin(X), ~(Y > 2) | (X < 1)), (Y, True)),
    sp.Piecewise((1, sp.Eq(X, 1)), (sp.sin(X - 1) / (X - 1), sp.Ne(X, 1))),
    Select(X - Y, sp.log(X), sp.exp(Y)) * Select(K - 2, X, Y),
    (X + Y + K) * (X + Y) + (K + U) * (X - Y) * (K + U + X) - sp.Rational(1, 7) * (Y - X),
]


@pytest.mark.parametrize("expression", EXPRESSIONS, ids=str)
@settings(deadline=None, max_examples=25)
@given(x=st.floats(0.05, 3.0), y=st.floats(0.05, 3.0))
def test_values_and_slopes_are_those_of_sympy(expression: sp.Expr, x: float, y: float) -> None:
    """Slopes by SymPy's differentiation, branches by SymPy's comparisons; all at a distance of kinks."""
    for kink in (1.0, 2.0, 1.3, 0.7):
        x, y = (value + 1e-3 if abs(value - kink) < 1e-6 else value for value in (x, y))
    if abs(x - y) < 1e-6:
        y += 1e-3
    branched = expression.rewrite(sp.Piecewise) if expression.has(Select) else expression
    places = {X: x, Y: y, K: 1.3, U: 0.7}
    expected = [float(branched.subs(places)), *(float(branched.diff(z).subs(places).doit()) for z in (X, Y))]
    assert evaluate(program_of(expression, derivatives=True), x, y) == pytest.approx(expected, rel=1e-9, abs=1e-10)


@pytest.mark.parametrize("x", [-2.0, -1.0, -0.0, 0.0, 1.0, 2.0])
@pytest.mark.parametrize("y", [-1.0, 0.0, 1.0])
def test_angles_in_all_quadrants_and_on_the_axes(x: float, y: float) -> None:
    value, by_x, by_y = evaluate(program_of(sp.atan2(Y, X), derivatives=True), x, y)
    assert value == pytest.approx(math.atan2(y, x + 0.0), rel=1e-15)
    square = x * x + y * y
    assert [by_x, by_y] == pytest.approx([-y / square, x / square] if square else [0, 0], rel=1e-14)


def test_a_removable_pole_is_removed() -> None:
    sinc = sp.Piecewise((1, sp.Eq(X, 0)), (sp.sin(X) / X, True))
    assert evaluate(program_of(sinc, derivatives=True), 0.0, 1.0).tolist() == [1, 0, 0]


def test_branches_take_a_side_for_a_value() -> None:
    program = program_of(S * X, Select(S, X, Y), X * Select(S, 1, 0) + Y * Select(-S, 1, 0), Select(S, 1, -1))
    assert evaluate(program, 2.0, 3.0, s=1.0).tolist() == [2, 2, 2, 1]
    assert evaluate(program, 2.0, 3.0, s=-1.0).tolist() == [-2, 3, 3, -1]


def test_without_a_condition_that_holds_there_is_no_value() -> None:
    assert np.isnan(evaluate(program_of(sp.Piecewise((X, X > 2))), 1.0, 1.0)).all()


def test_select_prints_folds_and_differentiates() -> None:
    select = Select(X, Y**2, X * Y)
    assert str(select) == "Select(x, y**2, x*y)"
    assert r"\begin{cases} y^{2} & \text{for}\: x > 0" in sp.latex(select)
    assert select.diff(Y) == Select(X, 2 * Y, X)
    assert select.subs(X, 1) == Y**2 and select.subs(X, 0) == 0 and Select(X, Y, Y) == Y


def test_work_on_theta_and_input_is_hoisted() -> None:
    program = program_of(X * sp.exp(K) * U / (sp.sin(K) + U) / 3)
    assert [TABLE[code].name for code in program.stage[:, 0]] == ["mul"]
    program = program_of(K + X + sp.sqrt(K) + Y + U + 2)
    assert len(program.stage) == 2


def test_one_division_for_a_quotient() -> None:
    program = program_of(X * K / (Y * (X + 1) * U))
    assert sum(TABLE[code].name == "div" for code in program.stage[:, 0]) == 1
    assert len(program.stage) == 4  # x + 1, times y, into x, times k / u


def test_common_parts_are_done_once() -> None:
    program = program_of(X * Y * sp.sin(X), X * Y * sp.cos(X), X * Y, (X - Y) * K, (Y - X) * U)
    assert len(program.stage) == 8


@pytest.mark.parametrize(
    ("expression", "message"),
    [
        (sp.gamma(X), "gamma"),
        (sp.Function("f")(X), "f"),
        (sp.Symbol("z") + X, "given z"),
        (X * sp.I, "ImaginaryUnit"),
        (X + sp.oo, "finite"),
        (sp.Integral(sp.exp(X**3), X), "Integral"),
        (sp.Piecewise((X, sp.Xor(X > 0, Y > 0)), (Y, True)), "Xor"),
    ],
)
def test_what_cannot_be_expressed_is_named(expression: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        program_of(expression)


def test_depth_does_not_matter() -> None:
    depth, expression = 5000, X
    for _ in range(depth):
        expression = sp.Add(sp.Mul(expression, sp.Rational(1, 2), evaluate=False), 1, evaluate=False)
    value, by_x, _ = evaluate(program_of(expression, derivatives=True), 1.0, 0.0)
    assert value == pytest.approx(2.0, rel=1e-12)
    assert by_x == pytest.approx(0.0, abs=1e-300)
