"""Options as fields of frozen classes that an argument of a function takes together, as `goal: str | Goal`.

A field states its default, its words in reports and its keys in the TOML file: reports, the tables of the file and its reference
are made from the fields, so that an option stands in one place. A keyword that belongs to such a class and is given to the function
itself is an error that names its place.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, fields
from functools import wraps
from inspect import Parameter, signature
from typing import Any, ParamSpec, TypeVar, get_args, get_type_hints

P = ParamSpec("P")
R = TypeVar("R")


class Options:
    """Base of classes of options."""


@dataclass(frozen=True)
class Key:
    """What the key of an option in the TOML file may be.

    Attributes
    ----------
    kind : type
        Of the value, such as ``int`` or ``str | list[str]``.
    meaning : str
        One or two sentences of the reference.
    choices : tuple of str
        The only texts; none where any will do.
    least, most, above, below : float or None
        Limits of a number, or of the numbers of a mapping; the last two are excluded.
    default : str
        What the reference says of a key that is left out, where that is not the default of the option.
    """

    kind: Any
    meaning: str
    choices: tuple[str, ...] = ()
    least: float | None = None
    most: float | None = None
    above: float | None = None
    below: float | None = None
    default: str = ""


@dataclass(frozen=True)
class Option:
    """A field of options.

    Attributes
    ----------
    name : str
    default : object
    words : str
        Its name in reports; empty where they do not list it.
    always : bool
        Whether reports list it with its default too.
    shown : callable or None
        A value as reports show it; None where that follows from its type.
    keys : mapping of name to Key
        Its keys in the TOML file; none where it has none.
    """

    name: str
    default: Any
    words: str
    always: bool
    shown: Callable[[Any], str] | None
    keys: dict[str, Key]


def option(
    default: Any,
    words: str,
    key: Key | None = None,
    *,
    always: bool = False,
    shown: Callable[[Any], str] | None = None,
    **keys: Key,
) -> Any:
    """A field of options; `key` is that of its own name in the TOML file, and `keys` are others that belong to it."""
    return field(default=default, metadata={"words": words, "always": always, "shown": shown, "key": key, "keys": keys})


def options_of(kind: type) -> tuple[Option, ...]:
    """The options of a class, in their order."""
    found = []
    for one in (one for one in fields(kind) if one.metadata):
        given = one.metadata
        own = {} if given["key"] is None else {one.name: given["key"]}
        found.append(Option(one.name, one.default, given["words"], given["always"], given["shown"], own | given["keys"]))
    return tuple(found)


def keys_of(*kinds: type) -> dict[str, Key]:
    """All keys of the TOML file that classes of options have."""
    return {name: key for kind in kinds for one in options_of(kind) for name, key in one.keys.items()}


def with_options(function: Callable[P, R]) -> Callable[P, R]:
    """Have a function say of a keyword that it does not know to which of its arguments this belongs.

    Those are arguments with a class of options in their type, as `goal: str | Goal`.
    """
    parameters = signature(function).parameters
    known = {name for name, one in parameters.items() if one.kind is not Parameter.VAR_KEYWORD}
    further = [name for name in parameters if name not in known]  # at most one, whose type has the names

    @wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        if unknown := [name for name in kwargs if name not in known]:
            allowed = {name for one in further for name in get_args(get_type_hints(function)[one])[0].__annotations__}
            if misplaced := [name for name in unknown if name not in allowed]:
                refuse_misplaced(misplaced, function, f"fp.{function.__name__}")
                raise TypeError(f"{function.__name__}() got an unexpected keyword argument {misplaced[0]!r}")
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
        for one in fields(kind):  # type: ignore[arg-type]  # they are dataclasses
            if one.name == name:
                yield f"fp.{kind.__name__}({name}=...)"
            else:
                yield from (f"fp.{kind.__name__}({one.name}={inside})" for inside in _given(name, hints[one.name]))
