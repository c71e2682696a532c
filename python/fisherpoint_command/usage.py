"""Mistakes on the command line itself, in the words of all other messages."""

from __future__ import annotations

import re
from collections.abc import Sequence
from difflib import get_close_matches
from typing import Any

from typer import TyperException


def usage_error(error: TyperException) -> str:
    """What is wrong with the options or arguments, in one line, and where help is."""
    context = getattr(error, "ctx", None)
    command = str(getattr(context, "command_path", None) or "fisherpoint")
    return f"{_mistake(error, context, command)}; try {command} --help"


def empty_value(arguments: Sequence[str]) -> str | None:
    """What is wrong where a value is empty, as of a shell variable that is not set: as a path it is the current directory."""
    for before, given in zip(["", *arguments], arguments, strict=False):
        name, equals, value = given.partition("=") if given.startswith("--") else ("", "=", given)
        if equals and not value:
            named = name or (before if before.startswith("-") else "arguments")
            return f"{named}: expected a value, given an empty one"
    return None


def _mistake(error: TyperException, context: Any, command: str) -> str:
    from pydantic import ValidationError

    kind, parameter = type(error).__name__, getattr(error, "param", None)
    if kind == "MissingParameter" and parameter is not None:
        return f"{_name(parameter)}: missing; expected {_help(parameter)}"
    if isinstance(error.__cause__, ValidationError) and parameter is not None:
        return _wrong_value(error.__cause__, parameter)
    if kind == "NoSuchOption":
        given = str(getattr(error, "option_name", ""))
        options = [name for one in context.command.params for name in one.opts if name.startswith("--")] if context else []
        return f"{command.rpartition(' ')[2]}: expected one of its options, given {given}{_meant(given, options)}"
    message = error.format_message().rstrip(".")
    if found := re.match(r"No such command '(.*?)'", message):
        names = list(context.command.commands) if context else []
        return f"expected a command among {', '.join(names)}; given {found[1]}{_meant(found[1], names)}"
    if found := re.match(r"Got unexpected extra argument\S* \((.*)\)", message):
        wanted = " ".join(_name(one) for one in context.command.params if one.param_type_name == "argument") if context else ""
        return f"{command.rpartition(' ')[2]}: expected {wanted or 'no arguments'}, given {found[1]} besides"
    if found := re.match(r"Option '(.*?)' requires", message):
        return f"{found[1]}: expected a value, given none"
    return message


def _wrong_value(error: Any, parameter: Any) -> str:
    from fisherpoint.basics.messages import shown
    from fisherpoint.basics.toml_mistakes import expected_by

    problem = error.errors(include_url=False)[0]
    choices = getattr(getattr(parameter, "type_descriptor", None), "choices", None)
    if found := re.search(r"is not one of (.*)", problem["msg"]):
        expected = found[1].rstrip(".").replace("'", "").replace(", ", " or ")
    elif choices:
        expected = " or ".join(str(getattr(one, "value", one)) for one in choices)
    else:
        expected = expected_by(problem["type"].replace("_parsing", "_type"), problem)
    return f"{_name(parameter)}: expected {expected}, given {str(shown(str(problem['input'])))[1:-1]}"


def _name(parameter: Any) -> str:
    if parameter.param_type_name == "argument":
        return str(parameter.metavar or parameter.name)
    return str(max(parameter.opts, key=len))


def _help(parameter: Any) -> str:
    if parameter.param_type_name == "option":
        return f"{parameter.metavar or 'a value'}: {str(parameter.help or '').split(';')[0].rstrip('.')}"
    return f"a file or directory: {str(parameter.help or '').split(';')[0].rstrip('.')}"


def _meant(given: str, names: list[str]) -> str:
    close = get_close_matches(given, names, n=1)
    return f" (did you mean {close[0]}?)" if close else ""
