"""What is not smooth in f: switching surfaces, and f with a symbol for the side of each."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import sympy
from sympy.functions.elementary.piecewise import ExprCondPair
from sympy.logic.boolalg import Boolean

from ..tape.branch import Select
from ..tape.defined import value_of
from ..tape.parts import parts, reads, remade, replaced
from ..tape.programs import MOST_SURFACES
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
        most: float = MOST_SURFACES,
    ) -> None:
        self.states, self.by_side, self._most = frozenset(states), by_side, most
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
            return self._by_size(part.args[0], args[0], sympy.S.Zero, partial(self._sign, part))
        return remade(part, args)

    def _sign(self, part: Any, written: Any, value: Any) -> Any:
        side = self._side(written, value)
        if isinstance(part, sympy.Heaviside):
            return Select(value, 1, 0) if side is None else _by_sign(side, sympy.S.One, sympy.S.Zero)
        return remade(part, (value,)) if side is None else side

    def _extreme(self, part: Any) -> Any:
        """The largest or smallest argument, two by two; what reads the state comes first, so that "h - 2" is said, not "2 - h"."""
        first, *others = sorted(part.args, key=lambda argument: not reads(argument, self.states))
        written, value = first, self._known[first]
        for other in others:
            new = self._known[other]
            if new == 0:
                value = self._by_size(written, value, new, partial(self._of_two, part, new), scaled=True)
            else:
                value = self._of_two(part, new, written - other, value)
            written = part.func(written, other, evaluate=False)
        return value

    def _of_two(self, part: Any, new: Any, written: Any, value: Any) -> Any:
        """The larger or smaller of two values, whose difference is as written."""
        side = self._side(written, value - new, seamless=True)
        if side is not None:
            return _by_sign(side, *((value, new) if isinstance(part, sympy.Max) else (new, value)))
        return value if value == new else remade(part, (value, new))

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
        greater = isinstance(comparison, sympy.StrictGreaterThan | sympy.GreaterThan)
        strict = isinstance(comparison, sympy.StrictGreaterThan | sympy.StrictLessThan)
        above, below = (yes, no) if greater else (no, yes)

        def branch(written: Any, difference: Any) -> Any:
            side = self._side(written, difference)
            if side is not None:
                return _by_sign(side, above, below)
            return Select(difference, above, below) if greater == strict else Select(-difference, below, above)

        return self._by_size(left - right, self._known[left] - self._known[right], no if strict else yes, branch)

    def _by_size(self, written: Any, value: Any, of_zero: Any, use: Callable[[Any, Any], Any], scaled: bool = False) -> Any:
        """use(written, value), which depends on the value's sign; `of_zero` in a branch where it is zero as a whole.

        As a surface such a value would be one on which trajectories lie, instead of crossing it. What `use` returns is in
        proportion to the value, or does not depend on its size.
        """
        if (found := _zero_branch(value)) is None:
            return use(written, value)
        rest, branch = found
        condition, a, b = branch.args
        inside = b if a == 0 else a
        sign = self._sign_within(inside, condition, a != 0)
        other = rest * inside if sign == 0 else sign * rest
        taken = self._by_size(self._as_written(other), other, of_zero, use, scaled)
        if sign != 0 and scaled:
            return taken * (sign * branch)
        return Select(condition, *((of_zero, taken) if a == 0 else (taken, of_zero)))

    def _as_written(self, product: Any) -> Any:
        factors = sympy.Mul.make_args(product)
        return sympy.Mul(*(self.origin.get(self.merged(factor), factor) for factor in factors))

    def _sign_within(self, value: Any, condition: Any, holds: bool) -> int:
        """1 or -1 where the value has that sign wherever a side is positive, or is not; 0 where that is not known."""
        form, sign = normal_form(self.merged(value))
        side, second, orientation = self._by_form.get(form, (None, None, 0))
        for turned in (1, -1):
            if side is not None and condition in (turned * side, turned * second):
                return int(turned * sign * orientation * (1 if holds else -1))
        return 0

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
            if len(self.surfaces) == self._most:
                raise ValueError(f"f: expected at most {self._most} switching surfaces, given more")
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


def _zero_branch(value: Any) -> tuple[Any, Select] | None:
    """Split a product into a branch with a part that is zero, and the other factors; None where it has no such branch."""
    factors = sympy.Mul.make_args(value)
    for place, factor in enumerate(factors):
        if isinstance(factor, Select) and any(part == 0 for part in factor.args[1:]):
            return sympy.Mul(*factors[:place], *factors[place + 1 :]), factor
    return None


def _by_sign(side: Any, a: Any, b: Any) -> Any:
    return Select(-side, b, a) if (-side).is_Symbol else Select(side, a, b)
