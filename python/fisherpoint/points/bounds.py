"""Bounds of regions, which may be in units of their own: these are known before the model is to whose units they are converted."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ..basics.checks import as_floats, by_name
from ..basics.messages import shown
from ..basics.quantity import DURATION, Quantity
from ..basics.units import check_unit, converted
from ..basics.values import FrozenMapping

Pair = tuple[float, float]
Bounds = Sequence[Any] | float
"""(lower, upper), (lower, upper, unit) or (value, unit); of runs a number too."""


def read_bounds(bounds: Mapping[str, Any], read: Callable[[Any, str], Pair]) -> tuple[FrozenMapping[Pair], FrozenMapping[str]]:
    """The numbers, and the units of those that have one; durations are in s at once.

    Parameters
    ----------
    bounds : mapping of name to (lower, upper), (lower, upper, unit) or (value, unit)
    read : callable
        Takes the numbers alone, and their label.
    """

    def numbers(given: Any, label: str) -> Pair:
        if not _has_unit(given):
            return read(given, label)
        *values, _ = given
        return read(values * 2 if len(values) == 1 else values, label)

    pairs = by_name(bounds, None, "region", numbers)
    in_own = {name: given[-1] for name, given in bounds.items() if _has_unit(given)}
    units = by_name(in_own, None, "region", check_unit)
    known, left = in_units_of(pairs, units, [DURATION]), {name: unit for name, unit in units.items() if name != DURATION.name}
    return known, FrozenMapping(left)


def in_units_of(bounds: Mapping[str, Pair], units: Mapping[str, str], quantities: Iterable[Quantity]) -> FrozenMapping[Pair]:
    """Bounds in the units of quantities, those of others as they are.

    Raises
    ------
    ValueError
        For a unit of something else than the quantity; the message names both.
    """
    result = dict(bounds)
    for quantity in quantities:
        if quantity.name in units and quantity.name in bounds:
            numbers = np.array(bounds[quantity.name])
            lower, upper = converted(numbers, units[quantity.name], quantity.unit, f"region[{shown(quantity.name)}]").tolist()
            result[quantity.name] = lower, upper
    return FrozenMapping(result)


def split_unit(given: Any) -> tuple[Any, str | None]:
    """Numbers that may end with a unit, as [0, 1, "kW"], or a number and its unit, without it."""
    if isinstance(given, list | tuple) and len(given) > 1 and isinstance(given[-1], str) and not isinstance(given[0], str):
        return given[:-1], given[-1]
    return given, None


def units_in(given: Any, label: str) -> FrozenMapping[str]:
    """The units of those entries that have one; messages begin with the label."""
    found = {name: split_unit(entry)[1] for name, entry in given.items()} if isinstance(given, Mapping) else {}
    return by_name({name: unit for name, unit in found.items() if unit is not None}, None, label, check_unit)


def with_units(bounds: Mapping[str, Pair], units: Mapping[str, str]) -> dict[str, tuple[Any, ...]]:
    """Bounds as they were given."""
    return {name: (*pair, units[name]) if name in units else pair for name, pair in bounds.items()}


def pair(given: Sequence[float], label: str) -> Pair:
    """Bounds of a coordinate."""
    array = as_floats(given, label)
    if array.shape != (2,):
        raise ValueError(f"{label}: expected a pair (lower, upper), given {shown(given)}")
    for flag in (entry for entry in given if isinstance(entry, bool | np.bool_)):
        raise ValueError(f"{label}: expected numbers, given {flag!r}")
    lower, upper = array.tolist()
    if lower > upper:
        raise ValueError(f"{label}: expected lower <= upper, given ({lower:g}, {upper:g})")
    if not np.isfinite(upper - lower):
        raise ValueError(f"{label}: expected a finite width, given ({lower:g}, {upper:g})")
    return lower, upper


def pair_or_number(given: Sequence[float] | float, label: str) -> Pair:
    """Return a checked pair (lower, upper); one number stands for both."""
    array = as_floats(given, label)
    return pair((float(array), float(array)) if array.ndim == 0 else given, label)  # type: ignore[arg-type]


def _has_unit(given: Any) -> bool:
    return isinstance(given, list | tuple) and len(given) in (2, 3) and isinstance(given[-1], str) and not isinstance(given[0], str)
