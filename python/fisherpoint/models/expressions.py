"""SymPy expressions as models have them: which parts may occur, with real symbols and numbers that a double can hold."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import sympy
from sympy.core.function import AppliedUndef
from sympy.core.relational import Equality, Relational, Unequality
from sympy.logic.boolalg import BooleanFalse, BooleanFunction, BooleanTrue

from ..basics.formulas import ARGUMENTS
from ..basics.messages import listed, shortened, shown
from .tape.defined import Defined
from .tape.delay import delay_in
from .tape.kinds import KINDS
from .tape.latch import Latch
from .tape.parts import cases, check_size, is_number, parts, rebuilt, symbols_of, with_exact_numbers

MAX_EXPONENT = 1000
"""The largest number as an exponent; sympy works powers of numbers out to the last digit."""

_ARITHMETIC = (sympy.Symbol, sympy.Number, sympy.Add, sympy.Mul, sympy.Pow)
_CALLS = (*KINDS, sympy.atan2)
_CASES = (sympy.Min, sympy.Max, sympy.Piecewise, sympy.functions.elementary.piecewise.ExprCondPair)
_LOGIC = (Relational, sympy.And, sympy.Or, sympy.Not, sympy.ITE, BooleanTrue, BooleanFalse)
_KNOWN = (*_ARITHMETIC, *_CALLS, *_CASES, *_LOGIC, Defined, Latch)


def symbol(name: str) -> sympy.Symbol:
    """The symbol of a quantity."""
    return sympy.Symbol(name, real=True)


def checked(
    expression: Any, symbols: Mapping[str, sympy.Symbol], place: str, hidden: Mapping[str, sympy.Symbol] | None = None
) -> Any:
    """Return an equation in our symbols, found by name, and with numbers that a double holds.

    Messages do not list the names that are `hidden`.

    Raises
    ------
    ValueError
        For an unknown name, a function that is not in the list, or a number that is none; the message names the place.
    """
    given = expression
    try:
        expression = sympy.sympify(given, strict=True)
    except Exception:  # of SymPy, or of the value's own code
        raise ValueError(f"{place}: expected an expression, given {shown(given)}") from None
    if not isinstance(expression, sympy.Expr):
        raise ValueError(f"{place}: expected an expression, given {shown(given)}")
    check_size(expression, place)
    for part in parts(expression):
        if isinstance(part, Equality | Unequality) or not isinstance(part, (*_KNOWN, sympy.NumberSymbol, AppliedUndef)):
            what = str(part) if isinstance(part, Relational) else part.func.__name__
            if isinstance(part, BooleanFunction):
                raise ValueError(f"{place}: expected conditions that are joined by &, | and ~, given {shortened(part)}")
            if part not in (sympy.I, sympy.nan, sympy.zoo, sympy.oo, -sympy.oo):
                raise ValueError(f"{place}: expected the functions {', '.join(ARGUMENTS)}; given {shortened(what)}")

    known = {**(hidden or {}), **symbols}

    def ours(part: Any, now: Any) -> Any:
        if isinstance(part, AppliedUndef):  # x(t), as sympy.physics.mechanics has it
            return _known(part.func.__name__, symbols, place)
        if isinstance(part, sympy.Heaviside):
            return _step(*now.args)
        if isinstance(now, sympy.ITE):  # what SymPy makes of a comparison of its own Piecewise
            condition, yes, no = now.args
            return sympy.Or(
                sympy.And(condition, yes, evaluate=False), sympy.And(sympy.Not(condition), no, evaluate=False), evaluate=False
            )
        return known.get(part.name, part) if part.is_Symbol else now

    expression = rebuilt(expression, ours)
    for unknown in sorted(symbols_of(expression) - set(known.values()), key=str):
        if delay_in(unknown) is not None:  # whose names the model checks
            continue
        _known(unknown.name, symbols, place)
    return Doubles()(expression, place)


class Doubles:
    """Expressions with numbers that doubles hold, for several that share their parts."""

    def __init__(self) -> None:
        self._valued: dict[Any, Any] = {}
        self._exact: dict[Any, Any] = {}
        self._checked: dict[Any, None] = {}

    def __call__(self, expression: Any, place: str) -> Any:
        """Return an expression with its numbers rounded.

        Raises
        ------
        ValueError
            For a number that is none, an exponent that is too large, or cases that are not all.
        """
        valued = rebuilt(expression, lambda part, now: _number(part, place) if _is_number(part) else now, self._valued)
        rounded = rebuilt(valued, lambda _, now: with_exact_numbers(now), self._exact)
        for part in parts(rounded, known=self._checked):
            if part.is_Number:
                _number(part, place)
            if part.is_Pow and part.exp.is_Number and abs(part.exp) > MAX_EXPONENT:
                raise ValueError(f"{place}: expected exponents of at most {MAX_EXPONENT}, given {float(part.exp):g}")
            if isinstance(part, sympy.Piecewise) and part.args[-1][1] != sympy.true:
                raise ValueError(f"{place}: expected a Piecewise whose last condition is True, given {shortened(part)}")
            self._checked[part] = None
        return rounded


def _step(of: Any, at_zero: Any) -> Any:
    """0 below zero, 1 above, and what SymPy has at zero, half if nothing else is said."""
    if is_number(at_zero, 0):
        return sympy.Heaviside(of, 0)
    if is_number(at_zero, 0.5):
        return (1 + sympy.sign(of)) / 2
    at_least = sympy.GreaterThan(of, 0)
    if is_number(at_zero, 1):
        return cases(sympy.S.One, at_least, sympy.S.Zero)
    return cases(sympy.S.One, sympy.StrictGreaterThan(of, 0), cases(at_zero, at_least, sympy.S.Zero))


def _is_number(part: Any) -> bool:
    return bool(part.is_number and isinstance(part, sympy.Expr) and not isinstance(part, sympy.Integer | sympy.Rational))


def _known(name: str, symbols: Mapping[str, sympy.Symbol], place: str) -> sympy.Symbol:
    if name not in symbols:
        raise ValueError(f"{place}: expected the names {listed(symbols)}; given unknown {shown(name)}")
    return symbols[name]


def _number(part: Any, place: str) -> Any:
    """A number whose value a double holds; what is exact stays exact where it is short."""
    try:
        value = float(part)
    except (TypeError, OverflowError):
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"{place}: expected finite real numbers, given {_shortened(part)}")
    if (part.is_Rational and max(abs(part.p), part.q) < 2**53) or (part.is_Float and part._prec == 53):
        return part
    return sympy.Float(value)


def _shortened(part: Any) -> str:
    if part == sympy.zoo or part == sympy.nan:
        return "a division by zero"
    return "a number of more than 308 digits" if part.is_Rational else f"{part!s:.60}"
