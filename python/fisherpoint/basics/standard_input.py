"""Content of standard input, kept so that it can be read as a file repeatedly."""

from __future__ import annotations

from pathlib import Path

STANDARD_INPUT = Path("standard input")
"""Name that stands for the file, also in messages."""

_held: dict[Path, bytes] = {}


def hold_standard_input(content: bytes | None) -> None:
    """Let the file `STANDARD_INPUT` have this content; None for nothing any more."""
    _held.clear()
    if content is not None:
        _held[STANDARD_INPUT] = content


def held(path: Path) -> bytes | None:
    """The content of a file that is none on the disk."""
    return _held.get(path)
