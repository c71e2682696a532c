"""What is not smooth in f: switching surfaces, and f with a symbol for the side of each."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import sympy
from sympy.functions.elementary.piecewise import ExprCondPair
from sympy.logic.boolalg import Boolean

from ..tape.branch import Select
from .expressions import parts
from .printing import to_text
from .zeros import normal_form, reduced, vanish_on


@dataclass(frozen=True)
class Surface:
    """A switching surface: its name, what is zero on it, the symbol of its side, and whether f jumps there."""

    name: str
    expression: Any
    side: sympy.Dummy
    jump: bool = True


class Branches:
    """Rewrites expressions so that every branch on the sign of an expression that reads the state is a branch on a side.

    With `by_side` False branches stay branches on values: for the output, which is only taken at the end.

    Attributes
    ----------
    surfaces : list of Surface
        Those found so far, inner ones before those that read their side.
    origin : mapping of expression to expression
        From rewritten parts to the parts as they were written.
    """

    def __init__(self, states: Iterable[sympy.Symbol], by_side: bool) -> None:
        self.states, self.by_side = frozenset(states), by_side
        self.surfaces: list[Surface] = []
        self.origin: dict[Any, Any] = {}
        self._known: dict[Any, Any] = {}
        self._by_form: dict[Any, tuple[sympy.Dummy, int]] = {}

    def rewrite(self, expression: Any) -> Any:
        for part in parts(expression):
            if part not in self._known and (part.is_Symbol or not isinstance(part, Boolean | ExprCondPair)):
                self._known[part] = self._rewrite(part)
                self.origin.setdefault(self._known[part], part)
        return self._known[expression]

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
        if isinstance(part, sympy.sign | sympy.Abs | sympy.Heaviside):
            side = self._side(part.args[0], args[0])
            if isinstance(part, sympy.Heaviside):
                return Select(args[0], 1, 0) if side is None else self._by_sign(side, sympy.S.One, sympy.S.Zero)
            if side is not None:
                return side * args[0] if isinstance(part, sympy.Abs) else side
        return part if args == part.args else part.func(*args)

    def _extreme(self, part: Any) -> Any:
        """The largest or smallest argument, two by two; what reads the state comes first, so that "h - 2" is said, not "2 - h"."""
        first, *others = sorted(part.args, key=lambda argument: not argument.free_symbols & self.states)
        written, value = first, self._known[first]
        for other in others:
            new = self._known[other]
            a, b = (value, new) if isinstance(part, sympy.Max) else (new, value)
            value = self._select(written - other, value - new, a, b)
            written = part.func(written, other, evaluate=False)
        return value

    def _branch(self, condition: Any, yes: Any, no: Any) -> Any:
        """yes where the condition holds, else no."""
        if condition == sympy.true or condition == sympy.false:
            return yes if condition == sympy.true else no
        if isinstance(condition, sympy.Not):
            return self._branch(condition.args[0], no, yes)
        if isinstance(condition, sympy.And):
            return reduce(lambda value, part: self._branch(part, value, no), reversed(condition.args), yes)
        if isinstance(condition, sympy.Or):
            return reduce(lambda value, part: self._branch(part, yes, value), reversed(condition.args), no)
        return self._compare(condition, yes, no)

    def _compare(self, comparison: Any, yes: Any, no: Any) -> Any:
        left, right = comparison.args
        difference = self._known[left] - self._known[right]
        side = self._side(left - right, difference)
        greater = isinstance(comparison, sympy.StrictGreaterThan | sympy.GreaterThan)
        if side is not None:
            return self._by_sign(side, *((yes, no) if greater else (no, yes)))
        if isinstance(comparison, sympy.StrictGreaterThan | sympy.StrictLessThan):
            return Select(difference if greater else -difference, yes, no)
        return Select(-difference if greater else difference, no, yes)

    def _select(self, written: Any, condition: Any, a: Any, b: Any) -> Any:
        side = self._side(written, condition)
        return Select(condition, a, b) if side is None else self._by_sign(side, a, b)

    @staticmethod
    def _by_sign(side: Any, a: Any, b: Any) -> Any:
        return Select(side, a, b) if side.is_Symbol else Select(-side, b, a)

    def _side(self, written: Any, condition: Any) -> Any:
        """The side, or its negative, of the surface where the condition is zero; None where the state does not enter."""
        if not self.by_side or not condition.free_symbols & self.states:
            return None
        form, sign = normal_form(condition)
        if form not in self._by_form:
            shown, turned = reduced(written)
            side = sympy.Dummy(f"side_{len(self.surfaces)}", real=True)
            self.surfaces.append(Surface(to_text(shown), condition if turned > 0 else -condition, side))
            self._by_form[form] = side, sign * turned
        side, orientation = self._by_form[form]
        return side if sign == orientation else -side


def classified(rates: Sequence[Any], surfaces: Sequence[Surface], states: Sequence[sympy.Symbol]) -> list[Surface]:
    """Return the surfaces with jumps told from kinks, jumps first.

    A surface is a kink where f, and every surface that reads its side, are the same on both sides of it.
    """
    everything = [*rates, *(surface.expression for surface in surfaces)]

    def jumps(surface: Surface) -> bool:
        read = [expression for expression in everything if surface.side in expression.free_symbols]
        sides = [tuple(expression.xreplace({surface.side: sympy.Integer(s)}) for s in (1, -1)) for expression in read]
        return not vanish_on([(above, below) for above, below in sides], surface.expression, states)

    told = [Surface(surface.name, surface.expression, surface.side, jumps(surface)) for surface in surfaces]
    return [surface for surface in told if surface.jump] + [surface for surface in told if not surface.jump]
