"""Checks of what a user hands in: each says what was expected, what was given, and the quantity's name."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import nullcontext, suppress
from decimal import Decimal
from itertools import islice
from numbers import Real
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .messages import listed, shown
from .values import Array, FrozenMapping

Checked = TypeVar("Checked")

MOST_NAMES = 100_000
"""Names or things of a sequence, past which it counts as one without end."""

MOST_CHARACTERS = 4096
"""Maximum length of a path, or of a name that may be one."""

LARGEST_INT = 2**128 - 1
"""Largest seed; counts have limits of their own."""

SMALLEST_STD, LARGEST_STD = 1e-100, 1e100
"""Limits of standard deviations: their squares, and what follows from these, are ordinary doubles."""

# --- Numbers -------------------------------------------------------------------------------------------------------------


def as_numbers(values: ArrayLike, name: str) -> Array:
    """Return `values` as a float array, which may hold NaN and infinite numbers; raise where they are no numbers.

    Numbers are real: whole, decimal and fractions, not texts, flags, dates or complex ones. None in an array is NaN, as is what a
    masked array hides.
    """
    if values is None:
        raise ValueError(f"{name}: expected numbers, given None")
    try:
        array = np.asarray(values)
        if array.dtype.kind == "O":
            array = np.array([_as_double(entry) for entry in array.ravel().tolist()]).reshape(array.shape)
        elif array.dtype.kind not in "iuf":
            raise TypeError(array.dtype.name)
        with np.errstate(over="ignore") if array.dtype.itemsize > 8 else nullcontext():
            array = array.astype(np.float64)  # a copy in any case
    except (TypeError, ValueError, OverflowError, ArithmeticError, AttributeError, RuntimeError) as error:
        raise ValueError(f"{name}: expected numbers, given {shown(values, 80)}") from error
    if "numpy.ma" in sys.modules and isinstance(values, np.ma.MaskedArray):  # which would be imported here, for nothing else
        array[np.ma.getmaskarray(values)] = np.nan
    return array


def _as_double(entry: Any) -> float:
    if entry is None:
        return np.nan
    if isinstance(entry, bool | np.bool_) or not isinstance(entry, Real | Decimal):
        raise TypeError(type(entry).__name__)
    return float(entry)


def as_rows(array: Array, count: int, name: str, width: str) -> Array:
    """Return an array of shape (count, `width`), taking (count,) for one column; raise for another shape."""
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
        place = f" at index {where}" if where else ""
        raise ValueError(f"{name}: expected finite numbers, given {array[where]}{place}")
    return array


def as_float(value: Any, name: str) -> float:
    """Return `value` as a finite float."""
    if type(value) is float and math.isfinite(value):
        return value
    array = as_floats(value, name)
    if array.ndim != 0:
        raise ValueError(f"{name}: expected one number, given shape {array.shape}")
    return float(array)


def as_positive(value: Any, name: str, what: str = "number") -> float:
    """Return `value` as a finite float above zero."""
    number = as_float(value, name)
    if not number > 0:
        raise ValueError(f"{name}: expected a positive {what}, given {number:g}")
    return number


def as_probability(value: Any, name: str) -> float:
    """Return a number between 0 and 1, without these."""
    number = as_float(value, name)
    if not 0 < number < 1:
        raise ValueError(f"{name}: expected a probability between 0 and 1, given {number:g}")
    return number


def as_share(value: Any, name: str, most: float) -> float:
    """Return a positive share, of at most `most`: above, a percentage was meant."""
    share = as_positive(value, name, "share")
    if share > most:
        raise ValueError(f"{name}: expected a share of at most {most:g}, {percentage(share)}, given {share:g}")
    return share


def percentage(share: float) -> str:
    """A share that is meant, where a percentage is given."""
    return f"such as {share / 100:g} for {share:g} %"


def as_std(value: Any, name: str) -> float:
    """Return a standard deviation above zero, whose square is an ordinary double too."""
    std = as_positive(value, name, "standard deviation")
    if not SMALLEST_STD <= std <= LARGEST_STD:
        raise ValueError(f"{name}: expected a standard deviation between {SMALLEST_STD:g} and {LARGEST_STD:g}, given {std:g}")
    return std


def as_std_or_zero(value: Any, name: str) -> float:
    """As `as_std`, or 0."""
    std = as_float(value, name)
    if std < 0:
        raise ValueError(f"{name}: expected a standard deviation of at least 0, given {std:g}")
    return as_std(std, name) if std else 0.0


def as_floats_of_shape(values: ArrayLike, shape: tuple[int, ...], name: str) -> Array:
    array = as_floats(values, name)
    if array.shape != shape:
        raise ValueError(f"{name}: expected shape {shape}, given {array.shape}")
    return array


def check_positive_int(value: Any, name: str, least: int = 1, most: int = LARGEST_INT) -> int:
    """Return `value` as an int from `least` to `most`."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise ValueError(f"{name}: expected a whole number of at least {least}, given {shown(value)}")
    if value > most:
        raise ValueError(f"{name}: expected a whole number of at most {most}, given {shown(value)}")
    return int(value)


