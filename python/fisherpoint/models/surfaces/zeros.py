"""Where expressions are zero: when two of them are zero together."""

from __future__ import annotations

from typing import Any

import sympy

from ..tape.numbers import is_number


def normal_form(expression: Any) -> tuple[Any, int]:
    """Return what is the same for all non-zero multiples of an expression, and the sign of the multiple, 1 or -1.

    Factors that are positive whatever their symbols are do not count.
    """
    factors = [factor for factor in sympy.Mul.make_args(expression) if not (factor.is_positive and not factor.is_Number)]
    coefficient, rest = sympy.Mul(*factors).as_coeff_Mul()
    terms = rest.as_coefficients_dict()
    first = min(terms, key=sympy.default_sort_key)
    scale = float(terms[first])
    form = frozenset((term, float(f"{float(factor) / scale:.12e}")) for term, factor in terms.items())
    return form, 1 if float(coefficient) * scale > 0 else -1


def reduced(expression: Any) -> tuple[Any, int]:
    """Return the expression without numerical factor and without positive factors, and the sign that was taken out."""
    factors = [factor for factor in sympy.Mul.make_args(expression) if not factor.is_positive]
    coefficient, rest = sympy.Mul(*factors).as_coeff_Mul()
    if is_number(rest, 1):
        return expression, 1
    sign = -1 if coefficient < 0 else 1
    rest = rest.primitive()[1]
    if rest.is_Add and sum(bool(term.could_extract_minus_sign()) for term in rest.args) == len(rest.args):
        rest, sign = -rest, -sign
    return rest, sign
