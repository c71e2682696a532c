"""Definitions: names for intermediate quantities of equations, as they are given, and equations with them written out."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

import sympy
from sympy.functions.elementary.piecewise import ExprCondPair

from ..basics.messages import shown
from .expressions import Doubles
from .given_equations import Written, equation_of
from .quantities import checked_quantity_name
from .surfaces.limits import has_limits
from .tape.defined import Defined, defined
from .tape.definition import Definition
from .tape.parts import check_size, parts, remade, symbols_of
from .terms import Term, Unwritable, applied, as_term

MOST = 2000
"""The most definitions of a model."""


def let(name: str, value: Any) -> Any:
    """An intermediate quantity of equations under a name: the model is written, printed and saved with it.

    It means what its value means, and is computed once. So is whatever else a function uses more than once: names are for readers.

    Parameters
    ----------
    name : str
        A name that no quantity of the model has.
    value : term
        Of states, inputs, parameters, known constants and the time; terms that have names themselves may stand in it.

    Returns
    -------
    term
        To be used in place of the value.

    Raises
    ------
    TypeError, ValueError
        For a name that cannot stand in equations, and for what is no term.

    Examples
    --------
    >>> @fp.model(states={"v": "m/s"}, inputs={"u": "N"}, parameters={"m": "kg", "c": "N s2/m2"})
    ... def car(x, u, p):
    ...     drag = fp.let("drag", p.c * x.v * abs(x.v))
    ...     return [(u.u - drag) / p.m], [x.v]
    """
    if not isinstance(name, str):
        raise TypeError(f"let: expected a name as text, given {shown(name)}")
    checked_quantity_name(name, "let")
    term = as_term(value)
    if term is None:
        raise TypeError(f"let: expected a term for {name}, given {shown(value)}")
    if not isinstance(term.expression, sympy.Expr):
        raise Unwritable(f"let: expected a term for {name}, given the condition {shown(value)}: write where(condition, 1, 0)")
    made = Definition(name, defined(term.expression, term.lost))
    return Term(made) if isinstance(value, Term) else made


def definitions_in(expressions: Iterable[Any], known: Iterable[Definition] = ()) -> list[Definition]:
    """Definitions that stand in expressions and in one another, but for known ones, those before others in which they stand."""
    found: dict[Definition, None] = dict.fromkeys(known)
    before = len(found)
    stack = [(expression, False) for expression in reversed(list(expressions))]
    while stack:
        one, entered = stack.pop()
        if entered:
            found[one] = None
        elif isinstance(one, Definition):
            if one not in found:
                stack += [(one, True), (one.value, False)]
        else:
            own = [part for part in parts(one) if isinstance(part, Definition) and part not in found]
            stack += [(part, False) for part in reversed(own)]
    return list(found)[before:]


def read_definitions(
    given: Mapping[str, Any] | None, expressions: Iterable[Any], symbols: dict[str, Any], clocks: dict[str, Any]
) -> dict[str, Written]:
    """All definitions of a model by name: those given, and those that `let` has put into expressions.

    Their symbols are added to `symbols`; names of the time that they have are taken from `clocks`.

    Raises
    ------
    ValueError
        For a name that is none, that something else has, or that is used before it is defined.
    """
    if given is not None and not isinstance(given, Mapping):
        raise TypeError(f"definitions: expected a mapping of names to terms, given {shown(given)}")
    quantities, found = set(symbols), dict[str, Written]()
    entries: list[tuple[Any, Any]] = []
    known = {Definition(name, value.expression): None for name, value in (given or {}).items() if isinstance(value, Written)}
    for name, value in (given or {}).items():
        own = definitions_in(_expressions([value]), known)
        known |= dict.fromkeys(own)
        entries += [*((one.name, one.value) for one in own), (name, value)]
    entries += [(one.name, one.value) for one in definitions_in(_expressions(expressions), known)]
    if len(entries) > MOST:
        raise ValueError(f"definitions: expected at most {MOST}, given {len(entries)}")
    waiting = [checked_quantity_name(name, "definitions") for name, _ in entries]
    for k, (name, (_, value)) in enumerate(zip(waiting, entries, strict=True)):
        place = f"definitions.{name}"
        if name in quantities:
            raise ValueError(f"{place}: expected a name of its own, given one that a quantity has too")
        if name not in found:
            later = sorted({*waiting[k:]} & _names_in(value) - found.keys())
            if later:
                what = "itself" if later[0] == name else f"{later[0]}, which is defined after it"
                raise ValueError(f"{place}: expected quantities, and definitions that come before it, given {what}")
        written = equation_of(value, symbols, place, clocks)
        made = Definition(name, written.expression)
        if symbols.setdefault(name, made) != made:
            raise ValueError(f"{place}: expected one value under a name, given two")
        found.setdefault(name, written)
        clocks.pop(name, None)
    return found


def _names_in(value: Any) -> set[str]:
    if isinstance(value, str):
        return set(re.findall(r"[^\W\d]\w*", value))
    return {one.name for one in symbols_of(*_expressions([value])) if not isinstance(one, Definition)}


def _expressions(given: Iterable[Any]) -> list[Any]:
    """What `let` may stand in, of terms and expressions."""
    found = []
    for one in given:
        expression = one.expression if isinstance(one, Written) else one
        term = None if isinstance(expression, str) else as_term(expression)
        found += [] if term is None else [term.expression, *term.lost]
    return found


class WrittenOut:
    """Expressions with the values of definitions in their place, as they would be if each were written out."""

    def __init__(self, definitions: Iterable[Definition]) -> None:
        self._terms: dict[Any, Term] = {}
        self._depths: dict[Any, int] = {}
        self._doubles = Doubles()
        self.named: dict[Any, Definition] = {}
        """Values, written out, of definitions; of those with the same value the first."""
        for one in definitions:
            value = self._made(one.value, f"definitions.{one.name}")
            self._terms[one] = Term(value.args[0], value.args[1:]) if isinstance(value, Defined) else Term(value)
            if value.args:
                self.named.setdefault(value, one)

    def __call__(self, expression: Any, place: str) -> Any:
        return self._made(expression, place) if self._terms else expression

    def _made(self, expression: Any, place: str) -> Any:
        for part in parts(expression, known=self._terms):
            self._terms[part] = self._term(part)
        made = self._terms[expression]._sympy_()
        check_size(made, place, self._depths)
        return self._doubles(made, place)

    def _term(self, part: Any) -> Term:
        terms = [self._terms[argument] for argument in part.args]
        if all(term.expression is argument and not term.lost for term, argument in zip(terms, part.args, strict=True)):
            return Term(part)
        if isinstance(part, Defined):
            value, *others = terms
            lost = (one for term in others for one in (term.expression, *term.lost) if has_limits(one))
            return Term(value.expression, (*value.lost, *lost))
        if isinstance(part, ExprCondPair):  # what a branch is written of counts where it is taken
            value, condition = terms
            return Term(remade(part, (value._sympy_(), condition.expression)), condition.lost)
        return applied(lambda *args: remade(part, args), *terms)
