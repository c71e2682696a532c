"""Updates of states at known times, as a model is given them: ``{"every 5 ms": {"i": "i + k*(r - q)"}}``."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from ..basics.checks import as_sequence, check_known
from ..basics.messages import shown
from ..basics.units import convert_unit
from .given_equations import equation_of
from .surfaces.memory import has_latch
from .tape.update import Update, UpdateTimes

EACH_SEGMENT = "each segment"

_FORM = f'"every 5 ms", "every 24 h from 8 h", "at 2 h, 5 h" or "{EACH_SEGMENT}"'


def checked_updates(given: Any, states: Sequence[str]) -> tuple[tuple[str, Mapping[str, Any]], ...]:
    """Times with the states that they set, of a mapping or a sequence of pairs."""
    pairs = list(given.items()) if isinstance(given, Mapping) else [] if given is None else as_sequence(given, "updates", "pairs")
    for pair in pairs:
        if not isinstance(pair, tuple) or len(pair) != 2 or not isinstance(pair[1], Mapping) or not pair[1]:
            raise TypeError(
                f"updates: expected times with the states that they set, as {{'every 5 ms': {{'i': 'i + k*(r - q)'}}}}, given"
                f" {shown(pair)}"
            )
        check_known(pair[1], states, f"updates.{shown(pair[0])}", "names of states,")
    return tuple(pairs)


def update_of(when: Any, values: Mapping[str, Any], symbols: Mapping[str, Any], clocks: Mapping[str, Any]) -> Update:
    """An update in symbols."""
    place = f"updates.{shown(when)}"
    times = update_times(when, place)
    new = tuple((symbols[x], equation_of(value, symbols, f"{place}.{x}", clocks)) for x, value in values.items())
    for x, value in new:
        if has_latch(value):
            raise ValueError(f"{place}.{x}: expected no latch(), which rates and resets alone read")
    return Update(times, new)


def update_times(given: Any, place: str) -> UpdateTimes:
    """Times of updates, of a text such as "every 5 ms"."""
    if not isinstance(given, str):
        raise TypeError(f"{place}: expected times such as {_FORM}, given {shown(given)}")
    text = " ".join(given.split())
    if text == EACH_SEGMENT:
        return UpdateTimes(text)
    if found := re.fullmatch(r"every (.+?)(?: from (.+))?", text):
        every, first = _time(found[1], place), 0.0 if found[2] is None else _time(found[2], place)
        if not every > 0:
            raise ValueError(f"{place}: expected a period of more than 0 s, given {every:g}")
        return UpdateTimes(text, (first,), every)
    if found := re.fullmatch(r"at (.+)", text):
        return UpdateTimes(text, tuple(sorted({_time(one, place) for one in found[1].split(",")})))
    raise ValueError(f"{place}: expected times such as {_FORM}, given {shown(given)}")


def _time(text: str, place: str) -> float:
    found = re.fullmatch(r"\s*([0-9.]+(?:[eE][-+]?[0-9]+)?)\s*([A-Za-zµ]+)\s*", text)
    try:
        if found is None:
            raise ValueError
        value = float(found[1])
    except ValueError:
        raise ValueError(f"{place}: expected a time with its unit, as 5 ms, given {shown(text)}") from None
    try:
        return float(convert_unit(value, found[2], "s"))
    except ValueError as error:
        raise ValueError(f"{place}: expected a unit of time, given {shown(found[2])}") from error
