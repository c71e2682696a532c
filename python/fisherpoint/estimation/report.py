"""What a fit is worth, as tables for the terminal and for ``report.txt``."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rich import box
from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from . import summary
from .fit import Fit
from .profile import Profile
from .profile_curve import FOUND


def fit_report(fit: Fit, profiles: Sequence[Profile] = ()) -> Group:
    """The report of `fisherpoint estimate`: unknowns, outputs, profile likelihood, how it was found, warnings."""
    parts: list[RenderableType] = [Text(f"\n{summary.headline(fit)}\n", "bold"), *map(_table, summary.sections(fit))]
    if profiles:
        parts.append(_table(_profiles(profiles)))
    facts = Table(box=None, title=Text("Fit", "bold"), title_justify="left", show_header=False)
    facts.add_column(style="dim", width=31)
    facts.add_column()
    for name, fact in summary.facts(fit):
        facts.add_row(Text(name), Text(fact))
    return Group(*parts, facts, *_warnings(fit, profiles))


def _table(section: summary.Section) -> RenderableType:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for i, column in enumerate(section.columns):
        left = i == 0 or column == "unit"
        style = "dim" if column == "unit" else None
        table.add_column(Text(column), justify="left" if left else "right", style=style, no_wrap=left)
    for k, row in enumerate(section.rows):
        table.add_row(*map(Text, row), style="yellow" if k in section.marked else None)
    return Group(Text(section.title, "bold"), table)  # a title of the table's own would be broken to its width


def _profiles(profiles: Sequence[Profile]) -> summary.Section:
    level = f"{100 * profiles[0].level:g} %"
    columns = ("parameter", "unit", f"{level} by likelihood", f"{level} by standard error", "lower end", "upper end")
    rows = []
    for profile in profiles:
        intervals = (" to ".join(summary.number(end, 4) for end in pair) for pair in (profile.interval, profile.linear_interval))
        rows.append((profile.name, profile.unit, *intervals, *profile.ends))
    marked = tuple(k for k, profile in enumerate(profiles) if profile.ends != (FOUND, FOUND))
    return summary.Section("Profile likelihood", columns, tuple(rows), marked)


def _warnings(fit: Fit, profiles: Sequence[Profile]) -> Iterator[RenderableType]:
    texts = list(summary.warnings(fit))
    texts += [f"{p.name}: a better estimate was found on the profile; give more starts" for p in profiles if p.better]
    for text in texts:
        yield Padding(Text.assemble(("Warning: ", "bold yellow"), text), (1, 0, 0, 0))
