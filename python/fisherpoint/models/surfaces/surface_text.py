"""Rewritten expressions as a user would write them: branches as where(), and the sides of surfaces by what is zero on these."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy

from ..tape.branch import Select
from ..tape.numbers import is_number
from ..tape.parts import cases, reads, rebuilt


def in_words(expression: Any, sides: Mapping[Any, Any]) -> Any:
    """The expression without `Select` and sides; `sides` has what is zero on each surface by the symbol of its side."""
    if not reads(expression, sides) and not expression.has(Select):
        return expression

    def change(part: Any, now: Any) -> Any:
        if isinstance(part, Select):
            return cases(now.args[1], _condition(part.args[0], sides, made), now.args[2]) if isinstance(now, Select) else now
        return sympy.sign(sides[part]) if part in sides else now

    made: dict[Any, Any] = {}
    return rebuilt(expression, change, made)


def _condition(condition: Any, sides: Mapping[Any, Any], made: Mapping[Any, Any]) -> Any:
    """When what a branch goes by is positive."""
    if condition.is_number:
        return sympy.true if condition.is_positive else sympy.false
    if condition in sides:
        return sympy.StrictGreaterThan(sides[condition], 0, evaluate=False)
    if -condition in sides:
        return sympy.StrictLessThan(sides[-condition], 0, evaluate=False)
    if isinstance(condition, Select):
        first, a, b = condition.args
        holds = _condition(first, sides, made)
        if is_number(a, -1) and is_number(b, 1):
            return sympy.Not(holds, evaluate=False)
        if is_number(b, -1):
            return sympy.And(holds, _condition(a, sides, made), evaluate=False)
        if is_number(a, 1):
            return sympy.Or(holds, _condition(b, sides, made), evaluate=False)
    return sympy.StrictGreaterThan(made.get(condition, condition), 0, evaluate=False)
