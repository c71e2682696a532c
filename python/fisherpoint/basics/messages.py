"""How what a user or a file gives is shown in a message: on one line, cut where it is long, without control characters."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from itertools import islice
from pathlib import Path
from types import FrameType
from typing import Any

PACKAGE = str(Path(__file__).resolve().parents[1])

SHOWN = 60
"""Characters of a value."""

LISTED = 20
"""Names of a list."""


def printable(text: object) -> str:
    """The text with escapes, such as ``\\x1b``, instead of what a terminal would obey and not print."""
    text = str(text)
    return text if text.isprintable() else "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def shown(value: Any, most: int = SHOWN) -> str:
    """A value as Python writes it, cut to `most` characters."""
    try:
        text = repr(value[: most + 1] if isinstance(value, str | bytes) else value)
    except Exception:  # whatever a value's own code raises, and whole numbers of more than 4300 digits
        text = f"a {type(value).__name__} that cannot be shown"
    text = printable(" ".join(text.split()))
    return text if len(text) <= most else f"{text[: most - 3]}..."


def listed(names: Iterable[Any], none: str = "none") -> str:
    """Names, separated by commas; of many the first, and how many more there are."""
    names = list(names)
    first = ", ".join(shortened(name) for name in islice(names, LISTED))
    return f"{first} and {len(names) - LISTED:,} more" if len(names) > LISTED else first or none


def with_counts(counts: Mapping[Any, int]) -> str:
    """Reasons, each behind how often it occurred: 2 met_jump, 1 starts on v = 0."""
    return ", ".join(f"{count} {reason}" for reason, count in counts.items())


def shortened(text: object, most: int = SHOWN) -> str:
    """A text that is part of a message, cut to `most` characters."""
    text = printable(str(text)[: most + 1])
    return text if len(text) <= most else f"{text[: most - 3]}..."


def stacklevel_of_user() -> int:
    """The `stacklevel` by which a warning of the calling function names the user's line: the first outside the package."""
    frame: FrameType | None = sys._getframe(1)
    level = 1
    while frame is not None and frame.f_code.co_filename.startswith(PACKAGE):
        frame, level = frame.f_back, level + 1
    return level
