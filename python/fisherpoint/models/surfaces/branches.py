"""What is not smooth in f: switching surfaces, and f with a symbol for the side of each."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import sympy
from sympy.functions.elementary.piecewise import ExprCondPair
from sympy.logic.boolalg import Boolean

from ..tape.branch import Select
from ..tape.defined import value_of
from ..tape.parts import parts, reads, remade, replaced
from ..tape.programs import LIMIT
from .printing import to_text
from .zeros import Multiples, normal_form, reduced


@dataclass(frozen=True)
class Surface:
    """A switching surface: what is zero on it as it is written and rewritten, and the symbol of its side.

    `jump`: f, or another surface, may jump there; `crossable`: no other surface does.
    """

    written: Any
    expression: Any
    side: sympy.Dummy
    jump: bool = True
    crossable: bool = True

    @property
    def name(self) -> str:
        return to_text(self.written)


class Branches:
    """Rewrites expressions so that every branch on the sign of an expression that reads the state is a branch on a side.

    With `by_side` False branches stay branches on values: for the output, which is only taken at the end.

    Attributes
    ----------
    surfaces : list of Surface
        Those found so far, inner ones before those that read their side.
    seamless : mapping of sympy.Dummy to sympy.Dummy
        From a second symbol for a side to the side itself. min, max and abs read the second one: whichever value it has, they are
        the same on the surface.
    origin : mapping of expression to expression
        From rewritten parts to the parts as they were written.
    """

    def __init__(
        self,
        states: Iterable[sympy.Symbol],
        by_side: bool,
        inputs: Iterable[sympy.Symbol] = (),
        constants: Mapping[Any, float] | None = None,
    ) -> None:
        self.states, self.by_side = frozenset(states), by_side
        self._multiples = Multiples((*self.states, *inputs), constants or {})
        self.surfaces: list[Surface] = []
        self.seamless: dict[Any, Any] = {}
        self.origin: dict[Any, Any] = {}
        self._known: dict[Any, Any] = {}
        self._merged: dict[Any, Any] = {}
        self._by_form: dict[Any, tuple[sympy.Dummy, sympy.Dummy, Any]] = {}

    def rewrite(self, expression: Any) -> Any:
        for part in parts(expression):
            if part not in self._known and (part.is_Symbol or not isinstance(part, Boolean | ExprCondPair)):
                self._known[part] = self._rewrite(part)
                self.origin.setdefault(self.merged(self._known[part]), part)
        return self._known[expression]

    def merged(self, expression: Any) -> Any:
        """A rewritten expression with one symbol alone for each side."""
        return replaced(expression, self.seamless, self._merged) if self.seamless else expression

    def _rewrite(self, part: Any) -> Any:
        if not part.args:
            return part
        if isinstance(part, sympy.Piecewise):
            *branches, (last, _) = part.args
            value = self._known[last]
            for inner, condition in reversed(branches):
                value = self._branch(condition, self._known[inner], value)
            return value
        args = tuple(self._known[argument] for argument in part.args)
        if isinstance(part, sympy.Max | sympy.Min):
            return self._extreme(part)
        if isinstance(part, sympy.Abs):
            side = self._side(part.args[0], args[0], seamless=True)
            return remade(part, args) if side is None else side * args[0]
        if isinstance(part, sympy.sign | sympy.Heaviside):
            side = self._side(part.args[0], args[0])
            if isinstance(part, sympy.Heaviside):
                return Select(args[0], 1, 0) if side is None else _by_sign(side, sympy.S.One, sympy.S.Zero)
            return remade(part, args) if side is None else side
        return remade(part, args)

    def _extreme(self, part: Any) -> Any:
        """The largest or smallest argument, two by two; what reads the state comes first, so that "h - 2" is said, not "2 - h"."""
        first, *others = sorted(part.args, key=lambda argument: not reads(argument, self.states))
        written, value = first, self._known[first]
        for other in others:
            new = self._known[other]
            a, b = (value, new) if isinstance(part, sympy.Max) else (new, value)
            side = self._side(written - other, value - new, seamless=True)
            if side is not None:
                value = _by_sign(side, a, b)
            elif value != new:
                value = remade(part, (value, new))
            written = part.func(written, other, evaluate=False)
        return value

    def _branch(self, condition: Any, yes: Any, no: Any) -> Any:
        """yes where the condition holds, else no."""
        if condition == sympy.true or condition == sympy.false:
            return yes if condition == sympy.true else no
        if isinstance(condition, sympy.Not):
            return self._branch(condition.args[0], no, yes)
        if isinstance(condition, sympy.And | sympy.Or):
            return Select(self._holds(condition), yes, no)
        return self._compare(condition, yes, no)

    def _holds(self, condition: Any) -> Any:
        """What is positive where the condition holds; of many conditions by halves, so that it is not deep."""
        if not isinstance(condition, sympy.And | sympy.Or):
            value = self._branch(condition, sympy.S.One, sympy.S.NegativeOne)
            return value.args[0] if isinstance(value, Select) and value.args[1:] == (1, -1) else value
        values = [self._holds(part) for part in condition.args]
        while len(values) > 1:
            pairs = zip(values[::2], values[1::2], strict=False)
            joined = [Select(a, b, -1) if isinstance(condition, sympy.And) else Select(a, 1, b) for a, b in pairs]
            values = joined + values[2 * len(joined) :]
        return values[0]

    def _compare(self, comparison: Any, yes: Any, no: Any) -> Any:
        left, right = comparison.args
        difference = self._known[left] - self._known[right]
        side = self._side(left - right, difference)
        greater = isinstance(comparison, sympy.StrictGreaterThan | sympy.GreaterThan)
        if side is not None:
            return _by_sign(side, *((yes, no) if greater else (no, yes)))
        if isinstance(comparison, sympy.StrictGreaterThan | sympy.StrictLessThan):
            return Select(difference if greater else -difference, yes, no)
        return Select(-difference if greater else difference, no, yes)

    def _side(self, written: Any, condition: Any, seamless: bool = False) -> Any:
        """The side, or its negative, of the surface where the condition is zero; None where the state does not enter."""
        if not self.by_side or not reads(condition, self.states):
            return None
        condition = value_of(condition)
        merged = self.merged(condition)
        form, sign = normal_form(merged)
        if form not in self._by_form and (found := self._multiple(merged)) is not None:
            (side, second), orientation = found
            self._by_form[form] = side, second, sign * orientation
        if form not in self._by_form:
            if len(self.surfaces) == LIMIT:
                raise ValueError(f"f: expected at most {LIMIT} switching surfaces and limits, given more than {LIMIT} surfaces")
            shown, turned = reduced(written)
            side, second = (sympy.Dummy(f"side_{len(self.surfaces)}", real=True) for _ in range(2))
            self.surfaces.append(Surface(shown, condition if turned > 0 else -condition, side))
            self.seamless[second] = side
            self._by_form[form] = side, second, sign * turned
        side, second, orientation = self._by_form[form]
        return sign * orientation * (second if seamless else side)

    def _multiple(self, condition: Any) -> tuple[tuple[sympy.Dummy, sympy.Dummy], Any] | None:
        """The side of a surface of which the condition is a multiple, with the sign of that; None where there is none."""
        seconds = {side: second for second, side in self.seamless.items()}
        for surface in self.surfaces:
            if (sign := self._multiples.sign(condition, self.merged(surface.expression))) is not None:
                return (surface.side, seconds[surface.side]), sign
        return None


def _by_sign(side: Any, a: Any, b: Any) -> Any:
    return Select(-side, b, a) if (-side).is_Symbol else Select(side, a, b)
