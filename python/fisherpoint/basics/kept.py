"""Results as JSON files with a checksum: one codec for what dataclasses of numbers, texts, arrays and mappings hold."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from .checks import as_path
from .files import built_from, parse_json, read_bytes, sealed_json, write_whole
from .messages import shown
from .values import FrozenMapping

Codec = Mapping[type, tuple[Callable[[Any], Any], Callable[[Any], Any]]]
"""For types with a form of their own in JSON: how they are written, and read."""


class Kept:
    """A dataclass that is kept in a file; `load` gives it back to the last bit.

    A subclass says which other dataclasses are inside, which types have codecs, which names of kinds have changed since the first
    version of its format, and which of its fields older files have and nobody reads any more.
    """

    FORMAT_VERSION: ClassVar[int] = 1
    _INSIDE: ClassVar[tuple[type, ...]] = ()
    _CODEC: ClassVar[Codec] = {}
    _RENAMED: ClassVar[Mapping[str, str]] = {}
    _GONE: ClassVar[tuple[str, ...]] = ()

    def save(self, path: str | Path) -> None:
        """Write a JSON file with a checksum, whole or not at all."""
        path, text = as_path(path, "path"), self._file()
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, text)

    def _file(self) -> str:
        """The text of the file."""
        head = {"format": _format(type(self)), "format_version": self.FORMAT_VERSION}
        return sealed_json(head | {"content": _encoded(self, self._CODEC)})

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read what `save` wrote.

        Raises
        ------
        OSError
            Where the file cannot be read.
        ValueError
            Where it is truncated, was changed, or is of another format.
        """
        path = as_path(path, "path")
        data = parse_json(path, read_bytes(path), _format(cls), cls.FORMAT_VERSION)
        kinds = {kind.__name__: kind for kind in (cls, *cls._INSIDE)}
        codec = {kind.__name__: decode for kind, (_, decode) in cls._CODEC.items()}
        if cls._RENAMED and data["format_version"] == 1:
            data = _renamed(data, cls._RENAMED)
        found = built_from(path, cls.__name__, data, lambda whole: _decoded(whole["content"], kinds, codec))
        if not isinstance(found, cls):
            raise ValueError(f"{path}: expected a {cls.__name__}, given {shown(found)}")
        return found


def _renamed(data: Any, names: Mapping[str, str]) -> Any:
    """The same content with other names of kinds."""
    if isinstance(data, list):
        return [_renamed(entry, names) for entry in data]
    if isinstance(data, dict):
        return {names.get(name, name): _renamed(entry, names) for name, entry in data.items()}
    return data


def _format(kind: type) -> str:
    return f"fisherpoint {kind.__name__}"


def _encoded(value: Any, codec: Codec) -> Any:
    if value is None or isinstance(value, str | bool | int):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else {"float": repr(float(value))}
    if isinstance(value, np.generic):
        return _encoded(value.item(), codec)
    for kind, (encode, _) in codec.items():
        if isinstance(value, kind):
            return {kind.__name__: encode(value)}
    if isinstance(value, np.ndarray):
        entries = [_encoded(entry, codec) for entry in value.ravel().tolist()]
        return {"array": entries, "shape": value.shape, "dtype": value.dtype.str}
    if isinstance(value, Mapping):
        return {"mapping": [[_encoded(entry, codec) for entry in pair] for pair in value.items()]}
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return {type(value).__name__: {name: _encoded(entry, codec) for name, entry in zip(value._fields, value, strict=True)}}
    if isinstance(value, tuple):
        return [_encoded(entry, codec) for entry in value]
    if is_dataclass(value):
        return {type(value).__name__: {one.name: _encoded(getattr(value, one.name), codec) for one in fields(value)}}
    raise TypeError(f"expected something that can be saved, given {type(value).__name__}")


def _decoded(data: Any, kinds: Mapping[str, type], codec: Mapping[str, Callable[[Any], Any]]) -> Any:
    def inner(entry: Any) -> Any:
        return _decoded(entry, kinds, codec)

    if isinstance(data, list):
        return tuple(map(inner, data))
    if not isinstance(data, dict):
        return data
    (name, content) = next(iter(data.items()))
    if name == "float":
        return float(content)
    if name == "array":
        return np.array([inner(entry) for entry in content], dtype=np.dtype(data["dtype"])).reshape(data["shape"])
    if name == "mapping":
        return FrozenMapping({inner(key): inner(entry) for key, entry in content})
    if name in codec:
        return codec[name](content)
    kind = kinds[name]
    gone: tuple[str, ...] = getattr(kind, "_GONE", ())
    return kind(**{key: inner(entry) for key, entry in content.items() if key not in gone})
