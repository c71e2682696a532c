"""Columns as they are read, and their heads: a name, and where it has one a unit in brackets behind it, as in ``p_A [bar]``."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

from numpy.typing import NDArray

from .messages import listed

Column = tuple[str, ...] | NDArray[Any]
"""Texts, or an array (N,) of numbers, dates or durations."""

_WITH_UNIT = re.compile(r"([^\[(]*?)\s*(?:\[(.*)\]|\((.*)\))")
_LAST_UNIT = re.compile(r"(.*\S)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))")


class ReadColumns(NamedTuple):
    """Heads of all columns of a table, the columns that were read with their places among these, and how they are written.

    Attributes
    ----------
    path : str
        The table as messages call it.
    units : list of str or None
        Of the columns that were read, where they are kept besides the heads.
    separator : str
        Between the entries of a file.
    ends : bool
        Whether the last row has a line break, or is of no file.
    underscores : bool
        Whether there may be one below the heads: Python alone takes 1_000 for a number.
    """

    path: str
    heads: list[str]
    places: list[int]
    columns: list[Column]
    units: list[str | None]
    separator: str = ""
    ends: bool = True
    underscores: bool = True


def name_and_unit(head: str) -> tuple[str, str | None]:
    """The name in a head, and its unit, None where it has none."""
    match = _WITH_UNIT.fullmatch(head)
    if match is None or not match[1]:
        return head, None
    return match[1], (match[2] if match[2] is not None else match[3]).strip()


def match_heads(wanted: str, heads: Sequence[str]) -> tuple[list[int], str | None]:
    """The places of the heads that a user means, and the unit that the user gives besides.

    That is the head itself, else a name without its unit, else a head to which the user adds the unit.
    """
    choices: list[tuple[str, Sequence[str], str | None]] = [
        (wanted, heads, None),
        (wanted, [name_and_unit(head)[0] for head in heads], None),
    ]
    if (added := _LAST_UNIT.fullmatch(wanted)) is not None:
        choices.append((added[1], heads, added[2] if added[2] is not None else added[3]))
    for text, among, unit in choices:
        if places := [k for k, head in enumerate(among) if head == text]:
            return places, unit
    return [], None


def places_of(wanted: Sequence[str], heads: Sequence[str]) -> list[int]:
    """The place of each column that is wanted, of those that are there.

    Raises
    ------
    ValueError
        Where all are there, and several heads fit one of them.
    """
    found = {text: match_heads(text, heads)[0] for text in wanted}
    for text, places in found.items():
        if len(places) > 1 and all(found.values()):
            among = listed(heads[k] for k in places)
            raise ValueError(f"columns: expected the name of one column, given {text}, which fits {among}")
    return [found[text][0] for text in wanted if found[text]]


def missing_columns(table: str, wanted: Sequence[str], heads: Sequence[str]) -> ValueError:
    """What to raise where not all columns that are wanted are there."""
    missing = [text for text in wanted if not match_heads(text, heads)[0]]
    return ValueError(f"{table}: expected the columns {listed(missing)}, given {listed(heads)}")
