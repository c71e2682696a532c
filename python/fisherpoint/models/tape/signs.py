"""Signs of expressions that they have whatever their symbols are, as SymPy knows them."""

from __future__ import annotations

from typing import Any

import sympy

_DEEPEST = 4
"""How many sums and products, one in the other, are looked into."""


def is_positive(expression: Any) -> bool:
    """Whether an expression is known to be positive."""
    return not may_have_any_sign(expression) and bool(expression.is_positive)


def is_nonnegative(expression: Any) -> bool:
    """Whether an expression is known not to be negative."""
    return _is_sum_of_squares(expression) or (not may_have_any_sign(expression) and bool(expression.is_nonnegative))


def is_nonzero(expression: Any) -> bool:
    """Whether an expression is known to be other than zero."""
    return not may_have_any_sign(expression) and bool(expression.is_nonzero)


def may_have_any_sign(expression: Any) -> bool:
    """Whether that is seen at once: of a symbol, of a product with such a factor, of a sum with such a term.

    SymPy would find no sign, but at length. Not seen is what stands deeper than a few sums and products.
    """
    level = [expression]
    for _ in range(1 + _DEEPEST):
        if any(one.is_Symbol and _is_open(one) for one in level):
            return True
        level = list({id(part): part for one in level if one.is_Add or one.is_Mul for part in one.args}.values())
    return False


def _is_open(symbol: Any) -> bool:
    return symbol.is_zero is None and symbol.is_nonnegative is None and symbol.is_nonpositive is None


def _is_sum_of_squares(expression: Any) -> bool:
    """Whether each term is a positive number, an even power, or a product of them; all that has a value here is real."""
    factors = (factor for term in sympy.Add.make_args(expression) for factor in sympy.Mul.make_args(term))
    return all(one.is_positive if one.is_Number else one.is_Pow and one.exp.is_even and one.exp.is_positive for one in factors)
