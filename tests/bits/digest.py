"""Digests of results: of each array's bytes, each number, each text, by its place in the result."""

from __future__ import annotations

import dataclasses
import enum
import hashlib
from collections.abc import Iterator, Mapping, Sequence, Set
from pathlib import Path
from typing import Any

import numpy as np

import fisherpoint as fp

#: What differs from one execution to the next, and what was given.
PASSED = {"seconds", "time_limit", "problem", "model"}


def parts(value: Any, place: str = "") -> Iterator[tuple[str, str]]:
    """The places of a result, and a digest of what stands at each.

    Of a dataclass, all fields; of another object of the package, what it keeps. Models are known by their equations' text.

    Raises
    ------
    TypeError
        Of what kind a value is was not foreseen: a digest of its representation could contain an address.
    """
    if value is None or isinstance(value, bool | int | str | enum.Enum):
        yield place, _of(repr(value).encode())
    elif isinstance(value, float):
        yield place, _of(value.hex().encode())
    elif isinstance(value, np.ndarray | np.generic):
        yield place, _of_array(np.asarray(value))
    elif isinstance(value, bytes):
        yield place, _of(value)
    elif isinstance(value, Path):
        yield place, _of(value.name.encode())
    elif isinstance(value, fp.Model):
        yield place, _of(type(value).__name__.encode())
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        for field in dataclasses.fields(value):
            if field.name not in PASSED and not callable(getattr(value, field.name)):
                yield from parts(getattr(value, field.name), f"{place}.{field.name}")
    elif isinstance(value, Mapping):
        for key, one in value.items():
            yield from parts(one, f"{place}[{key}]")
    elif hasattr(value, "_asdict"):
        yield from parts(value._asdict(), place)
    elif isinstance(value, Sequence):
        for n, one in enumerate(value):
            if not callable(one):
                yield from parts(one, f"{place}[{n}]")
    elif isinstance(value, Set):
        yield place, _of(repr(sorted(map(repr, value))).encode())
    elif type(value).__module__.startswith("fisherpoint."):
        for name, one in _kept(value):
            yield from parts(one, f"{place}.{name}")
    else:
        raise TypeError(f"expected a number, a text, an array or a result, given {type(value).__qualname__}: {place}")


def _kept(value: object) -> Iterator[tuple[str, Any]]:
    """Attributes, but for functions and for what is computed once it is needed."""
    names = [name for kind in type(value).__mro__ for name in getattr(kind, "__slots__", ())]
    computed = {name for kind in type(value).__mro__ for name, one in vars(kind).items() if hasattr(one, "func")}
    for name in [*names, *getattr(value, "__dict__", {})]:
        if name not in computed | PASSED and hasattr(value, name) and not callable(getattr(value, name)):
            yield name, getattr(value, name)


def _of_array(array: np.ndarray[Any, Any]) -> str:
    if array.dtype == object:
        raise TypeError(f"expected an array of numbers or texts, given {array!r}")
    return _of(f"{array.dtype.str} {array.shape} ".encode() + np.ascontiguousarray(array).tobytes())


def _of(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]
