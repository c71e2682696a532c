"""``fisherpoint open``: the page of a result, in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def browse(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="A directory that a command has written, or its report.html.")],
) -> int:
    """Open the report.html of a result in the browser."""
    import webbrowser

    page = directory / "report.html" if directory.is_dir() else directory
    if not page.is_file():
        raise ValueError(f"DIR: expected a directory with a report.html, as commands write it with -o; given {directory}")
    if not webbrowser.open(page.resolve().as_uri()):
        raise ValueError(f"open: expected a browser, found none; the page is {page}")
    return 0
