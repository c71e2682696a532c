"""What all commands share: printing reports, and the directory that their files go to."""

from __future__ import annotations

import sys
from pathlib import Path

from rich.console import Console, RenderableType

from .config import ConfigError
from .report import to_text


def show(report: RenderableType) -> None:
    """Print on standard output: in the terminal's width and colours, or as plain text where it is piped."""
    if sys.stdout.isatty():
        Console(highlight=False).print(report)
    else:
        print(to_text(report), end="", flush=True)


def make_directory(path: Path) -> None:
    """Make a directory for the files of a command, with those above it."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise ConfigError(f"--output: expected a directory, given {path}, which is or lies under a file") from None
