"""What a command writes of a result for people: pictures, and a page with them and with how to repeat it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from fisherpoint.basics.files import read_bytes, write_whole
from fisherpoint.show.page import PagePicture, to_page
from fisherpoint.show.section import Report, Section
from fisherpoint.show.shown import Plots, Shown

from .alive import alive
from .asked import repeated
from .side_by_side import side_by_side

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE = "report.html"


def write_shown(result: Shown, directory: Path, plots: Plots, file: Path, report: Report | None = None) -> list[str]:
    """Write pictures, as PNG, and after them the page of a result; return their names."""
    return write_page(result._page_report() if report is None else report, result._asked(), directory, plots, file)


def write_page(report: Report, asked: Sequence[Section], directory: Path, plots: Plots, file: Path) -> list[str]:
    """Write pictures, as PNG, and after them a page with the text of the TOML file that was given; return their names.

    Ctrl-C ends the drawing: it is raised once there is a page without the pictures that are missing.
    """
    pictures: dict[str, PagePicture] = {}
    interrupted = False
    try:
        with alive("drawing") if plots else nullcontext():
            for name, picture in _drawn(plots, directory):
                pictures[name] = picture
    except KeyboardInterrupt:
        interrupted = True
        missing = [name for name in plots if f"{name}.png" not in pictures]
        for name in missing:
            (directory / f"{name}.png").unlink(missing_ok=True)  # of one that was just written
        told = f"Interrupted while pictures were drawn; missing: {', '.join(missing)}."
        report = replace(report, warnings=[*report.warnings, told])
    sources = {str(file): read_bytes(file).decode(errors="replace")}
    page = to_page(report, asked=asked, pictures=pictures.values(), command=repeated(), sources=sources)
    write_whole(directory / PAGE, page)
    if interrupted:
        raise KeyboardInterrupt
    return [*pictures, PAGE]


def _drawn(plots: Plots, directory: Path) -> Iterator[tuple[str, PagePicture]]:
    works = [partial(_encoded, name, plot) for name, plot in plots.items()]
    with closing(side_by_side(works)) as found:
        for name, (png, picture) in zip(plots, found, strict=True):
            write_whole(directory / f"{name}.png", png)
            yield f"{name}.png", picture


def _encoded(name: str, plot: Callable[[], Figure]) -> tuple[bytes, PagePicture]:
    """A picture as a file, and for the page."""
    from fisherpoint.show.page_pictures import for_page
    from fisherpoint.show.style import encoded, settle

    figure = plot()
    settle(figure)
    png = encoded(figure, "png")
    return png, for_page(name, figure, png)
