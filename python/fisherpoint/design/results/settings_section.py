"""The settings of a search in words, for the page of a result; those with their default are left out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from ...points.experiments import Experiments
from ...show.numbers import number, percent
from ...show.section import Section
from ..goal.goal import Goal
from ..goal.options import options_of
from .settings import ExchangeMethod, ExchangeSettings, RunSettings

Options = ExchangeSettings | RunSettings | ExchangeMethod | Goal


def settings_section(settings: ExchangeSettings | RunSettings) -> Section:
    """The settings of a search."""
    rows = list(_rows(settings))
    if isinstance(settings, ExchangeSettings):
        rows[1:1] = _rows(settings.method)
    rows[1:1] = _rows(settings.goal)
    return Section("Search", (), rows)


def _rows(options: Options) -> Iterator[tuple[str, str]]:
    for one in options_of(type(options)):
        value = getattr(options, one.name)
        if one.words and value is not None and (one.always or value != one.default):
            yield one.words, _shown(one.name, value)


def _shown(name: str, value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{number(value)} s" if name == "time_limit" else percent(value)
    if isinstance(value, Experiments):
        return str(len(value))
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {number(one)}" for key, one in value.items())
    return ", ".join(map(str, value)) if isinstance(value, tuple) else str(value)
