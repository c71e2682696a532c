"""Expressions as a list of their parts, each once: to be compared, and to be sent to another process, however much they share.

SymPy's own way to pickle goes down by recursion, and its way to make a part from arguments works out what it is once more.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import sympy
from sympy.core.relational import Relational
from sympy.functions.elementary.piecewise import ExprCondPair

from .surfaces.structure import Equations
from .tape.definition import Definition
from .tape.parts import parts


class ExpressionList:
    """Parts of expressions, before those in which they stand.

    Attributes
    ----------
    entries : list
        A symbol or number, or (kind, places of the arguments), or (None, name, place of the value) of a definition.
    """

    def __init__(self) -> None:
        self.entries: list[Any] = []
        self._places: dict[Any, int] = {}

    def place_of(self, expression: Any) -> int:
        """The place of an expression, whose parts are added where they are not there; values of definitions are."""
        for part in parts(expression, known=self._places):
            if isinstance(part, Definition):
                entry: Any = None, part.name, self._places[part.value]
            else:
                entry = (part.func, tuple(self._places[argument] for argument in part.args)) if part.args else part
            self._places[part] = len(self.entries)
            self.entries.append(entry)
        return self._places[expression]

    def places_of(self, expressions: Sequence[Any]) -> tuple[int, ...]:
        return tuple(map(self.place_of, expressions))

    def expressions(self) -> list[Any]:
        """All parts, as they were."""
        made: list[Any] = []
        for entry in self.entries:
            if not isinstance(entry, tuple):
                made.append(entry)
            elif entry[0] is None:
                made.append(Definition(entry[1], made[entry[2]]))
            else:
                made.append(_made(entry[0], [made[place] for place in entry[1]]))
        return made

    def __reduce__(self) -> tuple[Any, ...]:
        return _with_entries, (self.entries,)


def _with_entries(entries: list[Any]) -> ExpressionList:
    made = ExpressionList()
    made.entries = entries
    return made


def _made(kind: Any, args: Sequence[Any]) -> Any:
    if issubclass(kind, ExprCondPair | sympy.Piecewise):
        return sympy.Basic.__new__(kind, *args)
    if issubclass(kind, sympy.Expr | Relational | sympy.And | sympy.Or | sympy.Not):
        return kind(*args, evaluate=False)
    return kind(*args)


def key_of(equations: Equations) -> tuple[Any, ...]:
    """What two models with the same equations share, and no others; it is compared in no time."""
    found = ExpressionList()

    def values(of: Iterable[tuple[Any, Any]]) -> tuple[tuple[str, int], ...]:
        return tuple((x.name, found.place_of(value)) for x, value in of)

    places = [found.places_of(of) for of in (equations.rates, equations.output, equations.conditions)]
    along = tuple((text, found.place_of(one)) for text, one in equations.along)
    resets = tuple((found.place_of(one.condition), values(one.values)) for one in equations.resets)
    updates = tuple((one.times, values(one.values)) for one in equations.updates)
    return (*places, along, resets, updates, tuple(found.entries))
