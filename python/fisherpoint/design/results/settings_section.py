"""A search in words: its options, those with their default left out, and what its time limit left no time for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from ...basics.options import options_of
from ...points.experiments import Experiments
from ...show.numbers import number, percent
from ...show.section import Section
from .settings import ExchangeSettings, RunSettings


def settings_section(settings: ExchangeSettings | RunSettings) -> Section:
    """The settings of a search, for the page of a result."""
    rows = list(option_facts(settings))
    if isinstance(settings, ExchangeSettings):
        rows[1:1] = option_facts(settings.method)
    rows[1:1] = option_facts(settings.goal)
    return Section("Search", (), rows)


def option_facts(options: Any, *without: str) -> Iterator[tuple[str, str]]:
    """Words and value of the options of an object that differ from their default, and of those that are always shown."""
    for one in options_of(type(options)):
        value = getattr(options, one.name)
        if one.words and one.name not in without and value is not None and (one.always or value != one.default):
            yield one.words, _shown(value) if one.shown is None else one.shown(value)


def left_out_facts(left_out: Sequence[str]) -> Iterator[tuple[str, str]]:
    """What a time limit left no time for, if anything."""
    if left_out:
        yield "left out for lack of time", "; ".join(left_out)


def _shown(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return percent(value)
    if isinstance(value, Experiments):
        return str(len(value))
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {number(one)}" for key, one in value.items())
    return ", ".join(map(str, value)) if isinstance(value, tuple) else str(value)
