"""How results show themselves: as text, in notebooks and on the terminal, from one report."""

from __future__ import annotations

from abc import ABC, abstractmethod
from importlib.util import find_spec

from .section import Report
from .text import to_html, to_markdown, to_text


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

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.report().headline}>"

    def __str__(self) -> str:
        return to_text(self.report())

    def _repr_html_(self) -> str:
        return to_html(self.report())
