"""Walks through SymPy expressions that look at each part once: what stands in them, and the same with parts exchanged, made anew.

SymPy itself looks at a part as often as it occurs, and goes down by recursion. It takes 1.0 for another number than 1, so that
whole numbers are Integers here, however they were written.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Container, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from operator import is_
from typing import Any

import sympy
from sympy.core.relational import Relational
from sympy.functions.elementary.piecewise import ExprCondPair

from .signs import may_have_any_sign

MAX_OPERATIONS = 20_000
"""The most different operations, names and numbers of an expression: what occurs more than once is computed once."""
MAX_NESTED = 200
"""How deep the operations of an expression may be nested: SymPy goes down by recursion."""
_ODD = frozenset([sympy.asinh, sympy.atan, sympy.sinh, sympy.tanh])
_NOT_FINITE = frozenset([sympy.oo, -sympy.oo, sympy.zoo, sympy.nan])


def parts(*expressions: Any, known: Container[Any] = ()) -> Iterator[Any]:
    """Every part of expressions once, parts before what they are part of; depth does not matter.

    What is in `known` is left out, with its parts.
    """
    # What was looked at by its place in memory: equal parts mostly are the same, and hashes of floats are slow.
    places: dict[int, Any] = {}
    seen: set[Any] = set()
    stack = list(reversed(expressions))
    while stack:
        part = stack.pop()
        if part is None:  # what is below it is a part whose own parts are done
            yield stack.pop()
        elif id(part) not in places:
            places[id(part)] = part
            if part in seen or part in known:
                continue
            seen.add(part)
            if part.args:
                stack += (part, None, *part.args)
            else:
                yield part


def rebuilt(expression: Any, change: Callable[[Any, Any], Any], known: dict[Any, Any] | None = None) -> Any:
    """The expression with every part changed, inner ones first: `change` is given a part, and the part made of changed ones.

    Each part is made once however often it occurs. Comparisons, min, max, and, or stay as they are written: SymPy would try to
    decide them, at length. `known` keeps what was made, for further expressions and the same `change`.
    """
    made = {} if known is None else known
    for part in parts(expression, known=made):
        if part.args:
            args = [made[argument] for argument in part.args]
            same = all(map(is_, args, part.args))
            made[part] = change(part, part if same else remade(part, args))
        else:
            made[part] = change(part, part)
    return made[expression]


def replaced(expression: Any, new: Mapping[Any, Any], known: dict[Any, Any] | None = None) -> Any:
    """The expression with parts replaced by others, all at once."""
    return rebuilt(expression, lambda part, now: new.get(part, now), known)


def remade(part: Any, args: Sequence[Any]) -> Any:
    """A part with other arguments."""
    if isinstance(part, sympy.Mul) and sympy.S.Zero in args and not any(one in _NOT_FINITE for one in args):
        return sympy.S.Zero  # SymPy would ask of each factor whether it is finite, at length
    if isinstance(part, sympy.Max | sympy.Min) and not all(argument.is_number for argument in args):
        return part.func(*args, evaluate=False)
    if isinstance(part, sympy.And | sympy.Or) and not any(argument in (sympy.true, sympy.false) for argument in args):
        return part.func(*args, evaluate=False)
    if isinstance(part, Relational):
        return compared(part.func, *args)
    return _unchanged(part.func, *args) if isinstance(part, ExprCondPair | sympy.Piecewise) else evaluated(part.func, *args)


def evaluated(function: Callable[..., Any], *args: Any) -> Any:
    """The value of a function of SymPy; odd ones do not ask at length whether a sum or a product is zero everywhere."""
    if function is sympy.sign and args[0].is_Add and may_have_any_sign(args[0]):
        return function(*args, evaluate=False)
    if function in _ODD and isinstance(args[0], sympy.Add | sympy.Mul) and not args[0].is_number:
        return function(*args, evaluate=bool(args[0].could_extract_minus_sign()))
    return function(*args)


@lru_cache(maxsize=10_000)
def _unchanged(kind: Any, *args: Any) -> Any:
    """A part of arguments as they are; the same one for the same arguments, as deep parts are slow to compare."""
    return sympy.Basic.__new__(kind, *args)


def compared(kind: type[Relational], left: Any, right: Any) -> Any:
    """A comparison; where both sides are sums and products, SymPy does not check at length whether it always holds."""
    difference = left - right
    plain = (sympy.Symbol, sympy.Number, sympy.Add, sympy.Mul)
    if difference.is_number or not all(isinstance(part, plain) for part in parts(difference)):
        return kind(left, right)
    return kind(left, right, evaluate=False)


def cases(value: Any, condition: Any, otherwise: Any) -> sympy.Piecewise:
    """The value where the condition holds; SymPy's own way to make it multiplies out conditions that have cases in them."""
    pairs = ((value, condition), (otherwise, sympy.true))
    return _unchanged(sympy.Piecewise, *(_unchanged(ExprCondPair, *map(sympy.sympify, pair)) for pair in pairs))


def reads(expression: Any, symbols: Collection[Any]) -> bool:
    """Whether one of the symbols occurs in the expression."""
    return any(part in symbols for part in parts(expression))


def symbols_of(*expressions: Any) -> set[Any]:
    """All symbols of expressions; unlike `free_symbols` it looks at each part once."""
    return {part for part in parts(*expressions) if part.is_Symbol}


def contain(expressions: Iterable[Any], kind: type) -> bool:
    """Whether a part of one of the expressions is of a kind."""
    return any(isinstance(part, kind) for part in parts(*expressions))


def check_size(expression: Any, place: str, depths: dict[Any, int] | None = None) -> None:
    """Raise where SymPy, which goes down by recursion, would take too long; `depths` has the parts of expressions before."""
    known = {} if depths is None else depths
    for part in parts(expression, known=known):
        known[part] = 1 + max((known[argument] for argument in part.args), default=0)
    for what, given, most in (
        ("different operations", len(known), MAX_OPERATIONS),
        ("nested operations", known[expression], MAX_NESTED),
    ):
        if given > most:
            raise ValueError(f"{place}: expected at most {most} {what}, given {given}")


LARGEST = 2**53
"""Whole numbers below it are exact as doubles."""


def exact(value: float) -> Any:
    """The number of SymPy for a finite one of Python: an Integer where it is whole, so that 0.0 is 0 and x**2.0 is x**2."""
    whole = abs(value) < LARGEST and float(value).is_integer()
    return sympy.Integer(int(value)) if whole else sympy.Float(float(value))


def is_number(expression: Any, value: float) -> bool:
    """Whether an expression is this number, written in whichever way: `==` of SymPy is False for 0.0 and 0."""
    return bool(expression.is_Number and expression.is_comparable and float(expression) == value)


def with_exact_numbers(part: Any) -> Any:
    """A part of an expression with such numbers."""
    if part.is_Float:
        return exact(part)
    return part.base ** exact_exponent(part.exp) if part.is_Pow and part.exp.is_Float else part


def exact_exponent(exponent: Any) -> Any:
    """A number as an exponent, with halves as quotients: x**0.5 is a root, as sqrt(x) is."""
    if abs(exponent) < LARGEST and float(2 * exponent).is_integer():
        return sympy.Rational(int(2 * exponent), 2)
    return exponent
