"""How results show themselves: as text, in notebooks and on the terminal, from one report."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from ..basics.checks import as_path, check_flag
from ..basics.extras import needed_for
from ..basics.files import write_whole
from .page import to_page
from .section import Report, Section, to_html, to_markdown, to_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Plots = Mapping[str, "Callable[[], Figure]"]
"""Pictures that can be drawn, by their names."""


class Shown(ABC):
    """A result with a report."""

    @abstractmethod
    def report(self) -> Report:
        """The result as a headline, tables and warnings."""

    def print(self) -> None:
        """Print the report: in the terminal's width and colours where rich is installed."""
        if find_spec("rich") is None:
            print(self)
            return
        from rich.console import Console

        from .console import to_rich

        Console(highlight=False).print(to_rich(self.report()))

    def to_markdown(self) -> str:
        """The report in Markdown."""
        return to_markdown(self.report())

    def to_html(self, path: str | Path, *, pictures: bool = True) -> None:
        """Write the report as a page for the browser, one file that needs no other, with problem, settings and tables that sort.

        Parameters
        ----------
        path : path
            Of the file, which appears whole or not at all.
        pictures : bool
            Whether the result's pictures are in it; they need matplotlib.
        """
        path, drawn = as_path(path, "path"), []
        if check_flag(pictures, "pictures") and (plots := self._plots()):
            with needed_for("pictures"):
                from .page_pictures import for_page

            drawn = [for_page(name, plot()) for name, plot in plots.items()]
        write_whole(path, to_page(self._page_report(), problem=self._problem_sections(), pictures=drawn))

    def _page_report(self) -> Report:
        """The report of the page, where long tables have room."""
        return self.report()

    def _problem_sections(self) -> Sequence[Section]:
        """The problem and the settings."""
        return ()

    def _plots(self) -> Plots:
        """Every picture that has something to show."""
        return {}

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.report().headline}>"

    def __str__(self) -> str:
        return to_text(self.report())

    def _repr_html_(self) -> str:
        return to_html(self.report())
