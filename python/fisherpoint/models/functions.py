"""The functions that the equations of a model may use, on SymPy expressions.

`fisherpoint.math` offers them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial, reduce
from typing import Any

import numpy as np
import sympy
from sympy.core.function import AppliedUndef
from sympy.logic.boolalg import Boolean, BooleanAtom

from ..basics.checks import as_float
from ..basics.formulas import ARGUMENTS
from ..basics.function_table import FUNCTIONS as ONE_ARGUMENT
from ..basics.messages import shown
from .tape.delay import delayed
from .tape.latch import as_condition, latched
from .tape.parts import check_size, evaluated
from .terms import Term, applied, as_term, chosen


def where(condition: Any, a: Any, b: Any) -> Any:
    """a where the condition, a comparison or several joined by & and |, holds, else b."""
    one, other = _term(a, "where"), _term(b, "where")
    given = as_term(condition)
    given = None if given is None else Term(as_condition(given.expression), given.lost)
    if given is None or not isinstance(given.expression, Boolean) or given.expression.is_Symbol:
        raise TypeError(f"where: expected a condition such as x.h > 0, given {shown(condition)}")
    value = chosen(given, one, other)
    check_size(value.expression, "where")
    return _as_given(value, condition, a, b)


def latch(on: Any, off: Any, start: Any = 0) -> Any:
    """1 from when the condition `on` holds until `off` does, which wins where both hold; `start` where neither does at first."""
    conditions = [as_term(given) for given in (on, off)]
    for name, given, condition in zip(("on", "off"), (on, off), conditions, strict=True):
        if condition is None or not isinstance(condition.expression, Boolean) or condition.expression.is_Symbol:
            raise TypeError(f"latch: {name}: expected a condition of equations, such as x.T < 20, given {shown(given)}")
        if isinstance(condition.expression, BooleanAtom):
            raise ValueError(f"latch: {name}: expected a condition that may hold or not, given {shown(given)}")
    value = as_term(start)
    if value is None or value.expression not in (0, 1, sympy.S.false, sympy.S.true):
        raise ValueError(f"latch: start: expected 0 or 1, given {shown(start)}")
    lost = tuple(part for condition in conditions if condition is not None for part in condition.lost)
    both = [condition.expression for condition in conditions if condition is not None]
    return Term(latched(both[0], both[1], int(bool(value.expression))), lost)


def delay(u: Any, tau: Any) -> Any:
    """An input as it was `tau` before: tau is a parameter, a known constant, or a number of seconds."""
    terms = [as_term(given) for given in (u, tau)]
    parts: list[Any] = [None if term is None else term.expression for term in terms]
    parts = [sympy.Symbol(one.func.__name__) if isinstance(one, AppliedUndef) else one for one in parts]  # u(t), as SymPy has it
    if not isinstance(parts[0], sympy.Symbol):
        raise ValueError(f"delay: expected an input alone, as in delay(u, tau), given {shown(u)}")
    if not isinstance(parts[1], sympy.Symbol | sympy.Number):
        raise ValueError(f"delay: expected a parameter, a known constant or a number of seconds, given {shown(tau)}")
    time = parts[1].name if isinstance(parts[1], sympy.Symbol) else float(parts[1])
    return _as_given(Term(delayed(parts[0].name, time)), u, tau)


def _term(given: Any, name: str) -> Term:
    """An argument: a term of equations, or a number."""
    if not isinstance(given, Term | sympy.Basic):
        as_float(given, name)
        given = given.item() if isinstance(given, np.ndarray | np.generic) else given
    term = as_term(given)
    if term is None or not isinstance(term.expression, sympy.Expr):
        raise TypeError(f"{name}: expected a term, given {shown(given)}")
    return term


def _as_given(value: Term, *given: Any) -> Any:
    """A term where a term was given, else an expression of SymPy."""
    return value if any(isinstance(one, Term) for one in given) else value.expression


def _of_terms(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
    """A function of SymPy that takes nothing but terms, and as many as it should."""

    def of_terms(*arguments: Any) -> Any:
        least, most = ARGUMENTS[name]
        if not least <= len(arguments) <= most:
            expected = least if least == most else f"{least} to {most}"
            raise TypeError(f"{name}: expected {expected} arguments, given {len(arguments)}")
        return _as_given(applied(partial(evaluated, function), *(_term(argument, name) for argument in arguments)), *arguments)

    of_terms.__name__, of_terms.__doc__ = name, function.__doc__
    return of_terms


def _extreme(kind: Any, number: Callable[..., Any]) -> Callable[..., Any]:
    def extreme(*given: Any) -> Any:
        if all(argument.is_Number for argument in given):
            return number(given)
        distinct = list(dict.fromkeys(given))
        for argument in distinct:
            check_size(argument, kind.__name__.lower())
        # Unevaluated: SymPy would try at length to decide which is larger.
        return kind(*distinct, evaluate=False) if len(distinct) > 1 else distinct[0]

    extreme.__doc__ = f"The {'larger' if kind is sympy.Max else 'smaller'} of the arguments."
    return extreme


_OF_TERMS: dict[str, Callable[..., Any]] = {
    **{function.name: getattr(sympy, function.sympy) for function in ONE_ARGUMENT},
    "atan2": sympy.atan2,
    "heaviside": lambda x: sympy.Heaviside(x, 0),
    "min": _extreme(sympy.Min, lambda given: reduce(lambda a, b: a if a <= b else b, given)),
    "max": _extreme(sympy.Max, lambda given: reduce(lambda a, b: a if a >= b else b, given)),
}
FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{name: _of_terms(name, one) for name, one in _OF_TERMS.items()},
    "where": where,
    "latch": latch,
    "delay": delay,
}
"""Functions by the name that equations use."""