def as_generator(seed: Any) -> np.random.Generator:
    """Random numbers that follow from a seed; a generator goes on from where it is."""
    return seed if isinstance(seed, np.random.Generator) else np.random.default_rng(check_positive_int(seed, "seed", 0))


def check_flag(value: Any, name: str) -> bool:
    """Return `value`, which is True or False."""
    if not isinstance(value, bool | np.bool_):
        raise TypeError(f"{name}: expected True or False, given {shown(value)}")
    return bool(value)


# --- Kinds ---------------------------------------------------------------------------------------------------------------


def check_type(given: object, expected: type, name: str) -> None:
    """Raise TypeError where `given` is not of the `expected` type."""
    if not isinstance(given, expected):
        raise TypeError(f"{name}: expected {expected.__name__}, given {type(given).__name__}")


def check_choice(given: Any, choices: Sequence[str], name: str) -> str:
    """Return `given`, which is one of the texts."""
    if not isinstance(given, str) or given not in choices:
        expected = " or ".join([*filter(None, [", ".join(map(repr, choices[:-1]))]), repr(choices[-1])])
        raise ValueError(f"{name}: expected {expected}, given {shown(given)}")
    return given


def as_path(given: Any, name: str) -> Path:
    """Return a path; raise where it is none."""
    if not isinstance(given, str | os.PathLike) or not isinstance(os.fspath(given), str):
        raise TypeError(f"{name}: expected a path, given {shown(given)}")
    if not os.fspath(given) or "\0" in os.fspath(given) or len(os.fspath(given)) > MOST_CHARACTERS:
        raise ValueError(f"{name}: expected a path, given {shown(given)}")
    return Path(given)


def as_sequence(given: Any, name: str, what: str) -> tuple[Any, ...]:
    """Return the entries of a sequence or another collection that is no text."""
    try:
        if isinstance(given, str | bytes) or not isinstance(given, Iterable):
            raise TypeError
        entries = tuple(islice(given, MOST_NAMES + 1))
    except Exception as error:  # of the collection's own
        raise TypeError(f"{name}: expected a sequence of {what}, given {shown(given)}") from error
    if len(entries) > MOST_NAMES:
        raise ValueError(f"{name}: expected at most {MOST_NAMES:,} {what}, given more")
    return entries


def as_parts(given: Any, kind: type) -> tuple[Any, ...]:
    """Return what is to be joined: one or more of a kind."""
    parts = as_sequence(given, "parts", kind.__name__)
    if not parts:
        raise ValueError("parts: expected at least one, given none")
    for k, part in enumerate(parts):
        check_type(part, kind, f"parts[{k}]")
    return parts


def as_index(index: Any, count: int, name: str) -> slice | NDArray[Any]:
    """Return which of `count` rows are meant, as numpy takes it: a slice, places, or a flag for each row.

    Raises
    ------
    IndexError
        For one row that there is not; whether there are all of several rows, numpy finds out.
    TypeError
        For anything else than these or one place.
    """
    if isinstance(index, slice):
        with suppress(TypeError, ValueError):
            index.indices(count)
            return index
    elif isinstance(index, int | np.integer) and not isinstance(index, bool):
        if not -count <= index < count:
            raise IndexError(f"{name}: expected an index below {count}, given {shown(index)}")
        return np.array([int(index)])
    elif (rows := _places(index)) is not None:
        return rows
    raise TypeError(f"{name}: expected an index, a slice, or a sequence of indices or flags, given {shown(index)}")


