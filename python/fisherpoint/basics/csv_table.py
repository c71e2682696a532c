"""CSV files: tables of numbers written with every digit, and read as people and spreadsheets write them.

Errors name the row and the column.
"""

from __future__ import annotations

import csv
import io
import re
import warnings
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from .checks import as_path
from .files import read_bytes
from .messages import listed, printable, shortened, shown
from .quantity import DURATION, Quantity
from .units import converted
from .values import Array

_WITH_UNIT = re.compile(r"([^\[(]*?)\s*(?:\[(.*)\]|\((.*)\))")


class CsvTable:
    """Columns of text under their names, and the units that the header gives in brackets, as in ``p_A [bar]``.

    Entries are separated by commas, semicolons or tabs, whichever the header has most of. Rows count from 1, the first below the
    header; blank lines do not count.

    Raises
    ------
    OSError
        Where the file cannot be read.
    ValueError
        Where it is no text, has no rows, a column twice, or a row with a wrong number of entries.
    """

    _comma_hint = "; use semicolons as separators with decimal commas"

    def __init__(self, given: str | Path) -> None:
        self.path = path = printable(as_path(given, "path"))
        try:
            text = read_bytes(Path(given)).decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise ValueError(f"{path}: expected a CSV text file in UTF-8, given bytes that are not text: {error}") from error
        lines = io.StringIO(text, newline="")  # keeps the line breaks as they are, as csv wants them
        first = next((line for line in lines if line.strip()), "")
        if first.lstrip().startswith("#"):
            given = shown(first.strip(), 40)
            raise ValueError(
                f"{path}: expected the names of the columns in the first line, given {given}: lines that begin with # are no "
                "comments here; remove them, or the # before the names"
            )
        lines.seek(0)
        self.separator = max(",;\t", key=first.count)
        try:
            read = csv.reader(lines, delimiter=self.separator, skipinitialspace=True, strict=True)
            header, *rows = [row for row in read if row not in ([], [""])] or [[]]
        except csv.Error as error:
            raise ValueError(f"{path}: expected a complete CSV file, given one that breaks: {error}") from error
        if not rows:
            raise ValueError(f"{path}: expected a header and at least one row, given {'a header alone' if header else 'none'}")
        for k, row in enumerate(rows):
            if len(row) != len(header):
                hint = self._comma_hint if self.separator == "," and len(row) > len(header) else ""
                if row[0].lstrip().startswith("#"):
                    hint = "; lines that begin with # are no comments here: remove them"
                if k + 1 == len(rows) and text[-1] not in "\r\n":
                    hint = ", at the end of the file, which has no line break: is it cut off?"
                expected = (
                    f"{len(header)} entries" if len(header) > 1 else f"one entry, as the header {shown(header[0], 40)} is one"
                )
                raise ValueError(f"{path}: row {k + 1}: expected {expected}, given {len(row)}{hint}")
        for k, entry in enumerate(header):
            if not entry.isprintable():
                raise ValueError(f"{path}: expected a name without control characters, given {shown(entry)} in column {k + 1}")
        units = [_name_and_unit(entry.strip()) for entry in header]
        self.names = tuple(name for name, _ in units)
        self.units = dict(units)
        twice = [name for name, count in Counter(self.names).items() if count > 1]
        if twice:
            raise ValueError(f"{path}: expected each column once, given {listed(twice)} more than once")
        self._texts = dict(zip(self.names, zip(*rows, strict=True), strict=True))
        self._ends = text[-1] in "\r\n"
        self._decimal_comma = False
        self._underscores = "_" in text[text.index(first) + len(first) :]

    def __contains__(self, name: str) -> bool:
        return name in self._texts

    def __len__(self) -> int:
        return len(self._texts[self.names[0]])

    def error(self, row: int, column: str, what: str) -> ValueError:
        """What is wrong in a row, counted from 0 here, of a column."""
        return ValueError(f"{self.path}: row {row + 1}, column {shortened(column)}: {what}")

    def warn_of_cut_off(self) -> None:
        """Warn where the last row has no line break: if the file was cut off within its last number, nothing else shows it."""
        if not self._ends:
            last = self._texts[self.names[-1]][-1]
            warnings.warn(
                f"{self.path}: row {len(self)}: expected a line break at the end of the file, given {shown(last)} there: "
                "is the file cut off within it? If not, add a line break",
                stacklevel=4,
            )

    def texts(self, name: str) -> list[str]:
        """The entries of a column."""
        return [entry.strip() for entry in self._texts[name]]

    def read_decimal_commas(self, names: Iterable[str]) -> None:
        """Take commas in these columns for decimal ones, where they can be nothing else.

        Raises
        ------
        ValueError
            Where some of their numbers have commas and others points.
        """
        if self.separator == ",":
            return
        found: dict[str, tuple[int, str, str]] = {}
        for name in names:
            for mark in ",.":
                if mark not in found:
                    where = next(((k, name, entry) for k, entry in enumerate(self._texts[name]) if mark in entry), None)
                    found |= {mark: where} if where else {}
        if len(found) == 2:
            (row, name, comma), (_, _, point) = found[","], found["."]
            raise self.error(
                row, name, f"expected either decimal commas or decimal points in a file, given {shown(comma)} and {shown(point)}"
            )
        self._decimal_comma = "," in found

    def numbers(self, name: str, unit: str) -> Array:
        """The entries of a column as numbers in the given unit, NaN where they are empty or "nan".

        Raises
        ------
        ValueError
            For text, infinite numbers, and a unit in the header that is none or measures something else.
        """
        texts: Iterable[str] = self._texts[name]
        if self._decimal_comma:
            texts = [entry.replace(",", ".") for entry in texts]
        try:
            values = np.array([float(entry) if entry else np.nan for entry in texts])
        except ValueError:
            values = np.array([self._number(row, name, entry) for row, entry in enumerate(texts)])
        if self._underscores:
            self.refuse(["_" in entry for entry in texts], name, "a number")  # 1_000 is one in Python alone
        self.refuse(np.isinf(values), name, "a finite number")
        given = self.units[name]
        if given is None:
            return values
        with np.errstate(over="ignore"):
            values = converted(values, "1" if given in ("", "-") else given, unit, f"{self.path}: column {name}")
        self.refuse(np.isinf(values), name, f"a finite number in {unit}")
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

    def refuse(self, wrong: ArrayLike, name: str, expected: str) -> None:
        """Raise for the first row that is wrong."""
        rows = np.flatnonzero(wrong)
        if len(rows):
            raise self.error(int(rows[0]), name, f"expected {expected}, given {shown(self._texts[name][rows[0]], 40)}")

    def _number(self, row: int, name: str, entry: str) -> float:
        try:
            return float(entry) if entry.strip() else np.nan
        except ValueError:
            given = self._texts[name][row]
            hint = self._comma_hint if "," in given and self.separator == "," else ""
            raise self.error(row, name, f"expected a number, given {shown(given, 40)}{hint}") from None


def csv_text(header: Sequence[str], rows: Iterable[Iterable[float | str]], line_end: str = "\r\n") -> str:
    """A header and rows of texts and numbers with every digit; an entry is empty where it is NaN."""
    file = io.StringIO()
    writer = csv.writer(file, lineterminator=line_end)
    writer.writerow(header)
    writer.writerows([[_text(entry) for entry in row] for row in rows])
    return file.getvalue()


def _text(entry: float | str) -> str:
    if isinstance(entry, str):
        return entry
    return "" if np.isnan(entry) else repr(float(entry))


def _name_and_unit(entry: str) -> tuple[str, str | None]:
    match = _WITH_UNIT.fullmatch(entry)
    if match is None or not match[1]:
        return entry, None
    return match[1], (match[2] if match[2] is not None else match[3]).strip()
