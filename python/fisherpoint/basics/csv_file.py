"""CSV files: tables written with every digit, and read as people, spreadsheets and loggers write them.

Entries are separated by commas, semicolons or tabs, whichever the head has most of; blank lines do not count. Text is UTF-8, UTF-16
with its mark, or Latin-1 as Windows has it.
"""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Iterable, Sequence
from contextlib import suppress
from itertools import islice
from pathlib import Path

import numpy as np

from .files import read_bytes
from .heads import ReadColumns, missing_columns, places_of
from .messages import printable, shown

COMMA_HINT = "; use semicolons as separators with decimal commas"

MOST_ABOVE = 1000
"""Lines of a file among which the head is looked for."""

READ_OTHERWISE = "read it by a library for such files, and give the table that this returns"


def read_csv(path: Path, wanted: Sequence[str] | None = None) -> ReadColumns:
    """Read a file.

    Parameters
    ----------
    path : Path
    wanted : sequence of str, optional
        The columns that are read, as `match_heads` finds them: the head is the first line that has all of them. Without, it is the
        first line, all columns are read, and each row has as many entries.

    Raises
    ------
    OSError
        Where the file cannot be read.
    ValueError
        Where it is no text, has no head or no rows, or a row has a wrong number of entries.
    """
    name, text = printable(path), _text(path)
    lines = io.StringIO(text, newline="")  # keeps the line breaks as they are, as csv wants them
    begin, line, chosen = _head(name, lines, wanted)
    lines.seek(begin)
    separator, ends, rows = _separator(line), text[-1] in "\r\n", list[list[str]]()
    try:
        read = (row for row in csv.reader(lines, delimiter=separator, skipinitialspace=True, strict=True) if row not in ([], [""]))
        heads = next(read, [])
        kept = list(range(len(heads))) if wanted is None else chosen
        for row in read:
            behind = row[len(heads) :] if wanted is not None else []
            if len(row) != len(heads) and (not behind or any(behind)):  # loggers end lines with a separator
                last = next(read, None) is None and not ends
                raise ValueError(_wrong_length(name, heads, row, len(rows), separator, last))
            rows.append(row if wanted is None else [row[k] for k in kept])
    except csv.Error as error:
        raise ValueError(f"{name}: expected a complete CSV file, given one that breaks: {error}") from error
    if not rows:
        raise ValueError(f"{name}: expected a header and at least one row, given a header alone")
    for k, entry in enumerate(heads):
        if not entry.isprintable():
            raise ValueError(f"{name}: expected a name without control characters, given {shown(entry)} in column {k + 1}")
    underscores = "_" in text[begin + len(line) :]
    return ReadColumns(
        name,
        [entry.strip() for entry in heads],
        kept,
        [*zip(*rows, strict=True)],
        [None] * len(kept),
        separator,
        ends,
        underscores,
    )


def _text(path: Path) -> str:
    given = read_bytes(path)
    wide = given.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    for encoding, alien in (("utf-16", "\0"),) if wide else (("utf-8-sig", "\0"), ("cp1252", "[\0-\10\16-\37]")):
        with suppress(UnicodeDecodeError):
            text = given.decode(encoding)
            if not re.search(alien, text):
                return text
    raise ValueError(f"{printable(path)}: expected a table as text, given bytes that are not text: {READ_OTHERWISE}")


def _head(name: str, lines: io.StringIO, wanted: Sequence[str] | None) -> tuple[int, str, list[int]]:
    """Where the head begins, its line, and the places of what is wanted of it."""
    begin, nearest, most = 0, list[str](), 0
    for line in islice(lines, None if wanted is None else MOST_ABOVE):
        if line.strip() and wanted is None:
            if line.lstrip().startswith("#"):
                raise ValueError(
                    f"{name}: expected the names of the columns in the first line, given {shown(line.strip(), 40)}: lines that "
                    "begin with # are no comments here; remove them, or the # before the names"
                )
            return begin, line, []
        if line.strip() and wanted is not None:
            entries = _entries(line)
            found = places_of(wanted, entries)
            if len(found) == len(wanted):
                return begin, line, found
            if len(found) > most or not nearest:
                nearest, most = entries, len(found)
        begin += len(line)
    if wanted is None or not nearest:
        raise ValueError(f"{name}: expected a header and at least one row, given none")
    raise missing_columns(name, wanted, nearest)


def _entries(line: str) -> list[str]:
    try:
        return [entry.strip() for entry in next(csv.reader([line], delimiter=_separator(line), skipinitialspace=True))]
    except csv.Error:
        return []  # a line above the head may be anything


def _separator(line: str) -> str:
    return max(",;\t", key=line.count)


def _wrong_length(name: str, heads: list[str], row: list[str], k: int, separator: str, cut_off: bool) -> str:
    hint = COMMA_HINT if separator == "," and len(row) > len(heads) else ""
    if row[0].lstrip().startswith("#"):
        hint = "; lines that begin with # are no comments here: remove them"
    if cut_off:
        hint = ", at the end of the file, which has no line break: is it cut off?"
    expected = f"{len(heads)} entries" if len(heads) > 1 else f"one entry, as the header {shown(heads[0], 40)} is one"
    return f"{name}: row {k + 1}: expected {expected}, given {len(row)}{hint}"


def csv_text(header: Sequence[str], rows: Iterable[Iterable[float | str]], line_end: str = "\r\n") -> str:
    """A header and rows of texts and numbers with every digit; an entry is empty where it is NaN."""
    file = io.StringIO()
    writer = csv.writer(file, lineterminator=line_end)
    writer.writerow(header)
    writer.writerows([[_entry(entry) for entry in row] for row in rows])
    return file.getvalue()


def _entry(entry: float | str) -> str:
    if isinstance(entry, str):
        return entry
    return "" if np.isnan(entry) else repr(float(entry))
