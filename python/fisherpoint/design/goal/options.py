"""Options as fields of frozen classes: each says its default, its words in reports, and what its key in the TOML file may be.

Reports, the tables of the TOML file and its reference are made from these fields, so that an option stands in one place.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any


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
    keys : mapping of name to Key
        Its keys in the TOML file; none where it has none.
    """

    name: str
    default: Any
    words: str
    always: bool
    keys: dict[str, Key]


def option(default: Any, words: str, key: Key | None = None, *, always: bool = False, **keys: Key) -> Any:
    """A field of options; `key` is that of its own name in the TOML file, and `keys` are others that belong to it."""
    return field(default=default, metadata={"words": words, "always": always, "key": key, "keys": keys})


def options_of(kind: type) -> tuple[Option, ...]:
    """The options of a class, in their order."""
    found = []
    for one in (one for one in fields(kind) if one.metadata):
        given = one.metadata
        own = {} if given["key"] is None else {one.name: given["key"]}
        found.append(Option(one.name, one.default, given["words"], given["always"], own | given["keys"]))
    return tuple(found)


def keys_of(*kinds: type) -> dict[str, Key]:
    """All keys of the TOML file that classes of options have."""
    return {name: key for kind in kinds for one in options_of(kind) for name, key in one.keys.items()}
