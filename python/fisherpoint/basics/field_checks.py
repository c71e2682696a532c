"""Whether a result that was read from a file is what its class declares: types, sizes, names and choices of every entry.

Types are those of the annotations. A class says the rest:

=============  =========================================================================================================
`_EXTENTS`     by field, how far it extends along each axis: of an array its shape, of a mapping its names, of a tuple its
               length, and what is inside after that
`_CHOICES`     by field, the texts that it may be
`_POSITIVE`    fields of numbers above zero, or of mappings of such; other whole numbers are at least 0
`_NEEDS`       by field, another one that is not None where the field is not
`_check_content`  a method that raises ValueError where entries do not fit each other in another way
=============  =========================================================================================================

An extent is another field: names or quantities, of which there are as many as entries, or a number of entries. "some parameters"
are one or more of the names, "any parameters" none or more; "+" is any number but zero, "*" any, "..." any axes, and another word a
number that is the same wherever the word stands. Fields of fields are written with dots. Types that check themselves, in
`__post_init__`, are not looked into.
"""

from __future__ import annotations

import types
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import lru_cache
from typing import Any, ClassVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from .checks import LARGEST_INT
from .messages import listed, shown

Extents = Mapping[str, tuple[str, ...]]
Choices = Mapping[str, tuple[str, ...]]

LARGEST_COUNT = 2**53
"""Up to which whole numbers are doubles too."""


def check_declared(given: Any, place: str = "") -> None:
    """Raise ValueError where a dataclass or a named tuple, or one within it, is not what is declared; the message says where."""
    kind: type = type(given)
    hints = types_of(kind)
    for name, hint in hints.items():
        check_type_of(getattr(given, name), hint, f"{place}.{name}" if place else name)
    for name, choices in _said(kind, "_CHOICES").items():
        if (value := getattr(given, name)) not in choices:
            raise _wrong(f"{place}.{name}" if place else name, f"one of {', '.join(choices)}", value)
    for name in getattr(kind, "_POSITIVE", ()):
        value = getattr(given, name)
        for one in value.values() if isinstance(value, Mapping) else (value,):
            if one is not None and not one > 0:
                raise _wrong(f"{place}.{name}" if place else name, "a positive number", one)
    for name, other in _said(kind, "_NEEDS").items():
        if getattr(given, name) is not None and getattr(given, other) is None:
            raise _wrong(f"{place}.{other}" if place else other, f"a value together with {name}", None)
    free: dict[str, int] = {}
    for name, extents in _said(kind, "_EXTENTS").items():
        for at, value in _all_at(given, name.split("."), place):
            _check_extents(value, extents, given, free, at)
    if (check := getattr(given, "_check_content", None)) is not None:
        check()


def _said(kind: type, name: str) -> Mapping[str, Any]:
    found: Mapping[str, Any] = getattr(kind, name, {})
    return found


def types_of(kind: type) -> Mapping[str, Any]:
    """The types of the fields of a dataclass or a named tuple."""
    return _types_of(kind)


@lru_cache(maxsize=256)
def _types_of(kind: type) -> Mapping[str, Any]:
    hints = get_type_hints(kind)
    names = [one.name for one in fields(kind)] if is_dataclass(kind) else getattr(kind, "_fields", ())
    return {name: hints[name] for name in names if get_origin(hints[name]) is not ClassVar}


def _wrong(place: str, expected: str, given: Any) -> ValueError:
    return ValueError(f"{place}: expected {expected}, given {shown(given, 60)}")


# --- Types ---------------------------------------------------------------------------------------------------------------


def check_type_of(value: Any, hint: Any, place: str) -> None:
    """Raise ValueError where a value is not of the type that an annotation says."""
    origin, arguments = get_origin(hint), get_args(hint)
    if hint is Any:
        return
    if origin in (Union, types.UnionType):
        _check_one_of(value, arguments, place)
    elif origin is tuple:
        _check_tuple(value, arguments, place)
    elif isinstance(origin, type) and issubclass(origin, Mapping):
        if not isinstance(value, Mapping):
            raise _wrong(place, "a mapping of names", value)
        for name, entry in value.items():
            if not isinstance(name, str):
                raise _wrong(place, "names as text", name)
            check_type_of(entry, arguments[1], f"{place}[{shown(name)}]")
    elif origin is np.ndarray:
        (scalar,) = get_args(arguments[1])
        if not isinstance(value, np.ndarray) or not issubclass(value.dtype.type, scalar):
            raise _wrong(place, f"an array of {scalar.__name__}", value)
    elif hint is int:
        if isinstance(value, bool) or not isinstance(value, int):
            raise _wrong(place, "a whole number", value)
        if not 0 <= value <= (LARGEST_INT if place.endswith("seed") else LARGEST_COUNT):
            raise _wrong(place, "a whole number of at least 0 that is no larger than counts are", value)
    elif hint is float:
        if isinstance(value, bool) or not isinstance(value, float | int) or abs(value) > np.inf:
            raise _wrong(place, "a number", value)
        if isinstance(value, int) and abs(value) > LARGEST_COUNT:
            raise _wrong(place, "a number as a double", value)
    elif isinstance(hint, type):
        if not isinstance(value, hint):
            raise _wrong(place, f"a {hint.__name__}", value)
        if (is_dataclass(value) or hasattr(value, "_fields")) and not hasattr(value, "__post_init__"):
            check_declared(value, place)


