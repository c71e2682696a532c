"""Where expressions are zero: when two of them are zero together."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
import sympy

from ..tape.parts import exact, is_number, parts, replaced, symbols_of
from ..tape.signs import is_positive
from .evaluate import evaluate


def normal_form(expression: Any) -> tuple[Any, int]:
    """Return what is the same for all non-zero multiples of an expression, and the sign of the multiple, 1 or -1.

    Factors that are positive whatever their symbols are do not count.
    """
    factors = [factor for factor in sympy.Mul.make_args(expression) if factor.is_Number or not is_positive(factor)]
    coefficient, rest = sympy.Mul(*factors).as_coeff_Mul()
    terms = rest.as_coefficients_dict()
    first = min(terms, key=sympy.default_sort_key)
    scale = float(terms[first])
    form = frozenset((term, float(f"{float(factor) / scale:.12e}")) for term, factor in terms.items())
    return form, 1 if float(coefficient) * scale > 0 else -1


def reduced(expression: Any) -> tuple[Any, int]:
    """Return the expression without numerical factor and without positive factors, and the sign that was taken out."""
    factors = [factor for factor in sympy.Mul.make_args(expression) if not is_positive(factor)]
    coefficient, rest = sympy.Mul(*factors).as_coeff_Mul()
    if is_number(rest, 1):
        return expression, 1
    sign = -1 if coefficient < 0 else 1
    rest = rest.primitive()[1]
    if rest.is_Add and sum(bool(term.could_extract_minus_sign()) for term in rest.args) == len(rest.args):
        rest, sign = -rest, -sign
    return rest, sign


_POINTS, _DIFFERENT = 4, 1e-6
_MULTIPLIED = 200
"""The most parts of an expression that is multiplied out."""


class Multiples:
    """Finds expressions that are multiples of one another by what does not move: c/c_m - 1 is c - c_m times 1/c_m.

    Wherever both have a value they are zero together, and the factor's sign leads from the sign of one to that of the other. A
    factor that may be zero does not count, as k in k*c - k*c_m.

    Parameters
    ----------
    moving : collection of symbols
        What moves or may be zero, states and inputs. Factors hold neither those nor sides.
    constants : mapping of symbol to number
    """

    def __init__(self, moving: Collection[Any], constants: Mapping[Any, float]) -> None:
        self._moving = frozenset(moving)
        self._numbers = {symbol: exact(value) for symbol, value in constants.items()}
        self._known: dict[Any, dict[Any, Any]] = {}
        self._rng = np.random.default_rng(0)
        self._points: dict[Any, Any] = {}
        self._values: dict[Any, Any] = {}

    def sign(self, expression: Any, other: Any) -> Any:
        """The sign of expression / other, where that is such a factor: 1, -1 or an expression; None where it is not."""
        if not self._may_be_multiple(expression, other):
            return None
        a, b = self._coefficients(expression), self._coefficients(other)
        if not a or a.keys() != b.keys():
            return None
        leading = min(a, key=sympy.default_sort_key)
        if any(sympy.expand(a[term] * b[leading] - b[term] * a[leading]) != 0 for term in a):
            return None
        factor = a[leading] / b[leading]
        known = replaced(factor, self._numbers)
        if known.is_positive or known.is_negative:
            return sympy.S.One if known.is_positive else sympy.S.NegativeOne
        above, below = sympy.fraction(factor)
        return sympy.sign(factor) if self._divided_by(b, above) and self._divided_by(a, below) else None

    def _may_be_multiple(self, expression: Any, other: Any) -> bool:
        """Whether the quotient is the same at random points between which nothing but what moves changes."""
        with np.errstate(all="ignore"):
            quotient = self._at_points(expression) / self._at_points(other)
            return (
                bool(np.abs(quotient[1:] - quotient[0]).max() <= _DIFFERENT * np.abs(quotient[0]))
                or not np.isfinite(quotient).all()
            )

    def _at_points(self, expression: Any) -> Any:
        if expression not in self._values:
            for symbol in sorted(symbols_of(expression) - self._points.keys(), key=str):
                moves = self._moves(symbol)
                drawn = self._rng.uniform(0.5, 2, (2, _POINTS if moves else 1)) * self._rng.choice(
                    [-1, 1], (2, _POINTS if moves else 1)
                )
                self._points[symbol] = np.broadcast_to(
                    drawn[0] + (0 if isinstance(symbol, sympy.Dummy) else 1j * drawn[1]), _POINTS
                )
            self._values[expression] = np.broadcast_to(evaluate([expression], self._points)[0], _POINTS)
        return self._values[expression]

    def _divided_by(self, coefficients: Mapping[Any, Any], factors: Any) -> bool:
        """Whether no factor can be zero, as one of the coefficients has it as a divisor."""
        divisors = {one for of in coefficients.values() for one in sympy.Mul.make_args(sympy.fraction(of)[1])}
        return all(replaced(one, self._numbers).is_nonzero or one in divisors for one in sympy.Mul.make_args(factors))

    def _coefficients(self, expression: Any) -> dict[Any, Any]:
        """The factors that do not move, of the terms' parts that do; nothing of what is too long to be multiplied out."""
        if expression not in self._known:
            found: dict[Any, Any] = {}
            if sum(1 for _ in parts(expression)) <= _MULTIPLIED:
                for term in sympy.Add.make_args(sympy.expand_mul(expression)):
                    moves = [factor for factor in sympy.Mul.make_args(term) if self._moves(factor)]
                    part = sympy.Mul(*moves)
                    found[part] = found.get(part, sympy.S.Zero) + term / part
            self._known[expression] = found
        return self._known[expression]

    def _moves(self, factor: Any) -> bool:
        return any(part in self._moving or isinstance(part, sympy.Dummy) for part in parts(factor))
