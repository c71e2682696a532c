"""Where f and g have a value: what must stay positive, and divisors, which may have either sign but must not reach zero."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import sympy

from ..tape.branch import Guards, Select, guards_of
from ..tape.defined import value_of
from ..tape.parts import exact, is_number, parts, reads, replaced
from ..tape.signs import is_nonzero, is_positive
from .branches import Surface
from .limits import is_root, limits_of
from .printing import in_words, to_text
from .zeros import normal_form, reduced


@dataclass(frozen=True)
class Limit:
    """What must stay positive, or other than zero for a pole. In a branch that is not taken its expression is 1.

    One that g alone reads is `measured`: it is to hold where g is, and not on the way there. A `closed` one is of powers that have
    a value at zero: trajectories may start there. What it is as it is written is an expression, or a text.
    """

    written: Any
    expression: Any
    pole: bool
    measured: bool = False
    closed: bool = False

    @property
    def name(self) -> str:
        return self.written if isinstance(self.written, str) else to_text(self.written)


MOST = 256
"""The most limits that are looked at; fewer are left, as some keep others."""

_Key = tuple[Any, int | None, Guards]


class Domain:
    """Collects the limits of expressions without nested branches on anything but `Select`.

    Parameters
    ----------
    constants : mapping of sympy.Symbol to float
        What helps to see that an expression is positive.
    surfaces : sequence of Surface
        The switching surfaces whose sides the expressions read. What vanishes on one of them and has a value only on one of its
        sides, as sqrt(x) where x > 0, has no derivative there: it becomes a pole, so that points may start on either side.
    """

    def __init__(self, constants: Mapping[Any, float], surfaces: Sequence[Surface]) -> None:
        self._switching = {normal_form(surface.expression)[0]: surface.side for surface in surfaces}
        self._written = {surface.side: surface.written for surface in surfaces}
        self._constants = {symbol: exact(value) for symbol, value in constants.items()}
        self._with_constants: dict[Any, Any] = {}
        self._limits: dict[_Key, Limit] = {}
        self._visited: set[Any] = set()
        self._measured = False
        self._limited: dict[Any, bool] = {}

    @property
    def limits(self) -> list[Limit]:
        """All limits, poles first, measured ones last; a divisor that a limit keeps from zero is none, nor one of g alone."""
        on_way = {key: limit for key, limit in self._limits.items() if not limit.measured}
        left = self._left(on_way, on_way)
        measured = {key: limit for key, limit in self._limits.items() if limit.measured and not limit.pole}
        return left + self._left(measured, self._limits)

    @staticmethod
    def _left(given: Mapping[_Key, Limit], known: Mapping[_Key, Limit]) -> list[Limit]:
        """Those of the given limits that do not follow from known ones."""
        kept = {(form, guards) for form, sign, guards in known if sign is not None}
        everywhere = {(form, sign) for form, sign, guards in known if not guards}
        positive = {
            limit.expression: sympy.Dummy(positive=True)
            for (_, sign, guards), limit in known.items()
            if sign == 1 and not guards and limit.expression.is_Symbol
        }
        poles, others = [], []
        for (form, sign, guards), limit in given.items():
            if guards and (form, sign) in everywhere:
                continue
            read = limit.expression not in positive and reads(limit.expression, positive)
            if read and replaced(limit.expression, positive).is_positive:
                continue
            if not limit.pole:
                others.append(limit)
            elif (form, guards) not in kept and (form, ()) not in kept:
                poles.append(limit)
        return poles + others

    def declare(self, expression: Any, written: Any, name: str | None = None) -> None:
        """Add a condition of the user's: the expression must stay positive; it may have a name of its own."""
        self._add(expression, written, (), pole=False, name=name)

    def read(self, expression: Any, origin: Mapping[Any, Any], measured: bool = False) -> None:
        """Add the limits of an expression; `origin` maps its parts to how they were written; `measured`: it is one of g."""
        if measured != self._measured:
            self._measured, self._visited = measured, set()
        for part in parts(expression, known=self._limited):
            self._limited[part] = bool(limits_of(part, {})) or any(self._limited[argument] for argument in part.args)
        stack: list[tuple[Any, Guards]] = [(expression, ())]
        while stack:
            part, guards = stack.pop()
            if not self._limited[part] or (part, guards) in self._visited:
                continue
            self._visited.add((part, guards))
            if isinstance(part, Select):
                condition, a, b = part.args
                branches = [(b, (*guards, *guards_of(condition, False))), (a, (*guards, *guards_of(condition, True)))]
                stack += [*branches, (condition, guards)]
                continue
            for argument, written, pole in limits_of(part, origin):
                self._add(argument, written, guards, pole, closed=is_root(part))
            stack += [(argument, guards) for argument in reversed(part.args)]

    def _add(
        self, expression: Any, written: Any, guards: Guards, pole: bool, name: str | None = None, closed: bool = False
    ) -> None:
        expression, guards = value_of(expression), tuple((value_of(condition), taken) for condition, taken in guards)
        for shown in (written, expression):
            known = replaced(shown, self._constants, self._with_constants)
            if is_positive(known) or (pole and is_nonzero(known)):
                return
        smooth = sympy.Mul(*(factor for factor in sympy.Mul.make_args(expression) if not isinstance(factor, sympy.Dummy)))
        if pole and is_number(smooth, 1):
            return
        if any(taken and condition == expression for condition, taken in guards):
            return  # the branch is taken where this is positive
        form, sign = normal_form(smooth)
        side = self._switching.get(form)
        if side is not None and (smooth != expression or any(condition == side for condition, _ in guards)):
            guards = tuple(guard for guard in guards if guard[0] != side)
            expression, written, pole = smooth, written if smooth == expression else smooth, True
        else:
            form, sign = normal_form(expression)
        written = in_words(value_of(written), self._written)
        shown, turned = reduced(written) if not expression.is_number else (written, 1)
        if turned < 0 and not pole:
            shown = -shown
        for condition, taken in reversed(guards):
            expression = self._where(condition, taken, expression)
        if len(self._limits) == MOST:
            raise ValueError(f"f: expected at most {MOST} roots, logarithms, divisors and conditions of the domain, given more")
        key = form, None if pole else sign, guards
        limit = self._limits.setdefault(key, Limit(name or shown, expression, pole, self._measured, closed and not pole))
        if not closed and limit.closed and not self._measured:
            self._limits[key] = replace(limit, closed=False)

    def _where(self, condition: Any, taken: bool, expression: Any) -> Any:
        """The expression where the condition holds, or does not, and 1 elsewhere; on a slide both branches count."""
        side = condition if condition in self._written else -condition
        if side in self._written:
            return Select((condition if taken else -condition) + sympy.Rational(1, 2), expression, sympy.S.One)
        return Select(condition, *((expression, sympy.S.One) if taken else (sympy.S.One, expression)))
