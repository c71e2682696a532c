"""How a mistake in a configuration file is put into one line: the key, what was expected there, what was given."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from difflib import get_close_matches
from itertools import islice
from typing import NoReturn

from pydantic import ValidationError
from pydantic_core import ErrorDetails, PydanticCustomError

from .messages import LISTED, SHOWN, listed, printable, shortened
from .quantity import LONGEST_NAME

KeysOf = Callable[[tuple[str, ...]], Iterable[str]]
"""From the place of a table to the keys that it may have."""


DEEPEST = 4
"""Tables and lists inside each other that are shown of a value."""


class ConfigError(ValueError):
    """A configuration file that cannot be used; the message is one line that names the file and the key."""

    def __init__(self, message: str) -> None:
        super().__init__(printable(message))


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

_MISSING = {
    "model": 'a table with name = "hydraulic_cylinder"',
    "model.name": '"hydraulic_cylinder"',
    "prior": "a table with an entry for each parameter",
}


def describe(error: ValidationError, keys_of: KeysOf) -> str:
    """The first problem of `error` as one line, and how many more there are."""
    problems = error.errors(include_url=False)
    # A union reports one problem per member, at its own key or below it: these count once.
    places = {_place(problem) for problem in problems}
    more = len(places - {place[:-1] for place in places}) - 1
    line = " ".join(_describe(problems[0], keys_of).split())
    return line + (f" (and {more} more)" if more > 0 else "")


def _describe(problem: ErrorDetails, keys_of: KeysOf) -> str:
    kind, place, context = problem["type"], _place(problem), problem.get("ctx", {})
    key = shortened(".".join(place), 2 * SHOWN)
    if kind == "key":
        return str(context["text"])
    if kind == "missing":
        return f"{key}: missing; expected {_MISSING.get(key, 'a value')}"
    if kind == "extra_forbidden":
        return unknown_key(".".join(place[:-1]), place[-1], keys_of(place[:-1]))
    expected = _EXPECTED.get(kind, "{message}").format(message=problem["msg"], **context).replace("'", '"')
    if key.startswith("rule.levels") and kind in ("int_type", "dict_type"):
        expected = "a whole number, or one for each parameter by name"
    if key.startswith("rule.edges") and kind in ("list_type", "dict_type"):
        expected = "a list of ascending numbers, or one for each parameter by name"
    if key.startswith("campaign.targets") and kind in ("float_type", "dict_type"):
        expected = "a number > 0, or one for each parameter by name"
    return f"{key}: expected {expected}, given {toml(problem['input'])}"


def _place(problem: ErrorDetails) -> tuple[str, ...]:
    """Where a problem is, without the names that pydantic adds for the members of a union."""
    parts = [part for part in problem["loc"] if isinstance(part, str)]
    return tuple(part for part in parts if part != "int" and not part.startswith(("dict[", "list[", "constrained-")))


def fail(text: str) -> NoReturn:
    """Report `text`, which names its key, from inside a pydantic validator."""
    raise PydanticCustomError("key", "{text}", {"text": text})


def unknown_key(table: str, name: str, expected: Iterable[str]) -> str:
    """A key that its table does not have, the keys that it has, and the closest of them."""
    return f"unknown key {shortened(f'{table}.{name}' if table else name)}; expected one of {choices(expected, name)}"


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
