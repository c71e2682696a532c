"""The functions of equations as SymPy has them."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable
from functools import cache
from typing import Any

import sympy

from ...basics.formulas import Formula, Reader
from ...basics.function_table import FUNCTIONS, Function
from .parts import exact

KINDS: dict[Any, Function] = {kind: function for function in FUNCTIONS if isinstance(kind := getattr(sympy, function.sympy), type)}
"""The functions by their classes; a root is none, which is a power there."""


@cache
def formula(text: str) -> Formula:
    """A formula of the table of functions."""
    return Formula(text, "functions")


class _Expression(Reader):
    def number(self, node: ast.expr, value: float) -> Any:
        return exact(value)

    def combined(self, node: ast.expr, how: str, *values: Any) -> Any:
        return _OPERATORS[how](*values) if how in _OPERATORS else getattr(sympy, how)(*values)


_OPERATORS: dict[str, Callable[..., Any]] = {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv}


def expression_of(text: str, x: Any) -> Any:
    """A formula of the table as an expression, at this argument."""
    return _Expression(formula(text), {"x": x}).term()
