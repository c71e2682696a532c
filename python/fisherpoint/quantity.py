"""Named physical quantities, and checks of what a user hands in."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
IntArray = NDArray[np.int32]
Value = TypeVar("Value", covariant=True)


class FrozenMapping(Mapping[str, Value]):
    """A mapping that does not change, so that what holds it can be compared, hashed and sent to another process."""

    def __init__(self, values: Mapping[str, Value]) -> None:
        self._values = dict(values)

    def __getitem__(self, name: str) -> Value:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __hash__(self) -> int:
        return hash(frozenset(self._values.items()))

    def __repr__(self) -> str:
        return repr(self._values)


@dataclass(frozen=True)
class Quantity:
    """A state, input, output, parameter or constant: its name, SI unit and description.

    `scale` is a state's or output's natural size, in its unit, to which tolerances refer; None is taken as 1.
    """

    name: str
    unit: str
    description: str = ""
    scale: float | None = None


def names_of(quantities: Iterable[Quantity]) -> tuple[str, ...]:
    return tuple(quantity.name for quantity in quantities)


def as_numbers(values: ArrayLike, name: str) -> Array:
    """Return `values` as a float array, which may hold NaN and infinite numbers; raise where they are no numbers."""
    try:
        if np.iscomplexobj(values):
            raise TypeError("complex numbers")
        return np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name}: expected numbers, given {values!r:.80}") from error


def as_rows(array: Array, count: int, name: str, width: str) -> Array:
    """Return an array of shape (count, `width`), of which (count,) is taken for one column; raise for another shape."""
    if array.ndim == 1 and len(array) == count:
        array = array.reshape(count, 1)
    if array.ndim != 2 or len(array) != count:
        raise ValueError(f"{name}: expected shape ({count}, {width}), given {array.shape}")
    return array


def as_floats(values: ArrayLike, name: str) -> Array:
    """Return `values` as a float array; raise where they are no numbers or not finite."""
    array = as_numbers(values, name)
    if not np.isfinite(array).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise ValueError(f"{name}: expected finite numbers, given {array[where]} at index {where}")
    return array


def as_float(value: Any, name: str) -> float:
    """Return `value` as a finite float."""
    array = as_floats(value, name)
    if array.ndim != 0:
        raise ValueError(f"{name}: expected one number, given shape {array.shape}")
    return float(array)


def as_floats_of_shape(values: ArrayLike, shape: tuple[int, ...], name: str) -> Array:
    array = as_floats(values, name)
    if array.shape != shape:
        raise ValueError(f"{name}: expected shape {shape}, given {array.shape}")
    return array


def check_names(given: Iterable[str], expected: Iterable[str], name: str) -> None:
    """Raise unless `given` has exactly the `expected` names."""
    given, expected = list(given), list(expected)
    for unknown in (n for n in given if n not in expected):
        raise ValueError(f"{name}: expected the names {', '.join(expected)}; given unknown {unknown!r}")
    for missing in (n for n in expected if n not in given):
        raise ValueError(f"{name}: expected a value for {missing!r}, given none")


def names_among(given: Iterable[str], known: tuple[str, ...], label: str) -> tuple[str, ...]:
    """Return the given ones of the `known` names, in their order."""
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise TypeError(f"{label}: expected a sequence of names, given {given!r}")
    chosen = tuple(given)
    for unknown in (name for name in chosen if name not in known):
        raise ValueError(f"{label}: expected names of {', '.join(known) or 'nothing'}; given unknown {unknown!r}")
    return tuple(name for name in known if name in chosen)


def some_names_among(given: Iterable[str], known: tuple[str, ...], label: str) -> tuple[str, ...]:
    """As `names_among`, of which there must be one at least."""
    chosen = names_among(given, known, label)
    if not chosen:
        raise ValueError(f"{label}: expected at least one name, given none")
    return chosen


def in_order(mapping: Mapping[str, Any], expected: Iterable[str], name: str) -> Array:
    """Return the values of `mapping` in the order of the `expected` names."""
    if not isinstance(mapping, Mapping):
        raise TypeError(f"{name}: expected a mapping of names to numbers, given {type(mapping).__name__}")
    expected = list(expected)
    check_names(mapping, expected, name)
    return np.array([as_float(mapping[n], f"{name}[{n!r}]") for n in expected])


def check_positive_int(value: Any, name: str, least: int = 1) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise ValueError(f"{name}: expected a whole number of at least {least}, given {value!r}")
    return int(value)
