"""A file on standard input, for which ``-`` stands."""

from __future__ import annotations

import sys
from pathlib import Path

import typer

from fisherpoint.basics.standard_input import STANDARD_INPUT, held, hold_standard_input

MARK = Path("-")


def one_from_standard_input(context: typer.Context, given: Path | None) -> Path | None:
    """The path, or what stands for standard input where that is given."""
    if given != MARK or context.resilient_parsing:  # completion runs this too
        return given
    if held(STANDARD_INPUT) is not None:
        raise ValueError("-: expected once, as standard input can be read once; given twice")
    from fisherpoint.basics.files import MOST_BYTES

    stream = getattr(sys.stdin, "buffer", None)
    if stream is None:
        raise ValueError("-: expected a file on standard input, given none")
    if stream.isatty():
        print("fisherpoint: reading standard input to its end, which is Ctrl-D", file=sys.stderr)
    content = stream.read(MOST_BYTES + 1)
    hold_standard_input(content)
    return STANDARD_INPUT


def from_standard_input(context: typer.Context, given: list[Path] | None) -> list[Path] | None:
    """Replace "-" by standard input among several paths."""
    return given and [one_from_standard_input(context, path) or path for path in given]
