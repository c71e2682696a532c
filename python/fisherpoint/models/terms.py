"""Terms of equations as they are written: SymPy's expressions, which keep where the user's own have a value."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any, NoReturn

import numpy as np
import sympy
from sympy.logic.boolalg import Boolean, BooleanAtom

from ..basics.formulas import REPEATED
from ..basics.messages import shortened, shown
from .surfaces.limits import left_out
from .surfaces.printing import to_text
from .tape.defined import Defined, defined
from .tape.latch import as_condition
from .tape.parts import cases, compared, exact, exact_exponent

OF_CONDITIONS = (
    "expected conditions, with brackets around each comparison: (a > 0) & (b > 0), (a > 0) | (b > 0), ~(a > 0); "
    "where(condition, a, b) instead of if; fp.math.max and fp.math.min instead of max and min"
)


class Unwritable(TypeError):
    """Error about code that cannot be written in equations."""


def _term(given: Any) -> Term:
    term = as_term(given)
    if term is None or not isinstance(term.expression, sympy.Expr):
        raise Unwritable(f"expected terms, given the condition {shown(given)}: write where(condition, 1, 0)")
    return term


def _condition(given: Any) -> Term:
    term = as_term(given)
    term = None if term is None else Term(as_condition(term.expression), term.lost)
    if term is None or not isinstance(term.expression, Boolean) or term.expression.is_Symbol:
        raise Unwritable(f"{OF_CONDITIONS}; given {shown(given)}")
    return term


def _power(base: Any, exponent: Any) -> Any:
    return base ** (exact_exponent(exponent) if exponent.is_Float else exponent)


def applied(function: Callable[..., Any], *terms: Term) -> Term:
    """The term that a function of SymPy makes of others."""
    expressions = [term.expression for term in terms]
    return _made(function(*expressions), expressions, terms)


def divided(function: Callable[[Any, Any], Any], a: Term, b: Term) -> Term:
    """The quotient of two terms, which has a value where the divisor is other than zero."""
    return _made(function(a.expression, b.expression), [a.expression, b.expression, 1 / b.expression], (a, b))


def _made(value: Any, operands: Sequence[Any], terms: Iterable[Term]) -> Term:
    lost = [part for term in terms for part in term.lost]
    return Term(value, tuple(dict.fromkeys([*lost, *left_out(value, operands)])))


def _operators(function: Callable[..., Any], of: Callable[[Any], Term], apply: Callable[..., Term] = applied) -> tuple[Any, Any]:
    """The methods of an operator, for a term on its left and on its right."""

    def method(turned: bool, self: Term, other: Any) -> Any:
        if as_term(other) is None:  # an array does it for each of its own
            return NotImplemented
        terms = of(self), of(other)
        return apply(function, *(terms[::-1] if turned else terms))

    return lambda self, other: method(False, self, other), lambda self, other: method(True, self, other)


class Term:
    """An expression of SymPy, or a condition, with the operators of equations.

    Attributes
    ----------
    expression : sympy.Expr or Boolean
    lost : tuple of sympy.Expr
        Parts of the written term that SymPy has removed: the term has a value only where these have one.
    """

    __slots__ = ("expression", "lost")
    _op_priority = 1e3  # so that SymPy's expressions leave their operators to terms

    def __init__(self, expression: Any, lost: tuple[Any, ...] = ()) -> None:
        self.expression, self.lost = expression, lost

    def _sympy_(self) -> Any:
        return defined(self.expression, self.lost)

    def __repr__(self) -> str:
        return to_text(self._sympy_())

    def __neg__(self) -> Term:
        return applied(operator.neg, _term(self))

    def __pos__(self) -> Term:
        return _term(self)

    def __abs__(self) -> Term:
        return applied(sympy.Abs, _term(self))

    def __invert__(self) -> Term:
        return applied(sympy.Not, _condition(self))

    def __bool__(self) -> bool:
        raise Unwritable(f"{OF_CONDITIONS}; given {self._shown()}, which holds or not only along a trajectory")

    def __float__(self) -> float:
        raise Unwritable(
            f"expected a function of fisherpoint.math, as fp.math.sqrt, given one of numbers alone for {self._shown()}"
        )

    __int__ = __index__ = __complex__ = __float__

    def _equal(self, other: object) -> Any:
        if isinstance(other, bool):  # as SymPy looks whether a condition is True
            return NotImplemented
        raise Unwritable(f"expected <, <=, > or >=, given == or != for {self._shown()}: write abs(a - b) < width")

    __eq__ = __ne__ = _equal
    __hash__ = None  # type: ignore[assignment]  # SymPy keeps what it made of what can be compared

    def _repeated(self, *_: Any) -> NoReturn:
        raise Unwritable(f"{REPEATED}; given it for {self._shown()}")

    __mod__ = __rmod__ = __floordiv__ = __rfloordiv__ = __divmod__ = __rdivmod__ = _repeated
    __floor__ = __ceil__ = __trunc__ = __round__ = _repeated

    def _shown(self) -> str:
        return shortened(str(self), 60)

    __add__, __radd__ = _operators(operator.add, _term)
    __sub__, __rsub__ = _operators(operator.sub, _term)
    __mul__, __rmul__ = _operators(operator.mul, _term)
    __truediv__, __rtruediv__ = _operators(operator.truediv, _term, divided)
    __pow__, __rpow__ = _operators(_power, _term)
    __lt__ = _operators(partial(compared, sympy.StrictLessThan), _term)[0]
    __le__ = _operators(partial(compared, sympy.LessThan), _term)[0]
    __gt__ = _operators(partial(compared, sympy.StrictGreaterThan), _term)[0]
    __ge__ = _operators(partial(compared, sympy.GreaterThan), _term)[0]
    __and__, __rand__ = _operators(partial(sympy.And, evaluate=False), _condition)
    __or__, __ror__ = _operators(partial(sympy.Or, evaluate=False), _condition)


def chosen(condition: Term, a: Term, b: Term) -> Term:
    """One of two terms, by a condition: what they are written of counts where they are taken."""
    if isinstance(condition.expression, BooleanAtom):
        taken = a if condition.expression == sympy.true else b
        return Term(taken.expression, (*condition.lost, *taken.lost))
    return Term(cases(a._sympy_(), condition.expression, b._sympy_()), condition.lost)


def as_term(given: Any) -> Term | None:
    """A term, an expression of SymPy, a number or a bool as a term; None for anything else."""
    if isinstance(given, Term):
        return given
    if isinstance(given, Defined):
        return Term(given.args[0], given.args[1:])
    if isinstance(given, sympy.Basic):
        return Term(given)
    if isinstance(given, np.generic):
        given = given.item()
    if isinstance(given, bool):
        return Term(sympy.true if given else sympy.false)
    if isinstance(given, float) and np.isfinite(given):
        return Term(exact(given))
    if isinstance(given, str | list | tuple | np.ndarray):
        return None
    try:
        return Term(sympy.sympify(given, strict=True))
    except Exception:  # of SymPy, or of the value's own code
        return None
