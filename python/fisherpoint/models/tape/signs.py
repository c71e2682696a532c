"""Signs of expressions that they have whatever their symbols are, as SymPy knows them."""

from __future__ import annotations

from typing import Any

import sympy


def is_positive(expression: Any) -> bool:
    """Whether an expression is known to be positive."""
    return not _may_have_any_sign(expression) and bool(expression.is_positive)


def is_nonnegative(expression: Any) -> bool:
    """Whether an expression is known not to be negative."""
    return _is_sum_of_squares(expression) or (not _may_have_any_sign(expression) and bool(expression.is_nonnegative))


def is_nonzero(expression: Any) -> bool:
    """Whether an expression is known to be other than zero."""
    return not _may_have_any_sign(expression) and bool(expression.is_nonzero)


def _may_have_any_sign(expression: Any) -> bool:
    """Whether that is seen at once: of a product of symbols, or of a sum with one. SymPy would find no sign, but at length."""
    if expression.is_Add:
        return any(map(_may_have_any_sign, expression.args))
    factors = [factor for factor in sympy.Mul.make_args(expression) if not factor.is_Number]
    return bool(factors) and all(one.is_Symbol and _is_open(one) for one in factors)


def _is_open(symbol: Any) -> bool:
    return symbol.is_zero is None and symbol.is_nonnegative is None and symbol.is_nonpositive is None


def _is_sum_of_squares(expression: Any) -> bool:
    """Whether each term is a positive number, an even power, or a product of them; all that has a value here is real."""
    factors = (factor for term in sympy.Add.make_args(expression) for factor in sympy.Mul.make_args(term))
    return all(one.is_positive if one.is_Number else one.is_Pow and one.exp.is_even and one.exp.is_positive for one in factors)
