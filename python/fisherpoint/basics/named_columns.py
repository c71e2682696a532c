"""Columns of objects that have names for them: frames, dicts of arrays, datasets of xarray, HDF5 groups, tables of Arrow."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from .checks import as_numbers
from .heads import Column, ReadColumns, missing_columns, places_of
from .messages import shortened, shown

INDEX = "index"
"""Name under which the index of a frame is found where it has none of its own."""


def read_named(given: Any, wanted: Sequence[str] | None = None) -> ReadColumns:
    """Read the columns of an object, all of them or those that are wanted, as `match_heads` finds them.

    Raises
    ------
    TypeError
        Where the object has no named columns.
    ValueError
        Where a column is missing, or is no column of numbers, texts or times.
    """
    given, labels = _labels(given, wanted or ())
    heads = [*labels]
    places = [*range(len(heads))] if wanted is None else places_of(wanted, heads)
    if not heads or len(places) < len(wanted or ()):
        raise missing_columns("table", wanted or ("of the model",), heads)
    read = [given[labels[heads[k]]] for k in places]
    columns = [_values(column, f"table: column {shortened(heads[k])}") for column, k in zip(read, places, strict=True)]
    return ReadColumns("table", heads, places, columns, [_unit(column) for column in read])


def _labels(given: Any, wanted: Collection[str]) -> tuple[Any, dict[str, Any]]:
    """An object with columns, and their heads, each with the label by which the object knows it.

    The second of two levels of labels is the unit. The index of a frame is a column where it has a name, or `INDEX` is wanted.
    """
    kind = type(given)
    if hasattr(kind, "iloc") and hasattr(kind, "columns"):
        index = [name for name in given.index.names if name is not None]
        if (INDEX in wanted or index) and not {*index, INDEX} & {*given.columns}:
            given = given.reset_index()
    labels = getattr(getattr(given, "dtype", None), "names", None)
    if labels is None:
        attribute = next((name for name in ("column_names", "columns", "variables") if hasattr(kind, name)), None)
        if attribute is None and not isinstance(given, Mapping):
            raise TypeError(f"table: expected a path, or named columns as a frame or a dict of arrays has, given {kind.__name__}")
        labels = given if attribute is None else getattr(given, attribute)
    return given, {f"{one[0]} [{one[1]}]" if isinstance(one, tuple) and len(one) == 2 else str(one): one for one in labels}


def _values(column: Any, place: str) -> Column:
    try:
        array = column if isinstance(column, np.ndarray) else np.asarray(column)
    except (TypeError, ValueError, RuntimeError) as error:
        raise ValueError(f"{place}: expected a number in each row, given {shown(column)}") from error
    if array.ndim == 2 and 1 in array.shape:
        array = array.ravel()
    if array.ndim != 1 or not len(array):
        raise ValueError(f"{place}: expected a number in each row, at least one, given shape {array.shape}")
    if array.dtype.kind in "mM":
        return array.astype(f"{array.dtype.kind}8[ns]")
    if array.dtype.kind == "b":  # a digital channel
        return array.astype(float)
    if array.dtype.kind in "OSUT":
        try:
            return as_numbers(array, place)
        except ValueError:
            return tuple(entry.decode(errors="replace") if isinstance(entry, bytes) else str(entry) for entry in array.tolist())
    return as_numbers(array, place)


def _unit(column: Any) -> str | None:
    """The attribute `units` or `unit` of a column of xarray, HDF5 or pandas."""
    attributes = getattr(column, "attrs", None)
    unit = attributes.get("units", attributes.get("unit")) if isinstance(attributes, Mapping) else None
    unit = unit.decode(errors="replace") if isinstance(unit, bytes) else unit
    return unit if isinstance(unit, str) else None
