"""Derivatives of operations: complex steps and closed forms, on random arguments and at and next to switching values."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fisherpoint.models.tape.differentiate import gradient, rates_along
from fisherpoint.models.tape.graph import Graph
from fisherpoint.models.tape.program import OPERATIONS
from fisherpoint.models.tape.schedule import schedule
from tape_cases import at, small_graph

STEP = 1e-30
ANY = (-4.0, 4.0)
DOMAINS = {  # of functions that complex steps go through
    "sqrt": (1e-6, 9.0),
    "exp": ANY,
    "log": (1e-6, 9.0),
    "sin": ANY,
    "cos": ANY,
    "tan": (-1.5, 1.5),
    "asin": (-0.999, 0.999),
    "acos": (-0.999, 0.999),
    "atan": ANY,
    "sinh": ANY,
    "cosh": ANY,
    "tanh": ANY,
    "neg": ANY,
}
BINARY = {"add": ANY, "sub": ANY, "mul": ANY, "div": (0.1, 4.0), "pow": (0.1, 4.0)}
SWITCHING = {"abs", "sign", "min", "max", "select"}
FUSED = {"mul_add", "mul_sub", "sub_mul"}  # the scheduler's; never differentiated


def values_and_slopes(build: Callable[[Graph, int, int], int], x: Any) -> tuple[np.ndarray, np.ndarray]:
    """Value (K,) and both partial derivatives (K, 2) of a node of two states at rows of x."""
    graph, a, b = small_graph()
    node = build(graph, a, b)
    (found,) = gradient(graph, [node], [a, b])
    results = at(schedule(graph, [node, *(found.get(leaf, graph.zero) for leaf in (a, b))]), x)
    return results[:, 0], results[:, 1:]


def test_every_operation_is_tested() -> None:
    assert set(OPERATIONS) == {*DOMAINS, *BINARY, *SWITCHING, *FUSED}


@pytest.mark.parametrize("name", DOMAINS)
@settings(deadline=None)
@given(data=st.data())
def test_functions_agree_with_complex_steps(name: str, data: st.DataObject) -> None:
    a = data.draw(st.floats(*DOMAINS[name]))
    value, slope = values_and_slopes(lambda graph, a, _: graph.operation(name, a), [[a, 1.0]])
    stepped = OPERATIONS[name].compute(np.complex128(complex(a, STEP)))
    assert value[0] == pytest.approx(stepped.real, rel=1e-14, abs=1e-30)
    assert slope[0] == pytest.approx([stepped.imag / STEP, 0.0], rel=1e-11, abs=1e-14)


@pytest.mark.parametrize("name", BINARY)
@settings(deadline=None)
@given(data=st.data())
def test_operations_of_two_agree_with_complex_steps(name: str, data: st.DataObject) -> None:
    a, b = (data.draw(st.floats(*BINARY[name])) for _ in range(2))
    value, slope = values_and_slopes(lambda graph, a, b: getattr(graph, name)(a, b), [[a, b]])
    compute = OPERATIONS[name].compute
    by_a = compute(np.complex128(complex(a, STEP)), np.complex128(b)).imag / STEP
    by_b = compute(np.complex128(a), np.complex128(complex(b, STEP))).imag / STEP
    assert value[0] == pytest.approx(compute(a, b), rel=1e-13)
    assert slope[0] == pytest.approx([by_a, by_b], rel=1e-12, abs=1e-14)


@settings(deadline=None)
@given(a=st.floats(0.1, 2.0), b=st.floats(0.1, 2.0))
def test_a_mixture_agrees_with_complex_steps(a: float, b: float) -> None:
    def build(graph: Graph, a: int, b: int) -> int:
        root = graph.call("sqrt", graph.add(graph.mul(a, a), graph.mul(graph.literal(3.0), b)))
        quotient = graph.div(graph.call("exp", graph.neg(graph.div(a, b))), graph.sub(root, graph.literal(-1.0)))
        return graph.sub(graph.mul(quotient, graph.mul(b, root)), graph.pow(b, graph.literal(-2.5)))

    def formula(a: Any, b: Any) -> Any:
        root = np.sqrt(a * a + 3 * b)
        return np.exp(-a / b) / (root + 1) * b * root - b**-2.5

    value, slope = values_and_slopes(build, [[a, b]])
    expected = [formula(a + 1j * STEP, b).imag / STEP, formula(a, b + 1j * STEP).imag / STEP]
    assert value[0] == pytest.approx(formula(a, b), rel=1e-12)
    assert slope[0] == pytest.approx(expected, rel=1e-11)


TINY = np.nextafter(0.0, 1.0)


@pytest.mark.parametrize("a", [-2.0, -TINY, 0.0, TINY, 2.0])
def test_slopes_of_branches_are_one_sided(a: float) -> None:
    x = [[a, 3.0]]
    positive = a > 0
    assert values_and_slopes(lambda g, a, _: g.call("abs", a), x)[1].tolist() == [[1.0 if positive else -1.0, 0.0]]
    assert values_and_slopes(lambda g, a, _: g.call("sign", a), x)[1].tolist() == [[0.0, 0.0]]
    chosen = values_and_slopes(lambda g, a, b: g.select(a, g.mul(a, b), g.call("sin", b)), x)[1]
    assert chosen[0] == pytest.approx([3.0, a] if positive else [0.0, math.cos(3.0)], rel=1e-15)


@pytest.mark.parametrize("shift", [-1.0, -1e-15, 0.0, 1e-15, 1.0])
def test_slopes_of_extrema_are_those_of_one_operand(shift: float) -> None:
    a, b = 1.0, 1.0 + shift
    smaller = values_and_slopes(lambda g, a, b: g.min(a, b), [[a, b]])
    larger = values_and_slopes(lambda g, a, b: g.max(a, b), [[a, b]])
    assert smaller[0] == min(a, b) and larger[0] == max(a, b)
    assert smaller[1].sum() == 1 and larger[1].sum() == 1
    if a != b:
        assert smaller[1][0].tolist() == [float(a < b), float(b < a)]
        assert larger[1][0].tolist() == [float(a > b), float(b > a)]


@pytest.mark.parametrize("a", [-1.0, 0.0])
def test_the_branch_that_is_not_taken_may_have_no_value(a: float) -> None:
    """With its derivative it is discarded, on whichever path a factor comes to it."""

    def build(graph: Graph, a: int, b: int) -> int:
        root = graph.select(a, graph.mul(b, graph.call("sqrt", a)), graph.mul(a, b))
        return graph.mul(graph.mul(root, b), graph.add(graph.one, graph.select(a, graph.call("log", a), graph.zero)))

    value, slope = values_and_slopes(build, [[a, 2.0]])
    assert value[0] == a * 4.0
    assert slope[0].tolist() == [4.0, 2 * a * 2.0]


@pytest.mark.parametrize(("exponent", "a"), [(n, a) for n in range(-4, 8) for a in (-1.5, 0.0, 1.5) if n >= 0 or a])
def test_integer_powers_of_any_base(exponent: int, a: float) -> None:
    value, slope = values_and_slopes(lambda g, a, _: g.pow(a, g.literal(exponent)), [[a, 0.0]])
    assert value[0] == pytest.approx(a**exponent, rel=1e-14)
    assert slope[0, 0] == pytest.approx(exponent * a ** (exponent - 1) if exponent else 0.0, rel=1e-14)


@pytest.mark.parametrize("exponent", [2.0, 3.0, 2000.0, 1.7, 1.0])
def test_powers_with_an_exponent_known_at_run_time(exponent: float) -> None:
    """Hill's exponents: a state that starts at 0, and negative bases of integer exponents."""
    graph, a, _ = small_graph()
    theta = graph.leaves.theta[0]
    node = graph.pow(a, theta)
    (found,) = gradient(graph, [node], [a, theta])
    program = schedule(graph, [node, found[a], found[theta]])
    bases = [0.0, 0.5] if exponent == 1.7 else [-0.9, 0.0, 0.5]
    results = at(program, [[base, 0.0] for base in bases], theta=(exponent, 0.0))
    for base, (value, by_base, by_exponent) in zip(bases, results, strict=True):
        assert value == pytest.approx(base**exponent, rel=1e-13)
        assert by_base == pytest.approx(exponent * base ** (exponent - 1), rel=1e-13)
        if base >= 0:
            assert by_exponent == pytest.approx(base**exponent * math.log(base) if base else 0.0, rel=1e-13)


