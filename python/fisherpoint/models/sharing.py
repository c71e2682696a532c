"""Definitions that a model makes where formulas would be long without them: names of parts that occur more than once."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterator
from itertools import count
from typing import Any, NamedTuple

import sympy
from sympy.functions.elementary.piecewise import ExprCondPair
from sympy.logic.boolalg import Boolean

from .given_equations import Written
from .tape.definition import Definition
from .tape.latch import Latch
from .tape.parts import parts, remade
from .written import WrittenEquations

LONG = 2000
"""Number of characters of a formula from which on parts get names, and the most that formulas have with them."""
LINE = 150
"""Number of characters of a condition up to which it is shown without names that the model has made."""
SHORT = 8
"""Number of characters of a part that is too short for a name."""
NESTED = 25
"""How deep a formula that is printed is nested at most."""


class Shared(NamedTuple):
    """Equations with definitions of their own, and these by the parts for which they stand."""

    written: WrittenEquations
    named: dict[Any, Definition]


def with_shared_parts(written: WrittenEquations, taken: Collection[str]) -> Shared:
    """The equations themselves where all their formulas are short; `taken` are names in use."""
    roots = [one.expression for one in written.all() if one.given is None]
    lengths = dict[Any, int]()
    if all(_length(root, lengths) <= LONG for root in roots):
        return Shared(written, {})
    naming = _Naming(roots, {*taken, *written.definitions})
    return Shared(_with_names(written, naming), naming.named)


def _with_names(written: WrittenEquations, naming: _Naming) -> WrittenEquations:
    def change(one: Written) -> Written:
        return one if one.given is not None else Written(naming(one.expression))

    found: dict[str, Written] = {}
    for name, one in written.definitions.items():
        value = change(one)
        found |= naming.new_ones()
        found[name] = value
        naming.take(Definition(name, one.expression), Definition(name, value.expression))
    rest = WrittenEquations({}, written.rates, written.output, written.domain, written.resets).changed(change)
    found |= naming.new_ones()
    return WrittenEquations(found, rest.rates, rest.output, rest.domain, rest.resets)


class _Naming:
    """Puts symbols in place of parts that occur more than once, are too long, or are nested too deep."""

    def __init__(self, roots: list[Any], taken: set[str]) -> None:
        self.made: dict[Any, Any] = {}
        self.named: dict[Any, Definition] = {}
        self._before: dict[Any, Any] = {}
        self._length: dict[Any, int] = {}
        self._depth: dict[Any, int] = {}
        self._names = _names_beside(taken)
        self._new: dict[str, Written] = {}
        everything = list(parts(*roots))
        self._uses = Counter(roots)
        self._uses.update(argument for part in everything for argument in part.args)
        # The conditions of a latch, and what is 1 where a condition holds, are printed as conditions.
        self._unnamed = {argument for part in everything if isinstance(part, Latch) for argument in part.args}

    def __call__(self, expression: Any) -> Any:
        for part in parts(expression, known=self.made):
            self._add(part)
        return self.made[expression]

    def new_ones(self) -> dict[str, Written]:
        """Definitions since the last time."""
        found, self._new = self._new, {}
        return found

    def take(self, symbol: Any, now: Any) -> None:
        """Put a symbol in place of another one."""
        self.made[symbol], self._before[now], self._depth[symbol] = now, symbol, 1
        self._length[symbol] = _own_length(symbol)

    def _add(self, part: Any) -> None:
        while part.args and (heavy := self._heaviest(part)) is not None:
            self._name(heavy)
        args = [self.made[argument] for argument in part.args]
        now = part if all(a is b for a, b in zip(args, part.args, strict=True)) else remade(part, args)
        # SymPy may make something else of symbols than of what they stand for.
        back = Counter(self._before.get(argument, argument) for argument in now.args)
        if now.func is not part.func or back != Counter(part.args):
            now = part
        self.made[part], self._before[now] = now, part
        self._length[part] = _own_length(part) + sum(self._length_of(argument) for argument in part.args)
        self._depth[part] = 1 + max((self._depth_of(argument) for argument in part.args), default=0)
        if self._uses[part] > 1 and self._length[part] > SHORT:
            self._name(part)

    def _heaviest(self, part: Any) -> Any:
        """An argument that is to have a name, as the part would be too long or too deep with it."""
        arguments = [one for one in part.args if one not in self.named and self._may_be_named(one)]
        deep = [one for one in arguments if self._depth[one] >= NESTED]
        if sum(self._length_of(one) for one in part.args) > LONG:
            deep += [one for one in arguments if self._length[one] > LONG / 10]
        return max(deep, key=lambda one: self._length[one], default=None)

    def _length_of(self, part: Any) -> int:
        return len(self.named[part].name) + 3 if part in self.named else self._length[part]

    def _depth_of(self, part: Any) -> int:
        return 1 if part in self.named else self._depth[part]

    def _may_be_named(self, part: Any) -> bool:
        plain = isinstance(part, sympy.Expr) and bool(part.args) and not isinstance(part, Boolean | ExprCondPair)
        return plain and not part.is_number and part not in self._unnamed

    def _name(self, part: Any) -> None:
        if self._may_be_named(part):
            value = self.made[part]
            symbol = Definition(next(self._names), value)
            self._new[symbol.name] = Written(value)
            self.made[part] = self.named[part] = symbol
            self._before[symbol] = part


def is_readable(expression: Any) -> bool:
    """Whether an expression as text fits about a line."""
    return _length(expression, {}) <= LINE


def _length(expression: Any, lengths: dict[Any, int]) -> int:
    """About how many characters an expression has as text; `lengths` has the parts of expressions before."""
    for part in parts(expression, known=lengths):
        lengths[part] = _own_length(part) + sum(lengths[argument] for argument in part.args)
    return lengths[expression]


def _own_length(part: Any) -> int:
    """About how many characters a part has beside its arguments."""
    return 3 if part.args else len(str(part)) + 3


def is_made_by_models(name: str) -> bool:
    """Whether a definition has a name as models make them; one that was written and read again has those as its own."""
    return re.fullmatch("d+[0-9]+", name) is not None


def _names_beside(taken: Collection[str]) -> Iterator[str]:
    """Names d1, d2 and so on, or longer ones where a name in use is like that."""
    letters = next("d" * n for n in count(1) if not any(re.fullmatch(f"{'d' * n}[0-9]+", name) for name in taken))
    return (f"{letters}{i}" for i in count(1))
