"""What a command writes of a result for people: pictures, and a page with them and with how to repeat it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from fisherpoint.basics.extras import needed_for
from fisherpoint.basics.files import read_bytes, write_whole
from fisherpoint.show.page import PagePicture, to_page
from fisherpoint.show.section import Report, Section
from fisherpoint.show.shown import Plots, Shown

from .alive import alive
from .asked import repeated
from .importing import importing
from .side_by_side import Helpers

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE = "report.html"

MOST_DRAWERS = 2
"""Processes that draw: the longest picture takes as long as all others together."""


class Drawers:
    """Draws the pictures of a command, in processes that import what they need for it while the command is at its work.

    Parameters
    ----------
    helpers : Helpers or None
        None where nothing is to be drawn.
    """

    def __init__(self, helpers: Helpers | None) -> None:
        self._helpers = helpers
        self._begun: dict[str, Callable[[], tuple[bytes, PagePicture]]] = {}

    def unless(self, interrupted: bool) -> Drawers:
        """None where it was interrupted: who does so wants an end."""
        return Drawers(None) if interrupted else self

    def begin(self, plots: Plots) -> None:
        """Begin to draw those that have not been begun, the last first: they take longest."""
        if self._helpers is not None:
            for name in reversed([name for name in plots if name not in self._begun]):
                self._begun[name] = self._helpers.begin(partial(_encoded, name, plots[name]))

    def drawn(self, plots: Plots) -> Iterator[tuple[str, bytes, PagePicture]]:
        """Yield the name of each picture, its PNG file, and the picture for the page."""
        self.begin(plots)
        for name in (name for name in plots if name in self._begun):
            yield name, *self._begun[name]()

    def __bool__(self) -> bool:
        return self._helpers is not None


@contextmanager
def drawers(module: str | None) -> Iterator[Drawers]:
    """Begin to import a module of pictures, or none: what can fail for a trivial reason fails before the work, not after it."""
    if module is None:
        yield Drawers(None)
        return
    with needed_for("pictures"):
        if find_spec("matplotlib") is None:
            raise ModuleNotFoundError("No module named 'matplotlib'", name="matplotlib")
    with importing():
        helpers = Helpers(MOST_DRAWERS, partial(_prepare, module))
    with helpers:
        yield Drawers(helpers)


def _prepare(module: str) -> None:
    import_module("fisherpoint.show.page_pictures")
    import_module(module)


def write_shown(
    result: Shown,
    directory: Path,
    drawers: Drawers,
    file: Path,
    plots: Plots | None = None,
    report: Report | None = None,
) -> list[str]:
    """Write pictures, the result's own or others, as PNG, and after them the page of a result; return their names."""
    report = result._page_report() if report is None else report
    return write_page(report, result._asked(), directory, drawers, result._plots() if plots is None else plots, file)


def write_page(report: Report, asked: Sequence[Section], directory: Path, drawers: Drawers, plots: Plots, file: Path) -> list[str]:
    """Write pictures, as PNG, and after them a page with the text of the TOML file that was given; return their names.

    Ctrl-C ends the drawing: it is raised once there is a page without the pictures that are missing.
    """
    pictures: dict[str, PagePicture] = {}
    interrupted = False
    try:
        with alive("drawing") if drawers else nullcontext():
            for name, png, picture in drawers.drawn(plots):
                write_whole(directory / f"{name}.png", png)
                pictures[f"{name}.png"] = picture
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


def _encoded(name: str, plot: Callable[[], Figure]) -> tuple[bytes, PagePicture]:
    """A picture as a file, and for the page."""
    from fisherpoint.show.page_pictures import for_page
    from fisherpoint.show.style import encoded, settle

    figure = plot()
    settle(figure)
    png = encoded(figure, "png")
    return png, for_page(name, figure, png)
