"""Tables: columns of numbers under names, of a CSV file or of an object that has them, such as a frame.

Errors name the row and the column.
"""

from __future__ import annotations

import os
import re
import warnings
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .checks import as_path, by_name, check_mapping, check_name
from .csv_file import COMMA_HINT, read_csv
from .heads import Column, match_heads, name_and_unit
from .messages import listed, shortened, shown, stacklevel_of_user
from .moments import FORMS, in_seconds, is_moment, moments, since_first
from .named_columns import read_named
from .quantity import DURATION, Quantity
from .units import check_unit, converted
from .values import Array

_BRACKETS = re.compile(r"[\[(](.*)[\])]")

MISSING = {"", "na", "n/a", "#n/a", "nan", "null", "none", "nat", "<na>"}
"""Entries, in small letters, of what was not measured."""


class DataTable:
    """Columns under their names, and the units that the heads give in brackets, as in ``p_A [bar]``, or that stand below the heads.

    Rows count from 1, the first that has data.

    Parameters
    ----------
    given : path, or object with named columns
        A CSV file; a frame of pandas or polars, a dict of arrays, a dataset of xarray, a group of an HDF5 file, a table of Arrow,
        a structured array.
    columns : mapping of name to column, optional
        The columns of the table that count, each by the name under which it is found here. A column is named as its head is, with
        or without the unit there; a unit behind the name counts where the head has none. In a file the head is the first line
        that has all of them. What is not named is left out, with a warning. Default: all columns, under the names that they have.

    Raises
    ------
    OSError
        Where the file cannot be read.
    TypeError
        For what is neither a path nor has named columns.
    ValueError
        Where a column is missing or there twice, or a file is no text, has no rows, or a row with a wrong number of entries.
    """

    def __init__(self, given: Any, columns: Mapping[str, str] | None = None) -> None:
        wanted = None if columns is None else by_name(check_mapping(columns, "columns", "columns"), None, "columns", check_name)
        if wanted is not None and not wanted:
            raise ValueError("columns: expected the column of each quantity that was measured, given none")
        named, is_path = None if wanted is None else tuple(wanted.values()), isinstance(given, str | os.PathLike)
        self._read = read = read_csv(as_path(given, "table"), named) if is_path else read_named(given, named)
        self.path = read.path
        self._heads, of_heads = zip(*(name_and_unit(read.heads[k]) for k in read.places), strict=True)
        self.names = self._heads if wanted is None else tuple(wanted)
        twice = [name for name, count in Counter(self.names).items() if count > 1]
        if twice:
            raise ValueError(f"{self.path}: expected each column once, given {listed(twice)} more than once")
        taken, below = read.columns, _units_below(read.columns)
        if below is not None:
            taken = [column[1:] for column in taken]
        for head, column in zip(self._heads, taken, strict=True):
            if len(column) != len(taken[0]) or not len(column):
                expected = f"{len(taken[0])} rows, as in {shortened(self._heads[0])}" if len(column) else "at least one row"
                rates = "" if len(column) == len(taken[0]) else ": Record.merged takes channels of different rates"
                raise ValueError(f"{self.path}: column {shortened(head)}: expected {expected}, given {len(column)}{rates}")
        added = [match_heads(text, read.heads)[1] for text in named] if named else [None] * len(taken)
        choices = zip(added, of_heads, below or read.units, strict=True)
        units = [next((unit for unit in of_column if unit is not None), None) for of_column in choices]
        self.units: dict[str, str | None] = dict(zip(self.names, units, strict=True))
        self._columns: dict[str, Column] = dict(zip(self.names, taken, strict=True))
        self._named, self._decimal_comma = named is not None, False
        places = frozenset(read.places)
        left_out = [head for k, head in enumerate(read.heads) if head and k not in places]
        if left_out:
            warnings.warn(f"{self.path}: left out what is not named: {listed(left_out)}", stacklevel=stacklevel_of_user())

    def naming_hint(self, unknown: Iterable[str]) -> str:
        """What a message about unknown names adds where the table's own names were taken."""
        return "" if self._named or not [*unknown] else "; columns={...}, --column, or [data] of a TOML file names other columns"

    def __contains__(self, name: str) -> bool:
        return name in self._columns

    def __len__(self) -> int:
        return len(self._columns[self.names[0]])

    def _head(self, name: str) -> str:
        """The name that the table has for a column."""
        return self._heads[self.names.index(name)] if name in self.names else name

    def error(self, row: int, column: str, what: str) -> ValueError:
        """What is wrong in a row, counted from 0 here, of a column."""
        return ValueError(f"{self.path}: row {row + 1}, column {shortened(self._head(column))}: {what}")

    def warn_of_cut_off(self) -> None:
        """Warn where the last row has no line break: if the file was cut off within its last number, nothing else shows it."""
        if not self._read.ends:
            last = self._columns[self.names[-1]][-1]
            warnings.warn(
                f"{self.path}: row {len(self)}: expected a line break at the end of the file, given {shown(last)} there: "
                "is the file cut off within it? If not, add a line break",
                stacklevel=stacklevel_of_user(),
            )

    def texts(self, name: str) -> list[str]:
        """The entries of a column."""
        return [str(entry).strip() for entry in self._columns[name]]

    def read_decimal_commas(self, names: Iterable[str]) -> None:
        """Take commas in these columns for decimal ones, where they can be nothing else.

        Raises
        ------
        ValueError
            Where some of their numbers have commas and others points.
        """
        if self._read.separator == ",":
            return
        found: dict[str, tuple[int, str, str]] = {}
        for name in (name for name in names if not self._shows_moments(name)):
            column = self._columns[name]
            for mark in ",." if isinstance(column, tuple) else "":
                if mark not in found:
                    where = next(((k, name, entry) for k, entry in enumerate(column) if mark in entry), None)
                    found |= {mark: where} if where else {}
        if len(found) == 2:
            (row, name, comma), (_, _, point) = found[","], found["."]
            raise self.error(
                row, name, f"expected either decimal commas or decimal points in a file, given {shown(comma)} and {shown(point)}"
            )
        self._decimal_comma = "," in found

    def numbers(self, name: str, unit: str) -> Array:
        """The entries of a column as numbers in the given unit, NaN where one of `MISSING` stands; durations are in s.

        Raises
        ------
        ValueError
            For text, dates, infinite numbers, and a unit of the column that is none or measures something else.
        """
        column, given = self._columns[name], self.units[name]
        values: Array
        if isinstance(column, tuple):
            values = self._parsed(name, column)
        elif column.dtype.kind == "M":
            raise self.error(0, name, f"expected a number, given {shown(str(column[0]))}")
        elif column.dtype.kind == "m":
            values, given = in_seconds(column), "s"
        else:
            values = column
        self.refuse(np.isinf(values), name, "a finite number")
        if given is None:
            return values
        place = f"{self.path}: column {shortened(self._head(name))}"
        with np.errstate(over="ignore"):
            values = converted(values, "1" if given in ("", "-") else given, unit, place)
        self.refuse(np.isinf(values), name, f"a finite number in {unit}")
        return values

    def _parsed(self, name: str, texts: Sequence[str]) -> Array:
        if self._decimal_comma:
            texts = [entry.replace(",", ".") for entry in texts]
        try:
            values = np.array([float(entry) if entry else np.nan for entry in texts])
        except ValueError:
            values = np.array([self._number(row, name, entry) for row, entry in enumerate(texts)])
        if self._read.underscores:
            self.refuse(["_" in entry for entry in texts], name, "a number")  # 1_000 is one in Python alone
        return values

    def complete(self, quantity: Quantity, name: str | None = None) -> Array:
        """The column of a quantity, without gaps; a duration is positive.

        Raises
        ------
        ValueError
            As `numbers`, and where an entry is missing, or a duration is not positive.
        """
        name = name or quantity.name
        values = self.numbers(name, quantity.unit)
        self.refuse(np.isnan(values), name, "a number")
        if name == DURATION.name:
            self.refuse(values <= 0, name, "a positive duration in s")
        return values

    def times(self, name: str) -> Array:
        """The column of the times, s, without gaps; of dates and of times of day those since the first.

        Raises
        ------
        ValueError
            As `complete`, and for dates that are not written as ISO 8601 has it.
        """
        column = self._columns[name]
        if isinstance(column, tuple) and self._shows_moments(name):
            values, wrong = moments(column)
        elif not isinstance(column, tuple) and column.dtype.kind == "M":
            values, wrong = since_first(column), np.isnat(column)
        else:
            return self.complete(Quantity(name, "s"))
        self.refuse(wrong, name, FORMS)
        return values

    def _shows_moments(self, name: str) -> bool:
        column = self._columns[name]
        return isinstance(column, tuple) and is_moment(column[0])

    def refuse(self, wrong: ArrayLike, name: str, expected: str) -> None:
        """Raise for the first row that is wrong."""
        rows = np.flatnonzero(wrong)
        if len(rows):
            entry = self._columns[name][rows[0]]
            given = shown(entry, 40) if isinstance(entry, str) else str(entry)
            raise self.error(int(rows[0]), name, f"expected {expected}, given {given}")

    def _number(self, row: int, name: str, entry: str) -> float:
        try:
            return np.nan if entry.strip().casefold() in MISSING else float(entry)
        except ValueError:
            given = str(self._columns[name][row])
            hint = COMMA_HINT if "," in given and self._read.separator == "," else ""
            raise self.error(row, name, f"expected a number, given {shown(given, 40)}{hint}") from None


def as_table(given: Any, columns: Mapping[str, str] | None = None) -> DataTable:
    """A table that was read already, or one that is."""
    return given if isinstance(given, DataTable) else DataTable(given, columns)


def _units_below(read: Sequence[Column]) -> list[str | None] | None:
    """The units of the columns where the row below the heads has some and no number."""
    first = [column[0].strip() for column in read if isinstance(column, tuple)]
    bare = [_BRACKETS.sub(r"\1", entry) for entry in first]
    if len(first) < len(read) or any(map(_is_number, bare)) or not any(map(_is_unit, bare)):
        return None
    return [entry or None for entry in bare]


def _is_unit(text: str) -> bool:
    try:
        return text not in ("", "-") and bool(check_unit(text, "unit"))
    except ValueError:
        return False


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True
