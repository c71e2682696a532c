"""The functions that the equations of a model may use, on SymPy expressions.

They are reached as ``fp.sqrt``, ``fp.where`` and so on. SymPy is imported when the first of them is asked for.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from typing import Any

import sympy
from sympy.logic.boolalg import Boolean

__all__ = ["ARGUMENTS", "FUNCTIONS", "NAMES", "heaviside", "sign", "sqrt", "tanh", "where"]

heaviside, sign, sqrt, tanh = sympy.Heaviside, sympy.sign, sympy.sqrt, sympy.tanh


def where(condition: Any, a: Any, b: Any) -> Any:
    """a where the condition, a comparison or several joined by & and |, holds, else b."""
    if condition in (True, False, sympy.true, sympy.false):
        return sympy.sympify(a if condition else b)
    if not isinstance(condition, Boolean) or condition.is_Symbol:
        raise TypeError(f"where: expected a condition such as x.h > 0, given {condition}")
    return sympy.Piecewise((a, condition), (b, True), evaluate=False)


def _extreme(kind: Any, number: Callable[..., Any]) -> Callable[..., Any]:
    def extreme(*arguments: Any) -> Any:
        given = [sympy.sympify(argument) for argument in arguments]
        if len(given) < 2:
            raise TypeError(f"{kind.__name__.lower()}: expected at least 2 arguments, given {len(given)}")
        if all(argument.is_Number for argument in given):
            return number(given)
        # Unevaluated: SymPy would try at length to decide which is larger.
        distinct = list(dict.fromkeys(given))
        return kind(*distinct, evaluate=False) if len(distinct) > 1 else distinct[0]

    extreme.__doc__ = f"The {'larger' if kind is sympy.Max else 'smaller'} of the arguments."
    return extreme


FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{name: getattr(sympy, name) for name in ("sqrt", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "atan2")},
    **{name: getattr(sympy, name) for name in ("sinh", "cosh", "tanh", "sign")},
    "abs": sympy.Abs,
    "heaviside": heaviside,
    "min": _extreme(sympy.Min, lambda given: reduce(lambda a, b: a if a <= b else b, given)),
    "max": _extreme(sympy.Max, lambda given: reduce(lambda a, b: a if a >= b else b, given)),
    "where": where,
}
"""By the name that equations use."""

NAMES = tuple(FUNCTIONS)
ARGUMENTS = {name: (1, 1) for name in NAMES} | {"atan2": (2, 2), "min": (2, 32), "max": (2, 32), "where": (3, 3)}
"""The least and the largest number of arguments of each."""
