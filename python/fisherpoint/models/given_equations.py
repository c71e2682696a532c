"""Equations, conditions and limits as a model is given them: expressions of SymPy, terms, or text."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence, Set
from typing import Any, NamedTuple

import sympy

from ..basics.checks import as_sequence
from ..basics.messages import listed, shown
from ..basics.quantity import Quantity, names_of
from .equation_text import parse_equation, parse_limit
from .expressions import checked
from .tape.delay import delay_in
from .tape.parts import replaced, symbols_of
from .terms import Term


def listed_equations(given: Any, place: str) -> list[Any]:
    """The equations of a matrix, a sequence, or one alone."""
    if given is None:
        return []
    if isinstance(given, sympy.MatrixBase):
        return list(given.flat())
    if isinstance(given, str | sympy.Basic | Term | Written):
        return [given]
    if isinstance(given, Mapping) or not isinstance(given, Iterable):
        raise TypeError(f"{place}: expected a sequence of equations, given {shown(given)}")
    if isinstance(given, Set):
        raise TypeError(f"{place}: expected equations in an order, given {shown(given)}")
    return list(as_sequence(given, place, "equations"))


def check_count(given: list[Any], place: str, quantities: tuple[Quantity, ...]) -> None:
    """Raise where there is not one equation for each of the quantities."""
    if len(given) != len(quantities):
        one_for_each = f", one for each of {listed(names_of(quantities))}" if quantities else ""
        raise ValueError(f"{place}: expected {len(quantities)} equations{one_for_each}; given {len(given)}")


class Written(NamedTuple):
    """An equation that has been read: as an expression, in which definitions are symbols, and the text that was given."""

    expression: Any
    given: str | None = None


def equation_of(given: Any, symbols: Mapping[str, Any], place: str, clocks: Mapping[str, Any]) -> Written:
    """An equation as it is written; `clocks` are the names of the time."""
    if isinstance(given, Written):
        return given
    if isinstance(given, str):
        return Written(parse_equation(given, symbols, place, clocks), given)
    return Written(checked(given, symbols, place, clocks))


def condition_of(given: Any, symbols: Mapping[str, Any], place: str, clocks: Mapping[str, Any]) -> Written:
    """A condition as what must be positive."""
    given = given.expression if isinstance(given, Term) and not given.lost else given
    if isinstance(given, sympy.StrictGreaterThan | sympy.GreaterThan):
        given = given.lhs - given.rhs
    elif isinstance(given, sympy.StrictLessThan | sympy.LessThan):
        given = given.rhs - given.lhs
    return equation_of(given, symbols, place, clocks)


def limits_of(
    texts: Sequence[str], symbols: Mapping[str, Any], offsets: Mapping[str, str], moving: Set[Any]
) -> tuple[tuple[str, Any], ...]:
    """Each limit along the way, by its text, as expressions that must stay positive.

    States with `offsets` start off x0 by these.
    """
    shift = {symbols[state]: symbols[state] + symbols[offset] for offset, state in offsets.items()}
    found = []
    for i, text in enumerate(texts):
        place = f"along[{i}]"
        conditions = parse_limit(text, symbols, place)
        moved = [one for one in conditions if (read := symbols_of(one)) & moving or any(map(delay_in, read))]
        # Of max(x, v) - min(x, v) < 1, some of the cases are 0 < 1.
        if not moved or not all(condition in moved or condition.is_positive for condition in conditions):
            raise ValueError(f"{place}: expected a limit of states or inputs, given {shown(text)}")
        found += [(text, replaced(condition, shift)) for condition in moved]
    return tuple(found)
