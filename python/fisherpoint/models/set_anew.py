"""States that are set anew, as a model is given them: where a condition becomes true, or at known times.

``{"x < 0": {"v": "-e*v"}, "every 5 ms": {"i": "i + k*(r - q)"}}``
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence, Set
from typing import Any, NamedTuple

import sympy

from ..basics.checks import as_sequence, check_known
from ..basics.messages import shown
from ..basics.units import convert_unit
from .equation_text import parse_condition
from .expressions import checked
from .given_equations import Written, equation_of
from .surfaces.memory import has_latch
from .surfaces.printing import to_text
from .tape.delay import delay_in
from .tape.latch import condition_of as condition_in
from .tape.latch import holds
from .tape.parts import symbols_of
from .tape.reset import Reset
from .tape.update import EACH_SEGMENT, Update, UpdateTimes, at_known_times
from .terms import as_term

Given = tuple[tuple[Any, Mapping[str, Written]], ...]
"""Conditions as they are written, or texts of times, with the states that get values."""


class SetAnew(NamedTuple):
    """Resets where conditions become true, updates at known times, and all of them as they are written."""

    resets: tuple[Reset, ...]
    updates: tuple[Update, ...]
    given: Given


def states_set_anew(given: Any, states: Sequence[str], symbols: Mapping[str, Any], clocks: Mapping[str, Any]) -> SetAnew:
    """All of a mapping, or a sequence of pairs."""
    resets: list[Reset] = []
    updates: list[Update] = []
    pairs: list[tuple[Any, Mapping[str, Written]]] = []
    for when, values in pairs_of(given, states):
        place = f"resets.{shown(when.given if isinstance(when, Written) else when)}"
        new = {x: equation_of(value, symbols, f"{place}.{x}", clocks) for x, value in values.items()}
        targets = tuple((symbols[x], value.expression) for x, value in new.items())
        if isinstance(when, str) and at_known_times(when):
            updates.append(_update(when, targets, place))
            pairs.append((updates[-1].times.text, new))
        else:
            condition = _condition(when, symbols, place, clocks)
            resets.append(Reset(condition.expression, targets))
            pairs.append((condition, new))
    return SetAnew(tuple(resets), tuple(updates), tuple(pairs))


def check_moving(anew: Iterable[Reset], given: Given, moving: Set[Any]) -> None:
    """Raise where a condition of a reset, with its definitions written out, reads none of the symbols that move."""
    conditions = [when for when, _ in given if isinstance(when, Written)]
    for reset, when in zip(anew, conditions, strict=True):
        read = symbols_of(reset.condition)
        if not read & moving and not any(map(delay_in, read)):
            written = when.given or to_text(condition_in(when.expression))
            raise ValueError(f"resets.{shown(written)}: expected a condition of states, inputs or the time")


def pairs_of(given: Any, states: Sequence[str]) -> list[tuple[Any, Mapping[str, Any]]]:
    """The pairs of a mapping or a sequence, of what are conditions, times and states."""
    pairs = list(given.items()) if isinstance(given, Mapping) else [] if given is None else as_sequence(given, "resets", "pairs")
    for pair in pairs:
        if not isinstance(pair, tuple) or len(pair) != 2 or not isinstance(pair[1], Mapping) or not pair[1]:
            raise TypeError(
                "resets: expected a condition or times with the states that it sets, as {'x < 0': {'v': '-e*v'}}, given"
                f" {shown(pair)}"
            )
        check_known(pair[1], states, f"resets.{shown(pair[0])}", "names of states,")
    return list(pairs)


def _condition(given: Any, symbols: Mapping[str, Any], place: str, clocks: Mapping[str, Any]) -> Written:
    """What is 1 where the condition of a reset holds, else 0."""
    if isinstance(given, Written):
        return given
    if isinstance(given, str):
        return Written(parse_condition(given, symbols, place, clocks), given)
    term = as_term(given)
    if term is None or not isinstance(term.expression, sympy.logic.boolalg.Boolean) or term.expression.is_Symbol:
        raise ValueError(f"{place}: expected a condition such as x < 0, given {shown(given)}")
    return Written(checked(holds(term.expression), symbols, place, clocks))


def _update(when: str, values: tuple[tuple[Any, Any], ...], place: str) -> Update:
    for x, value in values:
        if has_latch(value):
            raise ValueError(f"{place}.{x.name}: expected no latch() at known times")
    return Update(_times(" ".join(when.split()), place), values)


def _times(text: str, place: str) -> UpdateTimes:
    if text == EACH_SEGMENT:
        return UpdateTimes(text)
    if found := re.fullmatch(r"every (.+?)(?: from (.+))?", text):
        every, first = _time(found[1], place), 0.0 if found[2] is None else _time(found[2], place)
        if not every > 0:
            raise ValueError(f"{place}: expected a period of more than 0 s, given {every:g}")
        return UpdateTimes(text, (first,), every)
    return UpdateTimes(text, tuple(sorted({_time(one, place) for one in text.removeprefix("at ").split(",")})))


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
