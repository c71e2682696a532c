"""Mistakes in a TOML file in one line each: the key, what was expected there, what was given; and where a key belongs."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from difflib import get_close_matches
from itertools import islice
from typing import Any, NoReturn, get_args, get_origin, get_type_hints

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails, PydanticCustomError

from .messages import LISTED, SHOWN, listed, printable, shortened
from .quantity import LONGEST_NAME

OfKey = Callable[[tuple[str, ...]], str]
"""From the place of a key that its table does not have to a message."""


MOST_LINES = 50
"""Maximum number of reported mistakes in a file; a file with more is of another kind."""

DEEPEST = 4
"""Tables and lists inside each other that are shown of a value."""

Place = tuple[str, ...]

ENTRY = "<name>"
"""Stands in a place for whatever name an entry has, of a table that is keyed by names."""

MOST_PLACES = 2
"""Tables that are named for a key; one that more have belongs nowhere in particular."""


class ConfigError(ValueError):
    """A configuration file that cannot be used; the message has one line for each mistake, which names the file and the key.

    Parameters
    ----------
    *lines : str
    """

    def __init__(self, *lines: str) -> None:
        self.lines = tuple(map(printable, lines))
        super().__init__("\n".join(self.lines))


# What a pydantic error type says in the words of a TOML file.
_EXPECTED = {
    "float_type": "a number",
    "int_type": "a whole number",
    "string_type": "text in quotes",
    "bool_type": "true or false",
    "list_type": "a list",
    "dict_type": "a table",
    "model_type": "a table",
    "finite_number": "a finite number",
    "greater_than": "a number > {gt:g}",
    "less_than": "a number < {lt:g}",
    "greater_than_equal": "a number >= {ge:g}",
    "less_than_equal": "a number <= {le:.10g}",
    "literal_error": "{expected}",
    "too_short": "at least {min_length} entries",
    "expected": "{message}",
}

_BARE = re.compile(r"[\w-]+")

_MISSING = {
    "model": 'a table with the name and the equations of a model, or with name = "hydraulic_cylinder"',
    "model.name": 'a name for a model with equations, or "hydraulic_cylinder"',
    "prior": "a table with an entry for each parameter",
}

_QUANTITIES = ("model.states", "model.inputs", "model.parameters", "model.outputs")


def describe(error: ValidationError, of_key: OfKey) -> list[str]:
    """The problems of `error`, one line for each."""
    lines: list[str] = []
    problems = error.errors(include_url=False)[: 2 * MOST_LINES]
    problems = [problem for problem in problems if not _is_misspelt(problem, problems)]
    places = [_place(problem) for problem in problems]
    for k, (place, problem) in enumerate(zip(places, problems, strict=True)):
        if problem["type"] == "keys":
            lines += problem["ctx"]["texts"][:MOST_LINES]
        # A union reports one problem per member, at its own key or below it: the first, or what is below, suffices.
        elif problem["type"] == "key" or not (
            place in places[:k] or any(place == below[: len(place)] for below in places if below > place)
        ):
            lines.append(" ".join(_describe(problem, of_key).split()))
    return lines


def _is_misspelt(problem: ErrorDetails, problems: list[ErrorDetails]) -> bool:
    """Whether a missing key stands there under another name, which is reported instead."""
    if problem["type"] != "missing":
        return False
    *table, name = problem["loc"]
    beside = [one for one in problems if list(one["loc"][:-1]) == table]
    extra = [str(one["loc"][-1]) for one in beside if one["type"] == "extra_forbidden"]
    missing = [one for one in beside if one["type"] == "missing"]
    alone = len(extra) == len(missing) == 1
    return bool(extra) and (alone or bool(get_close_matches(str(name), extra, n=1)))


def _describe(problem: ErrorDetails, of_key: OfKey) -> str:
    kind, place = problem["type"], _place(problem)
    key = shortened(".".join(part if _BARE.fullmatch(part) else f'"{part}"' for part in place), 2 * SHOWN)
    if kind == "key":
        return str(problem["ctx"]["text"])
    if kind == "keys":
        return str(problem["ctx"]["texts"][0])
    if kind == "missing":
        return f"{key}: missing; expected {_MISSING.get(key, 'a value')}"
    if kind == "extra_forbidden":
        return of_key(place)
    expected = expected_by(kind, problem)
    if key in _QUANTITIES and kind == "dict_type":
        expected = 'a table with a name and its unit for each, such as {q = "m"}'
    if key.startswith("rule.levels") and kind in ("int_type", "dict_type"):
        expected = "a whole number, or one for each parameter by name"
    if key.startswith("rule.edges") and kind in ("list_type", "dict_type"):
        expected = "a list of ascending numbers, or one for each parameter by name"
    if key.startswith("campaign.targets") and kind in ("float_type", "dict_type"):
        expected = "a number > 0, or one for each parameter by name"
    return f"{key}: expected {expected}, given {toml(problem['input'])}"


def expected_by(kind: str, problem: ErrorDetails) -> str:
    """What is expected where pydantic has found a problem of this kind."""
    context = problem.get("ctx", {})
    return _EXPECTED.get(kind, "{message}").format(message=problem["msg"], **context).replace("'", '"')


_MEMBERS = ("dict[", "list[", "constrained-", "function-")


def _place(problem: ErrorDetails) -> tuple[str, ...]:
    """Place of a problem, without the names that pydantic adds for the members of a union, and that of all entries, ""."""
    parts = [part for part in problem["loc"] if isinstance(part, str) and part]
    return tuple(part for part in parts if part != "int" and not part.startswith(_MEMBERS))


def fail_of(texts: Iterable[str]) -> None:
    """Report all of these, if there are any, as `fail` does one; of very many the first."""
    if texts := list(islice(texts, MOST_LINES + 1)):
        raise PydanticCustomError("keys", "{texts}", {"texts": texts})


def fail(text: str) -> NoReturn:
    """Report `text`, which names its key, from inside a pydantic validator."""
    raise PydanticCustomError("key", "{text}", {"text": text})


def unknown_key(table: str, name: str, expected: Iterable[str], belongs: str = "") -> str:
    """A key that its table does not have, and where it belongs, or the keys that the table has, and the closest of them."""
    what = belongs or f"expected one of {choices(expected, name)}"
    return f"unknown key {shortened(f'{table}.{name}' if table else name)}; {what}"


def choices(expected: Iterable[str], given: str) -> str:
    """The expected names, and the closest to the given one."""
    expected = list(expected)
    close = get_close_matches(given[:LONGEST_NAME], expected, n=1)
    return listed(expected) + (f' (did you mean "{shortened(close[0])}"?)' if close else "")


def toml(value: object, deep: int = 0) -> str:
    """A value as it would stand in a TOML file, cut to a readable length."""
    if isinstance(value, Mapping | list | tuple) and deep == DEEPEST:
        text = "..."
    elif isinstance(value, Mapping):
        text = "{" + ", ".join(f"{key} = {toml(entry, deep + 1)}" for key, entry in islice(value.items(), LISTED)) + "}"
    elif isinstance(value, list | tuple):
        text = "[" + ", ".join(toml(entry, deep + 1) for entry in value[:LISTED]) + "]"
    elif isinstance(value, str):
        text = json.dumps(value[:SHOWN], ensure_ascii=False)
    else:
        text = json.dumps(value) if isinstance(value, bool) else str(value)
    return shortened(text)


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
