"""What the tables of TOML files have in common: numbers, constants, and checks of names and units."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from .messages import listed
from .quantity import Quantity
from .toml_mistakes import MOST_LINES, ConfigError, describe, misplaced_key, unknown_key
from .units import unit_mistake

Validated = TypeVar("Validated", bound=BaseModel)

Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Count = Annotated[int, Field(ge=1)]


class Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Abbreviated(Table):
    """A table that may be given as a bare value of its first key."""

    bare: ClassVar[tuple[type, ...]]
    expected: ClassVar[str]

    @model_validator(mode="before")
    @classmethod
    def _from_bare(cls, given: Any) -> Any:
        if isinstance(given, cls.bare) and not isinstance(given, bool):
            return {next(iter(cls.model_fields)): given}
        if not isinstance(given, dict):
            raise PydanticCustomError("expected", cls.expected)
        return given


class Constant(Abbreviated):
    """A known number: a bare one or ``{value, unit}``."""

    bare, expected = (int, float), 'a number or {value = ..., unit = "..."}'

    value: Number
    unit: str | None = None


def validated(kind: type[Validated], data: dict[str, Any], path: str | Path) -> Validated:
    """The table that the data of a file are, or a `ConfigError` that says what they lack."""
    try:
        return kind.model_validate(data)
    except ValidationError as error:
        raise ConfigError(*(f"{path}: {line}" for line in describe(error, partial(misplaced_key, kind)))) from None


def wrong_names(table: str, given: Iterable[str], expected: Iterable[str]) -> Iterator[str]:
    """A line for each name that is not expected."""
    expected = list(expected)
    yield from (unknown_key(table, name, expected) for name in given if name not in expected)


def missing_names(given: Iterable[str], expected: Iterable[str]) -> list[str]:
    """The expected names that are not given, but for those that stand there misspelt: these are one mistake, not two."""
    given = list(given)
    unknown, missing = set(given).difference(expected), [name for name in expected if name not in given]
    if len(missing) == len(unknown) == 1:
        return []
    for name in sorted(unknown)[:MOST_LINES]:
        missing = [one for one in missing if one not in get_close_matches(name, missing, n=1)]
    return missing


def wrong_entries(
    table: str,
    given: Mapping[str, str | None],
    quantities: Iterable[Quantity],
    missing: str = "",
    also: tuple[str, ...] = (),
) -> Iterator[str]:
    """A line for each wrong name, unit and, where `missing` says what is expected, missing entry of a table keyed by quantity.

    Given are the units of its entries; None of one without, and of one that is wrong in itself, which is reported elsewhere.
    """
    units = {quantity.name: quantity.unit for quantity in quantities}
    yield from wrong_names(table, given, [*units, *also])
    if missing:
        lost = missing_names((name for name in given if name not in also), units)
        of = f" in {units[lost[0]]}" if len(lost) == 1 and units[lost[0]] != "1" else ""
        yield from missing_entries(table, lost, missing + of)
    for name, unit in units.items():
        if (mistake := unit_mistake(given.get(name), unit, f"{table}.{name}.unit")) is not None:
            yield mistake


def missing_entries(table: str, names: Sequence[str], expected: str) -> Iterator[str]:
    """One line for all entries that a table lacks."""
    if len(names) == 1:
        yield f"{table}.{names[0]}: missing; expected {expected}"
    elif names:
        yield f"{table}: missing {listed(names)}; expected of each {expected}"