def _check_one_of(value: Any, kinds: Sequence[Any], place: str) -> None:
    if value is None and type(None) in kinds:
        return
    others = [kind for kind in kinds if kind is not type(None)]
    fitting = [kind for kind in others if isinstance(value, get_origin(kind) or (float | int if kind is float else kind))]
    check_type_of(value, (fitting or others)[0], place)


def _check_tuple(value: Any, kinds: Sequence[Any], place: str) -> None:
    if not isinstance(value, tuple) or hasattr(value, "_fields"):
        raise _wrong(place, "a list", value)
    of_each = [kinds[0]] * len(value) if kinds[-1] is Ellipsis else list(kinds)
    if len(of_each) != len(value):
        raise _wrong(place, f"a list of {len(of_each)}", value)
    for k, (entry, kind) in enumerate(zip(value, of_each, strict=True)):
        check_type_of(entry, kind, f"{place}[{k}]")


# --- Extents -------------------------------------------------------------------------------------------------------------


def _all_at(given: Any, path: Sequence[str], place: str) -> Iterator[tuple[str, Any]]:
    """What is at a path of fields, and where: in every entry of mappings and tuples on the way, and nothing beyond None."""
    if given is None:
        return
    if not path:
        yield place, given
    elif isinstance(given, Mapping):
        for name, one in given.items():
            yield from _all_at(one, path, f"{place}[{shown(name)}]")
    elif isinstance(given, tuple) and not hasattr(given, "_fields"):
        for k, one in enumerate(given):
            yield from _all_at(one, path, f"{place}[{k}]")
    else:
        yield from _all_at(getattr(given, path[0]), path[1:], f"{place}.{path[0]}" if place else path[0])


def _at(given: Any, path: str) -> Any:
    """What is at a path of fields; None where something on the way is None."""
    for name in path.split("."):
        given = given if given is None else getattr(given, name)
    return given


def _check_extents(value: Any, extents: Sequence[str], owner: Any, free: dict[str, int], place: str) -> None:
    if isinstance(value, np.ndarray):
        _check_shape(value, extents, owner, free, place)
        return
    first, *inner = extents
    names, count = _extent(first, owner, free)
    some = first.startswith(("some ", "any "))
    if not value and first.startswith(("some ", "+")):
        raise _wrong(place, "at least one entry", value)
    if some and names is not None:
        if not set(value) <= names:
            raise _wrong(place, f"names among {listed(sorted(names))}", list(value))
    elif isinstance(value, Mapping):
        if names is not None and set(value) != names:
            raise _wrong(place, f"the names {listed(sorted(names))}", list(value))
    elif count is None:
        free.setdefault(first, len(value))
    elif len(value) != count:
        raise _wrong(place, f"{count} entries", value)
    if inner:
        for name, entry in value.items() if isinstance(value, Mapping) else enumerate(value):
            if entry is not None:
                _check_extents(entry, inner, owner, free, f"{place}[{shown(name)}]")


def _check_shape(array: Any, extents: Sequence[str], owner: Any, free: dict[str, int], place: str) -> None:
    if extents[0] == "...":
        extents = ["*"] * (array.ndim - len(extents) + 1) + list(extents[1:])
    if array.ndim != len(extents):
        raise ValueError(f"{place}: expected {len(extents)} axes, given shape {array.shape}")
    for axis, (extent, size) in enumerate(zip(extents, array.shape, strict=True)):
        _, count = _extent(extent, owner, free)
        if count is None and extent != "*":
            count = free[extent] = size
        if count is not None and size != count:
            raise ValueError(f"{place}: expected {count} along axis {axis}, given shape {array.shape}")


def _extent(word: str, owner: Any, free: Mapping[str, int]) -> tuple[frozenset[str] | None, int | None]:
    """The names that an extent stands for, where it stands for names, and their number; None where it is any so far."""
    word = word.removeprefix("some ").removeprefix("any ")
    if word in ("*", "+"):
        return None, None
    if word in free:
        return None, free[word]
    if not hasattr(owner, word.partition(".")[0]):
        return None, None
    found = _at(owner, word)
    if found is None or isinstance(found, int):
        return None, found
    return frozenset(getattr(one, "name", one) for one in found), len(found)
