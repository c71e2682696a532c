"""A report as a page for the browser: one file that needs no other, with pictures, tables that sort, and how to repeat it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from string import Template

from ..basics.messages import printable
from ..engine.versions import versions
from .section import Report, Section

LONG = 40
"""Characters from which on a cell may be broken into lines."""


@dataclass(frozen=True)
class PagePicture:
    """A picture as it stands in a page.

    Attributes
    ----------
    title : str
    markup : str
        An ``svg`` element, or an ``img`` whose source is in it.
    width : float
        Of the picture as it was drawn, in inches.
    """

    title: str
    markup: str
    width: float


def to_page(
    report: Report,
    *,
    problem: Sequence[Section] = (),
    pictures: Iterable[PagePicture] = (),
    command: str = "",
    sources: Mapping[str, str] | None = None,
) -> str:
    """The page: warnings, how to repeat it, problem and settings, the report, pictures.

    Parameters
    ----------
    report : Report
    problem : sequence of Section
        The problem and the settings.
    pictures : iterable of PagePicture
    command : str
        What makes the page again, where a command has made it.
    sources : mapping of name to text, optional
        Files that the command was given.
    """
    title = report.title or report.headline
    parts = [f"<h1>{_text(title)}</h1>"]
    parts += [f'<p class="lead">{_text(line)}</p>' for line in report.lines]
    parts += [f'<p class="warning" role="note"><b>Warning:</b> {_text(warning)}</p>' for warning in report.warnings]
    parts += _problem(problem, command, sources or {})
    for section in report.sections:
        parts += _section(section, "h2")
    drawn = [_figure(picture) for picture in pictures]
    if drawn:
        parts += ["<h2>Pictures</h2>", *drawn]
    made = ", ".join(f"{name} {version}" for name, version in versions().items() if name != "isa")
    parts.append(f"<footer>Made with {_text(made)}; instruction set {_text(versions()['isa'])}.</footer>")
    template = Template(Path(__file__).with_name("page.html").read_text(encoding="utf-8"))
    return template.substitute(title=_text(title), body="\n".join(parts))


def _problem(sections: Sequence[Section], command: str, sources: Mapping[str, str]) -> Iterator[str]:
    if command:
        yield f"<h2>How to repeat it</h2>\n<pre>{_text(command)}</pre>"
    if sections:
        yield "<details>\n<summary>Problem and settings</summary>"
        for section in sections:
            yield from _section(section, "h3")
        yield "</details>"
    for name, text in sources.items():
        lines = "\n".join(map(_text, text.split("\n")))
        yield f'<details class="source">\n<summary>{_text(name)}</summary>\n<pre>{lines}</pre>\n</details>'


def _section(section: Section, level: str) -> Iterator[str]:
    if section.title:
        yield f"<{level}>{_text(section.title)}</{level}>"
    if section.rows or section.columns:
        yield f'<div class="scroll">{_table(section)}</div>'
    for note in section.notes:
        yield f'<p class="note">{_text(note)}</p>'


def _table(section: Section) -> str:
    left = [section.is_left(i) for i in range(len(section.columns) or 2)]
    head = ""
    if section.columns:
        cells = (f"<th{_class(side)}><button>{_text(name)}</button></th>" for name, side in zip(section.columns, left, strict=True))
        head = f"<thead><tr>{''.join(cells)}</tr></thead>"
    rows = []
    for k, row in enumerate(section.rows):
        cells = (f"<td{_class(side, cell)}>{_text(cell)}</td>" for cell, side in zip(row[1:], left[1:], strict=True))
        mark = ' class="marked"' if k in section.marked else ""
        rows.append(f"<tr{mark}><th{_class(left[0])}>{_text(row[0])}</th>{''.join(cells)}</tr>")
    kind = "sorted" if section.columns else "facts"
    return f'<table class="{kind}">{head}<tbody>\n' + "\n".join(rows) + "\n</tbody></table>"


def _class(left: bool, cell: str = "") -> str:
    names = [*(["text"] if left else []), *(["long"] if len(cell) > LONG else [])]
    return f' class="{" ".join(names)}"' if names else ""


def _figure(picture: PagePicture) -> str:
    style = f"--width: {96 * picture.width:.0f}px"
    caption = f"<figcaption>{_text(picture.title)}</figcaption>"
    return f'<figure>{caption}<div class="picture" style="{style}">{picture.markup}</div></figure>'


def _text(text: str) -> str:
    return escape(printable(text))
