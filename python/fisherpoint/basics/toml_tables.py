"""What the tables of TOML files have in common: numbers, constants, and checks of names and units."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Protocol, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from .quantity import Quantity
from .toml_messages import ConfigError, KeysOf, describe, fail, toml, unknown_key

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


class HasUnit(Protocol):
    @property
    def unit(self) -> str | None: ...


def validated(kind: type[Validated], data: dict[str, Any], path: str | Path, keys_of: KeysOf) -> Validated:
    """The table that the data of a file are, or a `ConfigError` that says what they lack."""
    try:
        return kind.model_validate(data)
    except ValidationError as error:
        raise ConfigError(f"{path}: {describe(error, keys_of)}") from None


def check_names(table: str, given: Iterable[str], expected: Iterable[str]) -> None:
    expected = list(expected)
    for name in given:
        if name not in expected:
            fail(unknown_key(table, name, expected))


def check_table(
    table: str,
    given: Mapping[str, HasUnit],
    quantities: Iterable[Quantity],
    missing: str = "",
    also: tuple[str, ...] = (),
) -> None:
    """Check names, units and, where `missing` says what is expected, completeness of a table keyed by quantity."""
    units = {quantity.name: quantity.unit for quantity in quantities}
    check_names(table, given, [*units, *also])
    for name, unit in units.items():
        entry = given.get(name)
        if entry is None:
            if missing:
                fail(f"{table}.{name}: missing; expected {missing}" + (f" in {unit}" if unit != "1" else ""))
        elif entry.unit is not None and entry.unit != unit:
            fail(f"{table}.{name}.unit: expected {toml(unit)}, given {toml(entry.unit)}")
