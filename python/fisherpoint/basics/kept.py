"""Results as JSON files with a checksum: one codec for what dataclasses of numbers, texts, arrays and mappings hold."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from .checks import as_path
from .declared import check_declared
from .files import built_from, entry, parse_json, read_bytes, sealed_json, write_whole
from .messages import listed, shown
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
        return sealed_json(head | {"content": encoded(self, self._CODEC)})

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read what `save` wrote.

        Raises
        ------
        OSError
            Where the file cannot be read.
        ValueError
            Where it is truncated, was changed, is of another format, or has an entry of another kind or size than was written.
        """
        path = as_path(path, "path")
        data = parse_json(path, read_bytes(path), _format(cls), cls.FORMAT_VERSION)
        if cls._RENAMED and data["format_version"] == 1:
            data = _renamed(data, cls._RENAMED)
        return built_from(path, cls.__name__, data, cls._from_content)

    @classmethod
    def _from_content(cls, data: dict[str, Any]) -> Self:
        found = decoded(data["content"], (cls, *cls._INSIDE), cls._CODEC, "")
        if not isinstance(found, cls):
            raise ValueError(f"expected a {cls.__name__}, given {shown(found)}")
        check_declared(found)
        found._check_content()
        return found

    def _check_content(self) -> None:
        """Raise ValueError where entries do not fit each other in a way that a declaration has no words for."""


def decoded(data: Any, kinds: Iterable[type], codec: Codec, place: str) -> Any:
    """What `encoded` wrote, of these dataclasses; `place` names it in messages."""
    readers = {kind.__name__: decode for kind, (_, decode) in codec.items()}
    return _Decoder({kind.__name__: kind for kind in kinds}, readers).decoded(data, place)


def _renamed(data: Any, names: Mapping[str, str]) -> Any:
    """Return the content with other names of kinds."""
    if isinstance(data, list):
        return [_renamed(entry, names) for entry in data]
    if isinstance(data, dict):
        return {names.get(name, name): _renamed(entry, names) for name, entry in data.items()}
    return data


def _format(kind: type) -> str:
    return f"fisherpoint {kind.__name__}"


def encoded(value: Any, codec: Codec) -> Any:
    """What JSON has of dataclasses, numbers, texts, arrays and mappings, and of the types of a codec."""
    if isinstance(value, Enum):
        return {type(value).__name__: value.name}
    if value is None or isinstance(value, str | bool | int):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else {"float": repr(float(value))}
    if isinstance(value, np.generic):
        return encoded(value.item(), codec)
    for kind, (encode, _) in codec.items():
        if isinstance(value, kind):
            return {kind.__name__: encode(value)}
    if isinstance(value, np.ndarray):
        entries = [encoded(entry, codec) for entry in value.ravel().tolist()]
        dtype = "U" if value.dtype.kind == "U" else value.dtype.str  # texts have the room that they need when they are read
        return {"array": entries, "shape": value.shape, "dtype": dtype}
    if isinstance(value, Mapping):
        return {"mapping": [[encoded(entry, codec) for entry in pair] for pair in value.items()]}
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return {type(value).__name__: {name: encoded(entry, codec) for name, entry in zip(value._fields, value, strict=True)}}
    if isinstance(value, tuple):
        return [encoded(entry, codec) for entry in value]
    if is_dataclass(value):
        return {type(value).__name__: {one.name: encoded(getattr(value, one.name), codec) for one in fields(value)}}
    raise TypeError(f"expected something that can be saved, given {type(value).__name__}")


_ENTRIES: Mapping[str, tuple[type, type]] = {
    "f": (float, np.float64),
    "i": (int, np.int64),
    "b": (bool, np.bool_),
    "U": (str, np.str_),
}
"""Type of the entries and their dtype, by the kind of an array's dtype. Texts have the room that they need."""


@dataclass(frozen=True)
class _Decoder:
    """Decodes what `encoded` has written, of these kinds; messages name the place of what is wrong."""

    kinds: Mapping[str, type]
    codec: Mapping[str, Callable[[Any], Any]]

    def decoded(self, data: Any, place: str) -> Any:
        if isinstance(data, list):
            return tuple(self.decoded(one, f"{place}[{k}]") for k, one in enumerate(data))
        if not isinstance(data, dict):
            return data
        if set(data) == {"array", "shape", "dtype"}:
            with entry(place):
                return self._array(data["array"], data["shape"], data["dtype"])
        if len(data) != 1:
            raise ValueError(f"{place}: expected an entry of one kind, given {shown(list(data))}")
        ((name, content),) = data.items()
        if name == "float":
            return _not_finite(content, place)
        if name == "mapping":
            return self._mapping(content, place)
        if name in self.codec:
            with entry(place):
                return self.codec[name](content)
        return self._of_kind(name, content, place)

    def _array(self, entries: Any, shape: Any, dtype: Any) -> Any:
        kind = dtype.lstrip("<|")[:1] if isinstance(dtype, str) else ""
        if kind not in _ENTRIES:
            raise ValueError(f"expected an array of {', '.join(_ENTRIES)}, given {shown(dtype)}")
        of_each, scalar = _ENTRIES[kind]
        values = [self.decoded(one, "array") for one in entries]
        for value in values:
            if type(value) is not of_each:
                raise ValueError(f"expected an array of {of_each.__name__}, given {shown(value)}")
        return np.array(values, dtype=scalar if kind == "U" else np.dtype(scalar)).reshape(shape)

    def _mapping(self, pairs: Any, place: str) -> FrozenMapping[Any]:
        found = {}
        for pair in pairs if isinstance(pairs, list) else [pairs]:
            if not isinstance(pair, list) or len(pair) != 2 or not isinstance(pair[0], str):
                raise ValueError(f"{place}: expected pairs of a name and a value, given {shown(pair)}")
            found[pair[0]] = self.decoded(pair[1], f"{place}[{shown(pair[0])}]")
        return FrozenMapping(found)

    def _of_kind(self, name: str, content: Any, place: str) -> Any:
        if issubclass(self.kinds.get(name, object), Enum):
            with entry(place):
                return self.kinds[name](content)
        if name not in self.kinds or not isinstance(content, dict):
            raise ValueError(f"{place}: expected one of {', '.join([*self.kinds, *self.codec])}, given {shown(name)}")
        kind = self.kinds[name]
        gone: tuple[str, ...] = getattr(kind, "_GONE", ())
        inside = f"{place}." if place else ""
        values = {key: self.decoded(one, f"{inside}{key}") for key, one in content.items() if key not in gone}
        required, known = _names(kind)
        for missing in (one for one in required if one not in values):
            raise ValueError(f"{inside}{missing}: expected an entry, given none")
        for unknown in (one for one in values if one not in known):
            raise ValueError(f"{place or name}: expected entries {listed(known)}; given unknown {shown(unknown)}")
        with entry(place or name):
            return kind(**values)


def _names(kind: type) -> tuple[list[str], list[str]]:
    """Names of the fields that a file must have, those without a default, and of all."""
    if not is_dataclass(kind):
        return [name for name in kind._fields if name not in kind._field_defaults], list(kind._fields)  # type: ignore[attr-defined]
    own = [one for one in fields(kind) if one.init]
    names = [one.name for one in own]
    if getattr(kind, "_COMPLETE", False):  # a default would stand for what was lost
        return names, names
    return [one.name for one in own if one.default is MISSING and one.default_factory is MISSING], names


def _not_finite(content: Any, place: str) -> float:
    if content not in ("nan", "inf", "-inf"):
        raise ValueError(f"{place}: expected 'nan', 'inf' or '-inf', given {shown(content)}")
    return float(content)
