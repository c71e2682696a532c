"""The table of functions: each row against SymPy and mpmath, by every route that is made of it."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
import sympy

from fisherpoint.basics.formulas import ARGUMENTS
from fisherpoint.basics.function_table import FUNCTIONS, Function
from fisherpoint.design.goal.functions_of_parameters import gradient_of
from fisherpoint.models.functions import FUNCTIONS as OF_TERMS
from fisherpoint.models.surfaces.evaluate import evaluate
from fisherpoint.models.surfaces.precise import Calculation, Work
from fisherpoint.models.tape.differentiate import gradient
from fisherpoint.models.tape.from_sympy import nodes_of
from fisherpoint.models.tape.graph import Graph, Leaves
from fisherpoint.models.tape.kinds import KINDS, expression_of
from fisherpoint.models.tape.schedule import schedule

X = sympy.Symbol("x", real=True)
AT = np.array([0.07, 0.31, 0.5, 0.83])

every = pytest.mark.parametrize("row", FUNCTIONS, ids=lambda row: row.name)


def exact(row: Function, order: int = 0) -> np.ndarray:
    """Values, or derivatives, at `AT`, in double precision."""
    if row.at_zero == "jump":
        return np.full(len(AT), 0.0 if order else 1.0)
    function = {"abs": mpmath.fabs}.get(row.name) or getattr(mpmath, row.name)
    with mpmath.workdps(40):
        return np.array([float(mpmath.diff(function, mpmath.mpf(x), order)) for x in AT.tolist()])


@every
def test_all_routes_have_the_same_value(row: Function) -> None:
    term = OF_TERMS[row.name](X)
    graph = Graph(Leaves(0, 0, 1, 0))
    program = schedule(graph, nodes_of(graph, [term], {X: graph.leaves.x.start}))
    empty = np.empty((len(AT), 0))
    by_core = program.evaluate(empty, empty, AT[:, None], empty, np.zeros((len(AT), 1)))[:, 0]
    by_parts = np.array([float(np.real(evaluate([term], {X: x})[0])) for x in AT.tolist()])
    for values in ([row.value(x) for x in AT.tolist()], row.arrays(AT), by_core, by_parts):
        np.testing.assert_allclose(np.asarray(values, dtype=float), exact(row), rtol=1e-14)
    if not row.at_zero:
        values = [float(Calculation([term], Work(1000))({X: mpmath.mpf(x)})[0][0].real) for x in AT.tolist()]
        np.testing.assert_allclose(values, exact(row), rtol=1e-15)


@every
def test_its_slope_is_its_derivative(row: Function) -> None:
    graph = Graph(Leaves(0, 0, 1, 0))
    (x,) = graph.leaves.x
    (root,) = nodes_of(graph, [OF_TERMS[row.name](X)], {X: x})
    found = gradient(graph, [root], [x])[0].get(x, graph.zero)
    empty = np.empty((len(AT), 0))
    slopes = schedule(graph, [found]).evaluate(empty, empty, AT[:, None], empty, np.zeros((len(AT), 1)))[:, 0]
    np.testing.assert_allclose(slopes, exact(row, 1), rtol=1e-13, atol=1e-300)
    if row.slope:
        values = [gradient_of(f"{row.name}(a)", {"a": x}, "of")[1][0] for x in AT.tolist()]
        np.testing.assert_allclose(values, exact(row, 1), rtol=1e-13)


@every
def test_its_symmetry_is_as_stated(row: Function) -> None:
    sign = {"odd": -1.0, "even": 1.0}.get(row.symmetry)
    if sign is not None:
        np.testing.assert_array_equal(row.arrays(-AT), sign * row.arrays(AT))


@every
def test_it_has_no_value_where_its_limits_are_broken(row: Function) -> None:
    for text in row.positive:
        limit = sympy.lambdify(X, expression_of(text, X), "numpy")
        outside = [x for x in np.linspace(-3, 3, 61) if limit(x) < -1e-9]
        with np.errstate(invalid="ignore"):
            assert len(outside) > 5 and np.isnan(row.arrays(np.array(outside))).all()
    for text in row.nonzero:
        (pole, *_) = [float(x) for x in (sympy.nsolve(expression_of(text, X), X, 1.5),)]
        assert abs(row.arrays(np.float64(pole))) > 1e10


def test_formulas_and_terms_have_all_of_them() -> None:
    names = [row.name for row in FUNCTIONS]
    assert list(ARGUMENTS)[: len(names)] == names and set(names) <= set(OF_TERMS)
    assert set(KINDS.values()) == {row for row in FUNCTIONS if row.name != "sqrt"}
