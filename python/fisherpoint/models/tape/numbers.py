"""Numbers in SymPy expressions: whole ones are Integers however they were written, as SymPy takes 1.0 for another number than 1."""

from __future__ import annotations

from typing import Any

import sympy

LARGEST = 2**53
"""Whole numbers below it are exact as doubles."""


def exact(value: float) -> Any:
    """The number of SymPy for a finite one of Python: an Integer where it is whole, so that 0.0 is 0 and x**2.0 is x**2."""
    whole = abs(value) < LARGEST and float(value).is_integer()
    return sympy.Integer(int(value)) if whole else sympy.Float(float(value))


def is_number(expression: Any, value: float) -> bool:
    """Whether an expression is this number, written in whichever way: `==` of SymPy is False for 0.0 and 0."""
    return bool(expression.is_Number and expression.is_comparable and float(expression) == value)


def with_exact_numbers(part: Any) -> Any:
    """A part of an expression with such numbers."""
    if part.is_Float:
        return exact(part)
    return part.base ** exact_exponent(part.exp) if part.is_Pow and part.exp.is_Float else part


def exact_exponent(exponent: Any) -> Any:
    """A number as an exponent, with halves as quotients: x**0.5 is a root, as sqrt(x) is."""
    if abs(exponent) < LARGEST and float(2 * exponent).is_integer():
        return sympy.Rational(int(2 * exponent), 2)
    return exponent
