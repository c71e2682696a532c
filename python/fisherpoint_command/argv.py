"""The arguments that the program was given: whether it is to be quiet, and how a page says to repeat what it shows."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from contextvars import ContextVar
from pathlib import Path

from fisherpoint.basics.standard_input import STANDARD_INPUT

ARGUMENTS: ContextVar[Sequence[str]] = ContextVar("ARGUMENTS", default=())


def is_quiet() -> bool:
    """Whether only errors are to be said."""
    return "--quiet" in ARGUMENTS.get()


def repeated() -> str:
    """The command, as it is typed into a shell."""
    return shell_line("fisherpoint", *ARGUMENTS.get())


def shell_line(*words: str | Path) -> str:
    """Words of a command, those in quotes that a shell would take apart."""
    return shlex.join("-" if word == STANDARD_INPUT else str(word) for word in words)
