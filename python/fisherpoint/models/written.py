"""The equations of a model as they are written: with their definitions, as expressions and as text."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from .expression_list import ExpressionList
from .given_equations import Written
from .model_to_toml import Texts
from .set_anew import Given
from .surfaces.printing import to_text
from .tape.definition import Definition
from .tape.latch import condition_of
from .tape.parts import replaced


@dataclass(frozen=True)
class WrittenEquations:
    """Definitions by name, rates, outputs, conditions of the domain, and where states are set anew."""

    definitions: Mapping[str, Written]
    rates: tuple[Written, ...]
    output: tuple[Written, ...]
    domain: tuple[Written, ...]
    resets: Given

    def all(self) -> Iterator[Written]:
        """All of them, definitions first."""
        yield from (*self.definitions.values(), *self.rates, *self.output, *self.domain)
        for when, values in self.resets:
            yield from ([when] if isinstance(when, Written) else [])
            yield from values.values()

    def changed(self, change: Callable[[Written], Any]) -> WrittenEquations:
        """What `change` makes of each, in the same order."""
        definitions = {name: change(one) for name, one in self.definitions.items()}
        rates, output, domain = (tuple(map(change, of)) for of in (self.rates, self.output, self.domain))
        resets = tuple(
            (change(when) if isinstance(when, Written) else when, {x: change(value) for x, value in values.items()})
            for when, values in self.resets
        )
        return WrittenEquations(definitions, rates, output, domain, resets)

    def replaced(self, new: Mapping[Any, Any]) -> WrittenEquations:
        """The equations with symbols replaced by expressions, in definitions too; a text that no longer holds is left out."""
        by, made = dict(new), dict[Any, Any]()

        def change(one: Written) -> Written:
            expression = replaced(one.expression, by, made)
            return one if expression == one.expression else Written(expression)

        definitions = {}
        for name, one in self.definitions.items():
            definitions[name] = change(one)
            by[Definition(name, one.expression)] = Definition(name, definitions[name].expression)
        rest = WrittenEquations({}, self.rates, self.output, self.domain, self.resets).changed(change)
        return WrittenEquations(definitions, rest.rates, rest.output, rest.domain, rest.resets)

    def texts(self) -> Texts:
        """All of them as text; those that were given as text as they were given."""
        found = {name: _text(one) for name, one in self.definitions.items()}
        rates, output, domain = (tuple(map(_text, of)) for of in (self.rates, self.output, self.domain))
        resets = tuple(
            (condition_text(when) if isinstance(when, Written) else when, {x: _text(value) for x, value in values.items()})
            for when, values in self.resets
        )
        return Texts(rates, output, domain, resets, found)

    def __reduce__(self) -> tuple[Any, ...]:
        packed = ExpressionList()
        places = self.changed(lambda one: Written(packed.place_of(one.expression), one.given))
        return _unpacked, (packed, *(getattr(places, name) for name in self.__dataclass_fields__))


def _unpacked(packed: ExpressionList, *fields: Any) -> WrittenEquations:
    expressions = packed.expressions()
    return WrittenEquations(*fields).changed(lambda one: Written(expressions[one.expression], one.given))


def condition_text(condition: Written) -> str:
    """The condition of a reset as text."""
    return condition.given if condition.given is not None else to_text(condition_of(condition.expression))


def _text(one: Written) -> str:
    return one.given if one.given is not None else to_text(one.expression)
