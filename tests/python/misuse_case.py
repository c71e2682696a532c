"""What each case of misuse is made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from misuse_examples import files
from misuse_values import INT, NONE, NUMBER

Argument = tuple[Any, ...]
"""A good value, and the kinds of clumsy ones that may be taken."""

SETTINGS: dict[str, Argument] = {"rtol": (1e-6, NUMBER), "threads": (1, INT, NONE), "kinks": ("cross",), "jumps": ("cross",)}


@dataclass(frozen=True)
class Case:
    """A public function with good arguments."""

    call: Callable[..., Any]
    arguments: dict[str, Argument]


def case(call: Callable[..., Any], **arguments: Argument) -> Case:
    return Case(call, arguments)


def within(path: Any) -> Any:
    """A path below that of the files, where it is a name: what is written there does not stay behind."""
    return files() / path if isinstance(path, str) and path.replace(".", "").isalnum() else path
