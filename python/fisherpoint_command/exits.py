"""How the program ends: its exit codes, and the one line on standard error."""

from __future__ import annotations

import os
import sys
from contextlib import suppress

TYPE_CHECKING = False  # `typing` takes a while to import
if TYPE_CHECKING:
    from typing import NoReturn

READER_LEFT, MISUSE, INTERRUPTED = 1, 2, 130
"""Exit codes."""


def leave(*_: object) -> NoReturn:
    """End at once."""
    erase = b"\r\x1b[K" if os.isatty(2) else b""  # a sign of life that stands there
    os.write(2, erase + b"fisherpoint: interrupted\n")
    os._exit(INTERRUPTED)


def why_not_imported(error: ImportError) -> str:
    """What is missing, and what to do about it."""
    message = " ".join(str(error).split())
    if ": expected " in message:
        return message
    return f"expected an installation that can be imported, given: {message}; reinstall fisherpoint"


def complain(*lines: str) -> None:
    """Print lines on standard error."""
    from fisherpoint.basics.messages import printable

    with suppress(OSError):
        for line in lines:
            print(f"fisherpoint: {printable(' '.join(line.split()))}", file=sys.stderr)
