"""The tables of a file by the schema that checks them: which keys they have, and where a key belongs that is in another one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, get_args, get_origin, get_type_hints

from pydantic import BaseModel

from .toml_messages import unknown_key

Place = tuple[str, ...]

ENTRY = "<name>"
"""Stands in a place for whatever name an entry has, of a table that is keyed by names."""

MOST_PLACES = 2
"""Tables that are named for a key; one that more have belongs nowhere in particular."""


def misplaced_key(schema: type[BaseModel], place: Place) -> str:
    """A message about a key that its table does not have: the table where it belongs, or else the keys of its own."""
    *table, name = place
    here = _table_at(schema, tuple(table))
    found = [at for at, kind in _tables(schema) if name in kind.model_fields and kind is not here and ENTRY not in at]
    belongs = ""
    if () in found:
        belongs = f"{name} is a table of its own, [{name}]"
    elif 0 < len(found) <= MOST_PLACES:
        tables = [f"[{'.'.join(at)}]" for at in found]
        belongs = f"{name} belongs to the table {' or '.join(tables)}"
    return unknown_key(".".join(table), name, here.model_fields, belongs)


def _table_at(schema: type[BaseModel], place: Place) -> type[BaseModel]:
    """The table at a place; the file itself where there is none."""
    alike = (
        kind for at, kind in _tables(schema) if len(at) == len(place) and all(_is(*pair) for pair in zip(at, place, strict=True))
    )
    return next(alike, schema)


def _is(part: str, given: str) -> bool:
    return part in (ENTRY, given)


def _tables(schema: type[BaseModel], place: Place = ()) -> Iterator[tuple[Place, type[BaseModel]]]:
    """All tables, with their places."""
    yield place, schema
    inside: list[tuple[Any, Place]] = [(of.annotation, (*place, name)) for name, of in schema.model_fields.items()]
    if schema.model_config.get("extra") == "allow":
        hints: dict[str, Any] = get_type_hints(schema)
        inside.append((hints["__pydantic_extra__"], place))
    for annotation, below in inside:
        for kind, further in _inside(annotation):
            yield from _tables(kind, (*below, *further))


def _inside(annotation: Any) -> Iterator[tuple[type[BaseModel], Place]]:
    """The tables that a value of this type may be, or have as entries."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation, ()
    elif get_origin(annotation) is dict:
        yield from ((kind, (ENTRY, *further)) for kind, further in _inside(get_args(annotation)[1]))
    else:
        for part in get_args(annotation):
            yield from _inside(part)
