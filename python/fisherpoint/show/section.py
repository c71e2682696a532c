"""Reports of results: titled tables, facts and warnings, whatever they are rendered to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from .text import to_html, to_text

TEXTS = ("unit",)
"""Columns that are text whatever is in them: 1/s is no number."""


@dataclass(frozen=True)
class Section:
    """A titled table.

    Attributes
    ----------
    title : str
    columns : tuple of str
        Their names; none for facts, each of whose rows is a name and what holds for it.
    rows : tuple of tuple of str
    marked : tuple of int
        Rows to point out.
    notes : tuple of str
        Sentences below the table.
    """

    title: str
    columns: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    marked: Sequence[int] = ()
    notes: Sequence[str] = ()

    def is_left(self, place: int) -> bool:
        """Whether a column is text, which goes to the left; columns of numbers go to the right."""
        cells = [row[place] for row in self.rows]
        if not self.columns or place == 0 or self.columns[place] in TEXTS:
            return True
        return any(cell and not _is_number(cell) for cell in cells)


@dataclass(frozen=True, repr=False)
class Report:
    """A headline, sections and warnings; `print` shows them.

    Where the headline is more than a line, a page has a short title above it, and shows it as these lines.
    """

    headline: str
    sections: Sequence[Section] = ()
    warnings: Sequence[str] = ()
    title: str = ""
    lines: Sequence[str] = ()

    def __repr__(self) -> str:
        return f"<Report: {self.headline}>"

    def __str__(self) -> str:
        return to_text(self)

    def _repr_html_(self) -> str:
        return to_html(self)


def _is_number(cell: str) -> bool:
    start = cell.lstrip("+-<{ ")
    return not start or start[0].isdigit() or start.startswith(("inf", "nan"))
