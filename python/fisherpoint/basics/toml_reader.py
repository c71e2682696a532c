"""A TOML file as plain data of bounded size, so that what follows may look at every entry."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from .files import read_bytes
from .messages import shortened
from .toml_mistakes import ConfigError

MOST_BYTES = 1_000_000
"""Maximum size of a configuration; a model with as many states, parameters and outputs as may be, and a page about each, has a
third of it."""

MOST_ENTRIES = 20_000
"""Keys and list entries."""

MOST_PARTS = 20
"""Maximum number of parts of a key with dots; the parser's time grows with its square."""

_PART = r"""(?:(?<![\w-])[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*"""
_DOTTED = re.compile(rf"(?:{_PART}\.[ \t]*){{{MOST_PARTS}}}")

_CLEARER = {
    "Cannot overwrite a value": "expected each key once, given one twice",
    "Invalid statement": "expected a key and its value, or a table in brackets, given something else",
    "Invalid value": "expected a number, a text in quotes, true, false, a list or a table, given something else",
}
"""Messages of the parser, and their meaning."""


def read_toml(path: Path) -> dict[str, Any]:
    """Content of a TOML file.

    Raises
    ------
    ConfigError
        Where it cannot be read, is no TOML, or is too large.
    """
    try:
        text = read_bytes(path, MOST_BYTES).decode("utf-8-sig")
    except FileNotFoundError:
        raise ConfigError(f"{path}: expected a TOML file, found no such file") from None
    except IsADirectoryError:
        raise ConfigError(f"{path}: expected a TOML file, given a directory") from None
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: expected a TOML file in UTF-8, given other bytes") from None
    except OSError as error:
        raise ConfigError(f"{path}: expected a readable TOML file, given: {error.strerror}") from error
    except ValueError as error:  # names the file
        raise ConfigError(str(error)) from None
    return parse_toml(text, path)


def parse_toml(text: str, source: str | Path) -> dict[str, Any]:
    """Content of a text in TOML; messages name `source`."""
    if len(text) > MOST_BYTES:
        raise ConfigError(f"{source}: expected at most {MOST_BYTES:,} characters, given {len(text):,}")
    if _DOTTED.search(text):
        raise ConfigError(f"{source}: expected keys of at most {MOST_PARTS} parts, given one of more")
    try:
        data = tomllib.loads(text)
    except RecursionError:
        raise ConfigError(f"{source}: not valid TOML: expected lists and tables inside each other, given them too deep") from None
    except ValueError as error:  # also a number of too many digits
        text = str(error)
        for said, clear in _CLEARER.items():
            text = text.replace(said, clear)
        raise ConfigError(f"{source}: not valid TOML: {shortened(text, 200)}") from None
    if (count := _entries(data)) > MOST_ENTRIES:
        raise ConfigError(f"{source}: expected at most {MOST_ENTRIES:,} keys and list entries, given {count:,}")
    return data


def _entries(data: dict[str, Any]) -> int:
    count = 0
    left: list[dict[str, Any] | list[Any]] = [data]
    while left:
        inside = left.pop()
        count += len(inside)
        values = inside.values() if isinstance(inside, dict) else inside
        left += [value for value in values if isinstance(value, dict | list)]
    return count
