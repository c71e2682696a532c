"""Powers of what is zero on one side of an edge, as sqrt(max(h - c, 0)): they are zero there, with all derivatives.

Written as a power of a branch they would have neither value nor derivative there, by the rule for a power. As a branch of powers
they have both. The power is continued evenly past the edge, |h - c|**0.5, so that a step of the integrator may look beyond before
it is cut off at the edge; so is one that stands in a branch which is taken on that side alone, as in where(h > c, sqrt(h - c), 0).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import sympy

from ..tape.branch import Guards, Select, guards_of
from ..tape.parts import is_number, parts, rebuilt
from .branches import Surface
from .limits import is_root
from .zeros import normal_form


class Powers:
    """Rewrites expressions that have sides of the given surfaces, or branches on values."""

    def __init__(self, surfaces: Sequence[Surface]) -> None:
        self._forms = {surface.side: normal_form(surface.expression) for surface in surfaces}
        self._known: dict[Any, Any] = {}

    def rewrite(self, expression: Any) -> Any:
        return rebuilt(expression, self._change, self._known)

    def origin_of(self, before: Mapping[Any, Any]) -> dict[Any, Any]:
        """From parts of what was rewritten to what `before` has for them."""
        return {self._known.get(part, part): written for part, written in before.items()}

    def _change(self, _: Any, now: Any) -> Any:
        if isinstance(now, Select):
            condition, a, b = now.args
            return Select(condition, self._within(a, guards_of(condition, True)), self._within(b, guards_of(condition, False)))
        return self._power(now.base, now.exp) if is_root(now) else now

    def _within(self, branch: Any, guards: Guards) -> Any:
        """What is taken where these conditions hold, or do not, with powers of what is positive there continued past the edge."""
        edges = [condition if taken else -condition for condition, taken in guards if self._is_side(condition)]
        if not edges or not any(is_root(part) for part in parts(branch)):
            return branch
        return rebuilt(branch, lambda _, now: self._continued(now, edges) if is_root(now) else now)

    def _continued(self, power: Any, edges: Sequence[Any]) -> Any:
        factors = sympy.Mul.make_args(power.base)
        for place, factor in enumerate(factors):
            rest = sympy.Mul(*factors[:place], *factors[place + 1 :])
            for edge in edges:
                if (sign := self._sign_past(factor, edge)) != 0:
                    return (sign * rest) ** power.exp * sympy.Abs(factor) ** power.exp
        return power

    def _is_side(self, condition: Any) -> bool:
        return condition in self._forms or -condition in self._forms

    def _power(self, base: Any, exponent: Any) -> Any:
        factors = sympy.Mul.make_args(base)
        for place, factor in enumerate(factors):
            rest = sympy.Mul(*factors[:place], *factors[place + 1 :])
            if isinstance(factor, sympy.Min) and any(is_number(argument, 0) for argument in factor.args):
                turned = sympy.Max(*(-argument for argument in factor.args), evaluate=False)
                return self._power(-rest * turned, exponent)
            if isinstance(factor, sympy.Max) and any(is_number(argument, 0) for argument in factor.args):
                others = [argument for argument in factor.args if not is_number(argument, 0)]
                larger = others[0] if len(others) == 1 else sympy.Max(*others, evaluate=False)
                return Select(larger, self._power(rest, exponent) * self._power(larger, exponent), 0)
            if isinstance(factor, Select) and any(is_number(branch, 0) for branch in factor.args[1:]):
                condition, a, b = factor.args
                value, edge = (a, condition) if is_number(b, 0) else (b, -condition)
                if (outer := self._sign_past(value, edge)) != 0:
                    past = self._power(outer * rest, exponent) * sympy.Abs(value) ** exponent
                else:
                    past = self._power(rest * value, exponent)
                return Select(condition, *((past, 0) if is_number(b, 0) else (0, past)))
            if isinstance(factor, sympy.Max | sympy.Min) and any(map(_may_be_zero, factor.args)):
                first, *others = factor.args
                other = factor.func(*others, evaluate=False) if len(others) > 1 else others[0]
                larger = first - other if isinstance(factor, sympy.Max) else other - first
                return Select(larger, self._power(rest * first, exponent), self._power(rest * other, exponent))
            if isinstance(factor, Select) and _may_be_zero(factor):
                condition, *branches = factor.args
                return Select(condition, *(self._power(rest * branch, exponent) for branch in branches))
            if self._is_positive_past(rest, factor):  # side * x is |x|
                return sympy.Abs(rest) ** exponent
        return base**exponent

    def _sign_past(self, value: Any, edge: Any) -> int:
        """1 or -1 where the value is zero on the surface of a side and has that sign where the side is one; else 0."""
        return next((sign for sign in (1, -1) if self._is_positive_past(sign * value, edge)), 0)

    def _is_positive_past(self, value: Any, edge: Any) -> bool:
        """Whether the value is zero on the surface of a side, or of what is minus one, and positive where that is."""
        sign = -1 if edge.could_extract_minus_sign() else 1
        if sign * edge not in self._forms:
            return False
        form, orientation = self._forms[sign * edge]
        return normal_form(value) == (form, sign * orientation)


def _may_be_zero(value: Any) -> bool:
    """Whether a factor is zero on a whole branch."""
    for factor in sympy.Mul.make_args(value):
        if isinstance(factor, Select) and any(part == 0 or _may_be_zero(part) for part in factor.args[1:]):
            return True
        if isinstance(factor, sympy.Max | sympy.Min) and any(part == 0 or _may_be_zero(part) for part in factor.args):
            return True
    return False
