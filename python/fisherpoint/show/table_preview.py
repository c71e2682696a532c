"""Preview of tables of numbers, such as points and data, in a notebook: their first rows."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..basics.values import Array
from .numbers import column
from .section import Report, Section, to_html

MOST = 10
"""Rows that are shown."""


class InNotebooks(ABC):
    """What a notebook shows as a table, and everything else by its `repr`."""

    @abstractmethod
    def _in_notebook(self) -> Report:
        """What is shown."""

    def _repr_html_(self) -> str:
        return to_html(self._in_notebook())


def first_rows(count: int, columns: Mapping[str, Array | Sequence[str]]) -> Section:
    """A table of the first of `count` rows, with at least these of all columns; numbers have four digits.

    Parameters
    ----------
    count : int
    columns : mapping of name to ndarray or texts
    """
    shown = min(count, MOST)
    texts = [
        [str(text) for text in given[:shown]] if not isinstance(given, np.ndarray) else column(given[:shown])
        for given in columns.values()
    ]
    notes = [f"and {count - shown} more"] if count > shown else []
    return Section("", tuple(columns), list(zip(*texts, strict=True)), notes=notes)


def numbered(name: str, values: Array) -> dict[str, Array]:
    """The columns of a matrix (K, n) that have no names of their own: name[0], name[1] and so on."""
    return {f"{name}[{i}]": values[:, i] for i in range(values.shape[1])}


def beside(first: Section, second: Section) -> Section:
    """Two tables of the same rows as one."""
    rows = [(*one, *other) for one, other in zip(first.rows, second.rows, strict=True)]
    return replace(first, columns=(*first.columns, *second.columns), rows=rows)
