"""Labels of data: the plant, day or batch of each point, run or record."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import Any

import numpy as np

from ..basics.checks import as_sequence, by_name, check_name
from ..basics.messages import shown
from ..basics.table import DataTable
from ..basics.values import FrozenMapping

LABELS = ("plant", "day")
"""Columns of a table that have labels, where no quantity of the model has the name."""


def checked_label(given: Any, name: str) -> str:
    """A label as text: also a whole number is one."""
    if isinstance(given, int | np.integer) and not isinstance(given, bool):
        return str(given)
    return str(check_name(given, name))


def checked_labels(given: Any, count: int) -> FrozenMapping[tuple[str, ...]]:
    """Labels of each of `count` points or runs, by name; one label alone is that of all."""

    def of_all(values: Any, name: str) -> tuple[str, ...]:
        if isinstance(values, str | int | np.integer):
            return (checked_label(values, name),) * count
        found = tuple(checked_label(one, name) for one in as_sequence(values, name, "labels as text"))
        if len(found) != count:
            raise ValueError(f"{name}: expected {count} labels, one for each point or run; given {len(found)}")
        return found

    return by_name(given, None, "labels", of_all)


def label_columns(given: Iterable[str] | None, taken: Collection[str]) -> tuple[str, ...]:
    """Names of columns that have labels, where a table has them: those given, and of `LABELS` those that mean nothing else."""
    names = as_sequence(() if given is None else given, "labels", "names of columns")
    for name in (name for name in names if check_name(name, "labels") in taken):
        raise ValueError(f"labels: expected names that no quantity of the model has, given {shown(name)}")
    return tuple(dict.fromkeys((*names, *(name for name in LABELS if name not in taken))))


def labels_of_table(table: DataTable, names: Iterable[str], first: np.ndarray | None = None) -> Mapping[str, tuple[str, ...]]:
    """Labels that a table has, by name: those of its rows, or those in the `first` (rows,) of each run, as all rows of it have."""
    found = {}
    for name in (name for name in names if name in table):
        texts = table.texts(name)
        if first is not None:
            own = np.array(texts, dtype=object)[np.maximum.accumulate(np.where(first, np.arange(len(texts)), 0))].tolist()
            table.refuse([text not in ("", of_run) for text, of_run in zip(texts, own, strict=True)], name, "the label above it")
            texts = [text for text, begins in zip(own, first, strict=True) if begins]
            table.refuse(first & np.array([not text for text in own]), name, "a label")
        else:
            table.refuse([not text for text in texts], name, "a label")
        found[name] = tuple(texts)
    return found