def test_the_slope_of_a_root_at_zero_is_infinite() -> None:
    assert values_and_slopes(lambda g, a, _: g.call("sqrt", a), [[0.0, 0.0]])[1][0, 0] == math.inf


@settings(deadline=None)
@given(x=st.tuples(st.floats(0.1, 3), st.floats(-3, 3)), dx=st.tuples(st.floats(-3, 3), st.floats(-3, 3)))
def test_rates_along_dx_are_directional_derivatives(x: tuple[float, float], dx: tuple[float, float]) -> None:
    graph, a, b = small_graph()
    node = graph.mul(graph.call("sin", graph.mul(a, b)), graph.add(graph.call("log", a), graph.mul(b, b)))
    (by_dx,) = rates_along(graph, [node])
    (partial,) = gradient(graph, [node], [a, b])
    rate, by_a, by_b = at(schedule(graph, [by_dx, partial[a], partial[b]]), [x], dx=dx)[0]
    assert rate == pytest.approx(by_a * dx[0] + by_b * dx[1], rel=1e-12, abs=1e-13)
    assert rates_along(graph, [graph.leaves.theta[0]]) == [graph.zero]


def test_what_does_not_depend_has_no_entry() -> None:
    graph, a, b = small_graph()
    assert gradient(graph, [graph.call("sign", a), b, graph.sub(graph.mul(a, b), graph.mul(b, a))], [a, b]) == [
        {},
        {b: graph.one},
        {},
    ]
