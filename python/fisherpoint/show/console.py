"""A report for the terminal, by rich."""

from __future__ import annotations

from rich import box
from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from .section import Report, Section


def to_rich(report: Report) -> Group:
    """The report with bold titles, quiet units and coloured warnings."""
    parts: list[RenderableType] = [Text(f"\n{report.headline}\n", "bold")]
    for section in report.sections:
        parts.append(Padding(_section(section), (0, 0, 1, 0)))
    for warning in report.warnings:
        parts.append(Padding(Text.assemble(("Warning: ", "bold yellow"), warning), (0, 0, 1, 0)))
    return Group(*parts)


def _section(section: Section) -> Group:
    # A title of the table's own would be broken to its width.
    title = [Text(section.title, "bold")] if section.title else []
    if section.columns:
        table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
        for i, column in enumerate(section.columns):
            left = section.is_left(i)
            table.add_column(Text(column), justify="left" if left else "right", style="dim" if column == "unit" else None)
    else:
        table = Table(box=None, show_header=False)
        table.add_column(style="dim", no_wrap=True)
        table.add_column()
    for k, row in enumerate(section.rows):
        table.add_row(*map(Text, row), style="yellow" if k in section.marked else None)
    return Group(*title, table, *(Text(note, "italic") for note in section.notes))
