"""What a command writes of a result for people: pictures, and a page with them and with how to repeat it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

from fisherpoint.basics.files import REPORTS, read_bytes, write_together, write_whole
from fisherpoint.show.display import Plots, Shown
from fisherpoint.show.page import PagePicture, to_page
from fisherpoint.show.section import Report, Section

from .argv import repeated
from .drawing import Drawers
from .heartbeat import alive

TEXT, PAGE = REPORTS


def write_shown(
    result: Shown,
    file: Path,
    directory: Path,
    drawing: Drawers,
    plots: Plots | None = None,
    report: Report | None = None,
) -> list[str]:
    """Write pictures, the result's own or others, as PNG, and after them the page of a result; return their names."""
    report = result._page_report() if report is None else report
    return write_page(report, result._problem_sections(), result._plots() if plots is None else plots, file, directory, drawing)


def write_tables(
    tables: Mapping[str, Callable[[], str]], stale: Sequence[str], directory: Path, report: Callable[[], str]
) -> list[str]:
    """Write tables and the report together; the page and other stale files of a result before go. Return the files' names."""
    contents = {name: table() for name, table in tables.items()} | {TEXT: report()}
    return [path.name for path in write_together(directory, contents, stale=[PAGE, *stale])]


def write_page(
    report: Report, settings: Sequence[Section], plots: Plots, file: Path, directory: Path, drawing: Drawers
) -> list[str]:
    """Write pictures, as PNG, and after them a page with the text of the TOML file that was given; return their names.

    Ctrl-C ends the drawing: it is raised once there is a page without the pictures that are missing.
    """
    pictures: dict[str, PagePicture] = {}
    interrupted = False
    try:
        with alive("drawing") if drawing else nullcontext():
            for name, png, picture in drawing.drawn(plots):
                write_whole(directory / f"{name}.png", png)
                pictures[f"{name}.png"] = picture
    except KeyboardInterrupt:
        interrupted = True
        missing = [name for name in plots if f"{name}.png" not in pictures]
        for name in missing:
            (directory / f"{name}.png").unlink(missing_ok=True)  # of one that was just written
        warning = f"Interrupted while pictures were drawn; missing: {', '.join(missing)}."
        report = replace(report, warnings=[*report.warnings, warning])
    sources = {str(file): read_bytes(file).decode(errors="replace")}
    page = to_page(report, problem=settings, pictures=pictures.values(), command=repeated(), sources=sources)
    write_whole(directory / PAGE, page)
    if interrupted:
        raise KeyboardInterrupt
    return [*pictures, PAGE]
