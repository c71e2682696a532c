"""Equations as text, read into SymPy."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import sympy
from sympy.core.relational import Relational

from ..basics.formulas import ARGUMENTS, Formula, Reader
from .expressions import MAX_EXPONENT, checked
from .functions import FUNCTIONS, delay, latch
from .tape.latch import as_condition, holds
from .tape.parts import compared, exact, exact_exponent, is_number
from .terms import Term, applied, as_term, divided


def parse_equation(
    text: object, symbols: Mapping[str, sympy.Symbol], place: str, hidden: Mapping[str, sympy.Symbol] | None = None
) -> Any:
    """Turn a text such as ``"-k1*sqrt(h1) + k4*u"``, see `Formula`, into a SymPy expression.

    Parameters
    ----------
    text : str
    symbols : mapping of str to sympy.Symbol
        The names that may occur.
    place : str
        Of the equation, for messages.
    hidden : mapping of str to sympy.Symbol, optional
        Further names, which messages do not list.

    Raises
    ------
    ValueError
        For anything else: one line that names the place, and the column.
    """
    return checked(_read(Formula(text, place), symbols, hidden).term(), symbols, place, hidden)


def parse_condition(
    text: object, symbols: Mapping[str, sympy.Symbol], place: str, hidden: Mapping[str, sympy.Symbol] | None = None
) -> Any:
    """Turn a condition such as ``"x < 0 and v < 0"`` into an expression that is 1 where it holds, else 0."""
    return checked(holds(_read(Formula(text, place), symbols, hidden).condition().expression), symbols, place, hidden)


def parse_limit(text: object, symbols: Mapping[str, sympy.Symbol], place: str) -> tuple[Any, ...]:
    """Turn a comparison such as ``"abs(v) < 0.4"`` or ``"0.01 < q < 0.29"`` into expressions that must all stay positive.

    Where abs, min and max only say that several smooth things stay positive, these come one by one.
    """
    formula = Formula(text, place)
    found = _read(formula, symbols).comparison().expression
    comparisons = sorted(found.args, key=str) if isinstance(found, sympy.And) else [found]
    if not all(isinstance(one, Relational) for one in comparisons):
        formula.refuse("expected comparisons that may hold or not", formula.tree)
    return tuple(smooth for one in comparisons for smooth in _smooth(checked(one.gts - one.lts, symbols, place)))


def _smooth(positive: Any) -> list[Any]:
    """Expressions that are all positive exactly where the given one is: without abs and extremes that only add conditions."""
    for term in sympy.Add.make_args(positive):
        factor, rest = term.as_coeff_Mul()
        if isinstance(rest, sympy.Abs) and factor < 0:
            cases = [rest.args[0], -rest.args[0]]
        elif (isinstance(rest, sympy.Max) and factor < 0) or (isinstance(rest, sympy.Min) and factor > 0):
            cases = list(rest.args)
        else:
            continue
        return [one for case in cases for one in _smooth(positive - term + factor * case)]
    return [positive]


def _read(formula: Formula, symbols: Mapping[str, sympy.Symbol], hidden: Mapping[str, sympy.Symbol] | None = None) -> _Equation:
    names, others = ({name: as_term(one) for name, one in of.items()} for of in (symbols, hidden or {}))
    return _Equation(formula, names, others)


class _Equation(Reader):
    """Equations as terms, with their numbers taken as doubles: SymPy would work them out to the last digit."""

    remembers = True

    def number(self, node: ast.expr, value: Any) -> Any:
        return Term(self._number(node, value))

    def combined(self, node: ast.expr, how: str, *values: Any) -> Any:
        if how == "where":
            return FUNCTIONS["where"](*values)
        if how == "set":
            return Term(as_condition(values[0].expression), values[0].lost)
        if how == "latch":
            try:
                return latch(*values)
            except ValueError as error:
                self.formula.refuse(str(error), node)
        if how == "delay":
            return delay(*values)
        make = divided if how == "/" else applied
        return make(partial(self._combined, node, how), *values)

    def _number(self, node: ast.expr, value: Any) -> Any:
        self.check_finite(node, value)
        return exact(value)

    def _combined(self, node: ast.expr, how: str, *values: Any) -> Any:
        if how in _LOGIC:
            return _LOGIC[how](*values)
        if how == "**":
            return self._power(node, *values)
        if how in ARGUMENTS and all(value.is_Number for value in values):
            try:
                return self._number(node, _NUMERIC[how](*map(float, values)))
            except (ValueError, OverflowError):
                self.formula.refuse(f"expected {how}() of numbers for which it has a value", node)
        if how == "/" and values[1].is_zero and isinstance(node, ast.BinOp):
            self.formula.refuse("expected no division by zero", node.right)
        value = (_ARITHMETIC[how] if how in _ARITHMETIC else FUNCTIONS[how])(*values)
        return value if how == "negative" else self._folded(node, value)

    def _power(self, node: ast.expr, base: Any, exponent: Any) -> Any:
        if exponent.is_Number:
            if abs(exponent) > MAX_EXPONENT:
                self.formula.refuse(f"expected exponents of at most {MAX_EXPONENT}", node)
            exponent = exact_exponent(exponent)
            factor, rest = base.as_coeff_Mul()
            if rest != 1 and factor.is_negative and not exponent.is_Integer:
                factor, rest = -factor, -rest
            if is_number(factor, 0) and not exponent > 0:
                self.formula.refuse("expected no division by zero", node)
            try:
                if abs(exponent) > 8 or not (factor.is_Integer and exponent.is_Integer):
                    factor = factor if is_number(factor, 1) else self._number(node, math.pow(float(factor), float(exponent)))
                else:
                    factor = self._folded(node, factor**exponent)
            except (ValueError, OverflowError):
                self.formula.refuse("expected finite real numbers", node)
            return factor if rest == 1 else factor * rest**exponent
        if any(one.is_Number and not one > 0 for one in _branches(base)):
            self.formula.refuse("expected a positive number under an exponent that varies", node)
        return base**exponent

    def _folded(self, node: ast.expr, value: Any) -> Any:
        """A value whose number, if it is one, a double holds; sums and products of short numbers stay exact."""
        if value.is_Number and not (value.is_Rational and max(abs(value.p), value.q) < 2**53):
            return self._number(node, value)
        return value


def _branches(term: Any) -> Iterator[Any]:
    """A term, or what it is on each side of its conditions: its power is the powers of these."""
    if isinstance(term, sympy.Piecewise):
        for value, _ in term.args:
            yield from _branches(value)
    else:
        yield term


_ARITHMETIC: dict[str, Callable[..., Any]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "negative": operator.neg,
}
_LOGIC: dict[str, Callable[..., Any]] = {
    "<": partial(compared, sympy.StrictLessThan),
    "<=": partial(compared, sympy.LessThan),
    ">": partial(compared, sympy.StrictGreaterThan),
    ">=": partial(compared, sympy.GreaterThan),
    "and": partial(sympy.And, evaluate=False),
    "or": partial(sympy.Or, evaluate=False),
    "not": sympy.Not,
}
_NUMERIC: dict[str, Callable[..., float]] = {
    **{name: getattr(math, name) for name in ARGUMENTS if hasattr(math, name)},
    "abs": abs,
    "sign": lambda value: math.copysign(1.0, value) if value else 0.0,
    "heaviside": lambda value: float(value > 0),
    "min": min,
    "max": max,
}
