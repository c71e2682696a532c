"""Values of expressions at complex points in many digits: whether something is zero is seen there, however large its terms are."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from operator import add, mul
from typing import Any

import mpmath
import sympy

from ...basics.function_table import Function
from ..tape.branch import Select
from ..tape.kinds import KINDS
from ..tape.parts import parts

DIGITS = 60
_LARGE = 1e6
"""Past it exp and the like are not evaluated: they take long, and digits are lost."""

digits = mpmath.mp.clone()
digits.dps = DIGITS

Value = Any
"""A complex number in many digits, or None where there is none."""


class Work:
    """A number of operations that may be done."""

    def __init__(self, most: int) -> None:
        self.left = most

    def take(self, operations: int) -> None:
        self.left -= operations
        if self.left < 0:
            raise TooMuchWork


class TooMuchWork(Exception):
    """More operations than may be done."""


class Calculation:
    """Expressions as a list of operations.

    A `Select` goes by its condition c, which is 1 or -1, and in between is (1 + c)/2 of the one branch and (1 - c)/2 of the other.

    Attributes
    ----------
    floats : list of int
        Places of numbers that are doubles, and so rounded.
    """

    def __init__(self, expressions: Sequence[Any], work: Work) -> None:
        self._work = work
        self._places: dict[Any, int] = {}
        self._steps: list[tuple[Callable[..., Value], tuple[int, ...]]] = []
        self._numbers: dict[int, Value] = {}
        self._symbols: dict[int, Any] = {}
        self.floats: list[int] = []
        for part in parts(*expressions):
            self._add(part)
        self._results = [self._places[expression] for expression in expressions]

    def _add(self, part: Any) -> None:
        place = self._places[part] = len(self._steps)
        self._steps.append((_OPERATIONS.get(part.func, _nothing), tuple(self._places[argument] for argument in part.args)))
        if part.is_Symbol:
            self._symbols[place] = part
        elif not part.args:
            self._numbers[place] = _number(part)
            if part.is_Float:
                self.floats.append(place)

    def __call__(
        self, values: Mapping[Any, Value], changes: Mapping[int, float] | None = None, count: int | None = None
    ) -> tuple[list[Value], bool]:
        """The values of the first `count` expressions, and whether all roots and logarithms on the way are proper.

        They are where what they are taken of has a positive real part.

        Parameters
        ----------
        values : mapping of symbols to numbers
        changes : mapping of places to numbers, optional
            By how much of itself the number at a place is changed.
        count : int, optional
            Default: all.
        """
        results = self._results[:count]
        steps = self._steps[: max(results) + 1]
        self._work.take(len(steps))
        found: list[Value] = []
        proper: list[bool] = []
        for place, (operation, places) in enumerate(steps):
            if not places:
                value = values[self._symbols[place]] if place in self._symbols else self._numbers[place]
                found.append(value * (1 + changes[place]) if changes and place in changes else value)
                proper.append(True)
                continue
            if operation is _select and found[places[0]] in (1, -1):  # nothing of the branch that is not taken counts
                taken = places[1] if found[places[0]] == 1 else places[2]
                found.append(found[taken])
                proper.append(proper[taken])
                continue
            arguments = [found[argument] for argument in places]
            known = all(argument is not None for argument in arguments)
            found.append(_computed(operation, arguments) if known else None)
            proper.append(known and all(proper[argument] for argument in places) and not _is_improper(operation, arguments))
        return [found[place] for place in results], all(proper[place] for place in results)


def _computed(operation: Callable[..., Value], arguments: list[Value]) -> Value:
    try:
        value = operation(*arguments)
    except (ValueError, ArithmeticError):
        return None
    return value if value is None or digits.isfinite(value) else None


def _number(part: Any) -> Value:
    if part.is_Rational:
        return digits.mpc(part.p) / part.q
    if part.is_Float:
        return digits.mpc(float(part))
    if part.is_NumberSymbol:
        return digits.mpc(digits.mpf(str(part.evalf(DIGITS + 10))))
    return None


def _is_integer(value: Value) -> bool:
    return bool(value.imag == 0 and digits.isint(value.real))


def _is_improper(operation: Callable[..., Value], arguments: list[Value]) -> bool:
    rooted = operation is _log or (operation is _power and not _is_integer(arguments[1]))
    return bool(rooted and arguments[0].real < 0)


def _power(base: Value, exponent: Value) -> Value:
    if _is_integer(exponent):
        return base ** int(exponent.real) if abs(exponent) <= _LARGE else None
    if base == 0:
        return base if exponent.real > 0 else None
    if exponent == 0.5:
        return digits.sqrt(base)
    return _bounded(digits.exp)(exponent * digits.log(base))


def _bounded(function: Callable[[Value], Value]) -> Callable[[Value], Value]:
    return lambda value: function(value) if abs(value) < _LARGE else None


def _digits_of(function: Function) -> Callable[[Value], Value]:
    value: Callable[[Value], Value] = getattr(digits, function.name)
    return _bounded(value) if function.slow_far_out else value


def _log(value: Value) -> Value:
    return None if value == 0 else digits.log(value)


def _atan2(y: Value, x: Value) -> Value:
    return 2 * digits.atan(y / (x + digits.sqrt(x * x + y * y)))


def _select(condition: Value, a: Value, b: Value) -> Value:
    return ((1 + condition) * a + (1 - condition) * b) / 2


def _nothing(*_: Value) -> Value:
    return None


_OPERATIONS: dict[Any, Callable[..., Value]] = {
    sympy.Add: lambda *terms: reduce(add, terms),
    sympy.Mul: lambda *factors: reduce(mul, factors),
    sympy.Pow: _power,
    **{kind: _digits_of(function) for kind, function in KINDS.items() if not function.at_zero},
    sympy.log: _log,
    sympy.atan2: _atan2,
    Select: _select,
}
