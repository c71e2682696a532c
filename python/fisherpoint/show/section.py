"""Reports of results: titled tables, facts and warnings, as plain text, Markdown and HTML."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from html import escape

from ..basics.messages import printable

INDENT, GAP = "  ", "  "
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


def to_text(report: Report, width: int | None = None) -> str:
    """The report as plain text; with a width, in characters, its sentences are broken into lines."""
    lines = [*_wrapped(report.headline, width)]
    label = max((len(row[0]) for section in report.sections if not section.columns for row in section.rows), default=0)
    for section in report.sections:
        lines += ["", *_section_lines(section, width, label)]
    for warning in report.warnings:
        lines += ["", *_wrapped(f"Warning: {warning}", width)]
    return "\n".join(printable(line.rstrip()) for line in lines)


def _section_lines(section: Section, width: int | None, label: int) -> Iterator[str]:
    if section.title:
        yield from _wrapped(section.title, width)
    if section.columns:
        yield from _table_lines(section, width)
    else:
        for name, fact in section.rows:
            yield from _wrapped(f"{INDENT}{name:<{label}}{GAP}{fact}", width, INDENT + " " * label + GAP)
    for note in section.notes:
        yield from _wrapped(f"{INDENT}{note}", width, INDENT)


def _table_lines(section: Section, width: int | None) -> Iterator[str]:
    cells = [section.columns, *section.rows]
    sizes = [max(len(row[i]) for row in cells) for i in range(len(section.columns))]
    left = [section.is_left(i) for i in range(len(sizes))]
    for row in cells:
        padded = [f"{cell:<{size}}" if is_left else f"{cell:>{size}}" for cell, size, is_left in zip(row, sizes, left, strict=True)]
        start = len(INDENT + GAP.join(padded[:-1])) + len(GAP) * (len(padded) > 1)
        yield from _wrapped(INDENT + GAP.join(padded), width if left[-1] else None, " " * start)


def _wrapped(text: str, width: int | None, indent: str = "") -> Iterable[str]:
    if width is None or len(text.rstrip()) <= width or len(indent) > width - 20:
        return [text]
    return textwrap.wrap(text, width, subsequent_indent=indent, break_long_words=False)


def to_markdown(report: Report) -> str:
    """The report in Markdown."""
    lines = [f"**{_marked_down(report.headline)}**"]
    for section in report.sections:
        lines += ["", *([f"**{_marked_down(section.title)}**", ""] if section.title else [])]
        if section.rows or section.columns:
            head = section.columns or ("", "")
            align = [":--" if section.is_left(i) else "--:" for i in range(len(head))]
            lines += [f"| {' | '.join(map(_marked_down, row))} |" for row in (head, align, *section.rows)]
        lines += [f"\n{_marked_down(note)}" for note in section.notes]
    lines += [f"\n**Warning:** {_marked_down(warning)}" for warning in report.warnings]
    return "\n".join(printable(line) if line.isprintable() else line for line in lines) + "\n"


def _marked_down(text: str) -> str:
    return text.replace("\\", "\\\\").replace("|", "\\|").replace("*", "\\*").replace("_", "\\_").replace("<", "&lt;")


def to_html(report: Report) -> str:
    """The report in HTML, for a notebook."""
    parts = [f"<p><b>{escape(report.headline)}</b></p>"]
    for section in report.sections:
        rows = [f"<tr>{''.join(f'<th>{escape(column)}</th>' for column in section.columns)}</tr>"] if section.columns else []
        align = [' style="text-align: left"' if section.is_left(i) else "" for i in range(len(section.columns) or 2)]
        for row in section.rows:
            cells = "".join(f"<td{side}>{escape(cell)}</td>" for cell, side in zip(row[1:], align[1:], strict=True))
            rows.append(f"<tr><th{align[0]}>{escape(row[0])}</th>{cells}</tr>")
        title = escape(section.title)
        parts.append(f"<table><caption>{title}</caption>{''.join(rows)}</table>" if rows else f"<p>{title}</p>")
        parts += [f"<p>{escape(note)}</p>" for note in section.notes]
    return "".join(parts + [f"<p><b>Warning:</b> {escape(warning)}</p>" for warning in report.warnings])
