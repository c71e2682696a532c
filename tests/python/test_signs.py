"""Signs that expressions have whatever their symbols are: what is seen at once is what SymPy finds at length."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
import sympy

from fisherpoint.models.tape.parts import evaluated, remade
from fisherpoint.models.tape.signs import is_nonnegative, is_nonzero, is_positive

X, Y, Z = sympy.symbols("x y z", real=True)
A = sympy.Symbol("a", positive=True)
D = sympy.Symbol("d", nonzero=True, real=True)
NUMBERS = tuple(map(sympy.sympify, (0, 1, -1, 2, sympy.Rational(-1, 2), 0.25)))


def drawn(rng: np.random.Generator, depth: int) -> Any:
    """An expression of few symbols and nice numbers, so that zeros, squares and equal parts occur."""
    if depth == 0 or rng.random() < 0.15:
        leaves = (X, Y, Z, A, D, *NUMBERS)
        return leaves[rng.integers(len(leaves))]
    a, b = drawn(rng, depth - 1), drawn(rng, depth - 1)
    made = [lambda: a + b, lambda: a - b, lambda: a * b, lambda: a**2, lambda: sympy.Abs(a), lambda: sympy.exp(a)]
    made += [lambda: a**4 + b**2, lambda: a**2 * sympy.Rational(1, 2) + 1]
    made += [lambda: a * b * (a + X), lambda: (a - b) * (X + 1) - b, lambda: sympy.sign(a) * b]
    return made[rng.integers(len(made))]()


@pytest.mark.parametrize("seed", range(8))
def test_signs_are_those_of_sympy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(100):
        expression = drawn(rng, 3)
        assert is_positive(expression) == bool(expression.is_positive), expression
        assert is_nonzero(expression) == bool(expression.is_nonzero), expression
        assert is_nonnegative(expression) == bool(expression.is_nonnegative), expression
        assert evaluated(sympy.sign, expression) == sympy.sign(expression), expression


def test_even_powers_of_what_has_a_value_are_not_negative() -> None:
    root = sympy.sqrt(X) + Y  # real where it has a value; SymPy asks whether it has one
    assert is_nonnegative(root**2 + 3 * (X - 1) ** 4) and not is_positive(root**2)
    assert not is_nonnegative(root**2 - 1) and not is_nonnegative(root**3) and not is_nonnegative(-(root**2))


def test_odd_functions_take_sums_and_products_as_sympy_does() -> None:
    arguments = [X + Y, -X - Y, (X - Y) * Z, -X * Y, X / D, 2 * A, A - A, sympy.Integer(2), sympy.sqrt(2) + 1, X, -X, sympy.S.Zero]
    arguments += [sympy.tanh(X), sympy.atanh(X), sympy.asinh(Y), sympy.Float(0.5), sympy.pi / 4, sympy.pi - 3]
    for function, argument in itertools.product((sympy.tanh, sympy.sinh, sympy.atan, sympy.asinh, sympy.sin, sympy.exp), arguments):
        assert evaluated(function, argument) == function(argument), (function, argument)


def test_a_product_with_zero_is_zero_unless_a_factor_is_not_finite() -> None:
    product = X * Y * sympy.sqrt(Z)
    assert remade(product, (sympy.S.Zero, Y, 1 / (X - Z))) == 0
    for factor in (sympy.zoo, sympy.oo, -sympy.oo, sympy.nan):
        assert remade(product, (sympy.S.Zero, Y, factor)) is sympy.nan
