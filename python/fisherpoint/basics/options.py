"""Classes of options, and keywords that are given to a function although they belong to one of these."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields
from functools import wraps
from inspect import signature
from typing import Any, ParamSpec, TypeVar, get_args, get_type_hints

P = ParamSpec("P")
R = TypeVar("R")


class Options:
    """Base of dataclasses whose fields are options that an argument of a function takes together."""


def with_options(function: Callable[P, R]) -> Callable[P, R]:
    """Have a function say of a keyword that it does not know to which of its arguments this belongs.

    Those are arguments with a class of options in their type, as `goal: str | Goal`.
    """
    known = set(signature(function).parameters)

    @wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        if not known.issuperset(kwargs):
            refuse_misplaced([name for name in kwargs if name not in known], function, f"fp.{function.__name__}")
        return function(*args, **kwargs)

    return checked


def refuse_misplaced(names: Iterable[str], of: Callable[..., Any], called: str) -> None:
    """Raise where a name belongs to what an argument of a function, or a field of a class, may be.

    Parameters
    ----------
    names : iterable of str
        Keywords that are not known.
    of : callable
    called : str
        What they were given to, for the message.
    """
    hints = {name: hint for name, hint in get_type_hints(of).items() if name != "return"}
    for name in names:
        for argument, hint in hints.items():
            if inside := next(_given(name, hint), None):
                raise TypeError(f"{name}: expected as {argument}={inside}, given to {called} itself")


def _given(name: str, hint: Any) -> Iterator[str]:
    """Code that gives an option to what may have this type."""
    for kind in (one for one in (hint, *get_args(hint)) if isinstance(one, type) and issubclass(one, Options)):
        hints = get_type_hints(kind)
        for field in fields(kind):  # type: ignore[arg-type]  # they are dataclasses
            if field.name == name:
                yield f"fp.{kind.__name__}({name}=...)"
            else:
                yield from (f"fp.{kind.__name__}({field.name}={inside})" for inside in _given(name, hints[field.name]))