def _places(index: Any) -> NDArray[Any] | None:
    """Whole numbers or flags in a row; None where they are not."""
    try:
        rows = np.asarray(index, dtype=np.intp) if isinstance(index, list | tuple) and not index else np.asarray(index)
    except (TypeError, ValueError, OverflowError, RuntimeError):
        return None
    return rows if rows.ndim == 1 and rows.dtype.kind in "iub" else None


def check_alike(shapes: Sequence[tuple[int, ...]], what: str, name: str = "parts") -> None:
    """Raise where numbers of states, inputs and so on differ."""
    for shape in shapes:
        if shape != shapes[0]:
            raise ValueError(f"{name}: expected {shapes[0]} {what} in each, given {shape}")


# --- Names ---------------------------------------------------------------------------------------------------------------


def check_mapping(given: Any, name: str, what: str = "numbers") -> Mapping[Any, Any]:
    """Return a mapping of names; raise where it is none."""
    if not isinstance(given, Mapping):
        raise TypeError(f"{name}: expected a mapping of names to {what}, given {type(given).__name__}")
    return given


def check_name(given: Any, label: str) -> str:
    """Return a name: a text without control characters."""
    if not isinstance(given, str) or not given or not given.isprintable():
        raise TypeError(f"{label}: expected names as text, given {shown(given)}")
    if len(given) > MOST_CHARACTERS:
        raise ValueError(f"{label}: expected names of at most {MOST_CHARACTERS} characters, given {shown(given)}")
    return given


def check_names(given: Iterable[Any], expected: Iterable[str], name: str) -> None:
    """Raise unless `given` has exactly the `expected` names."""
    given, expected = list(given), list(expected)
    for unknown in (n for n in given if n not in expected):
        raise ValueError(f"{name}: expected the names {listed(expected)}; given unknown {shown(unknown)}")
    for missing in (n for n in expected if n not in given):
        raise ValueError(f"{name}: expected a value for {shown(missing)}, given none")


def check_known(given: Iterable[Any], known: Iterable[str], name: str, what: str = "names of") -> None:
    """Raise where one of the `given` names is not `known`."""
    known = tuple(known)
    for unknown in (one for one in given if not isinstance(one, str) or one not in known):
        raise ValueError(f"{name}: expected {what} {listed(known, 'nothing')}; given unknown {shown(unknown)}")


def names_among(given: Iterable[str], known: tuple[str, ...], label: str) -> tuple[str, ...]:
    """Return the given ones of the `known` names, in their order."""
    chosen = as_sequence(given, label, "names")
    check_known(chosen, known, label)
    return tuple(name for name in known if name in chosen)


def some_names_among(given: Iterable[str], known: tuple[str, ...], label: str) -> tuple[str, ...]:
    """Return names as `names_among` does, at least one."""
    chosen = names_among(given, known, label)
    if not chosen:
        raise ValueError(f"{label}: expected at least one name, given none")
    return chosen


def by_name(
    given: Any, known: Iterable[str] | None, label: str, check: Callable[[Any, str], Checked], *, complete: bool = False
) -> FrozenMapping[Checked]:
    """Return what `check`, such as `as_float` or `as_std`, makes of each value of a mapping of names.

    Parameters
    ----------
    given : mapping of name to value, or None
        None is an empty mapping.
    known : iterable of str, or None
        The names that may occur, in the order of the result; None for any.
    label : str
        Of the mapping, for messages.
    check : callable
        Takes a value and its label.
    complete : bool
        Whether all of the known names must be there.
    """
    given = check_mapping({} if given is None else given, label)
    if known is None:
        known = [check_name(name, label) for name in given]
    else:
        known = tuple(known)
        (check_names if complete else check_known)(given, known, label)
    return FrozenMapping({name: check(given[name], f"{label}[{shown(name)}]") for name in known if name in given})


def in_order(mapping: Any, expected: Iterable[str], name: str) -> Array:
    """Return the numbers of `mapping` in the order of the `expected` names."""
    return np.array(list(by_name(mapping, expected, name, as_float, complete=True).values()))
