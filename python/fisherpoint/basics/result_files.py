"""Results as JSON files with a checksum: one codec for all that is built of dataclasses, numbers, texts, arrays and mappings.

A file has of an object the arguments that make it, under the name of its class. A dataclass has its fields. Another class says by
`_arguments` what its constructor takes, and by `_made`, where it has that, how else it is made. Which classes may be in a file
follows from the annotations of these, beginning with the class that is read. Types with a form of their own stand in `_CODEC`.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar, Self, get_args, get_type_hints

import numpy as np

from .checks import as_path
from .field_checks import check_declared, check_type_of, types_of
from .files import built_from, entry, parse_json, read_bytes, sealed_json, write_whole
from .messages import listed, shown
from .values import FrozenMapping

FORMAT_VERSION = 1
"""Version of the form of all files."""

Codec = Mapping[type, tuple[Callable[[Any], Any], Callable[[Any], Any]]]
"""For types with a form of their own in JSON: how they are written, and read."""


class Kept:
    """A dataclass that is kept in a file; `load` gives it back to the last bit."""

    _CODEC: ClassVar[Codec] = {}

    def save(self, path: str | Path) -> None:
        """Write a JSON file with a checksum, whole or not at all."""
        path, text = as_path(path, "path"), self._file()
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, text)

    def _file(self, **head: Any) -> str:
        """The text of the file, with further entries at its head for people."""
        return sealed(type(self), encoded(self), **head)

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
        return cls._read(path, read_bytes(path))

    @classmethod
    def _read(cls, path: Path, given: bytes) -> Self:
        """What `_file` says of a result; `path` names the file in messages."""
        return built_from(path, cls.__name__, content_of(path, given, cls), cls._from_content)

    @classmethod
    def _from_content(cls, content: Any) -> Self:
        found = decoded(content, cls)
        if not isinstance(found, cls):
            raise ValueError(f"expected a {cls.__name__}, given {shown(found)}")
        check_declared(found)
        return found


def sealed(kind: type, content: Any, **head: Any) -> str:
    """The text of a file that has the content of an object of this class."""
    return sealed_json({"format": _format(kind), "format_version": FORMAT_VERSION, **head, "content": content})


def content_of(path: Path, given: bytes, kind: type) -> Any:
    """The content of a file that `sealed` wrote for this class.

    Raises
    ------
    ValueError
        Where it is truncated, was changed, or is of another format.
    """
    data = parse_json(path, given, _format(kind), FORMAT_VERSION)
    return built_from(path, kind.__name__, data, lambda whole: whole["content"])


def _format(kind: type) -> str:
    return f"fisherpoint {kind.__name__}"


# --- Classes that may be in a file ---------------------------------------------------------------------------------------


@lru_cache(maxsize=256)
def _known(root: type) -> tuple[Mapping[str, type], Codec]:
    """The classes that may be in an object of a class, by name, and the types with a form of their own."""
    kinds, codec, waiting = dict[str, type](), dict[type, Any](), list[Any]([root])
    while waiting:
        hint = waiting.pop()
        waiting += get_args(hint)
        if isinstance(hint, type) and hint.__name__ not in kinds and _is_kept(hint):
            kinds[hint.__name__] = hint
            codec |= getattr(hint, "_CODEC", {})
            waiting += [*_arguments_of(hint).values(), *hint.__subclasses__()]
    return kinds, codec


def _is_kept(kind: type) -> bool:
    return is_dataclass(kind) or hasattr(kind, "_fields") or hasattr(kind, "_arguments") or issubclass(kind, Enum)


def _arguments_of(kind: type) -> Mapping[str, Any]:
    """The types of what a file has of an object, by name."""
    if issubclass(kind, Enum):
        return {}
    if not hasattr(kind, "_arguments"):
        return types_of(kind)
    hints = get_type_hints(kind.__init__)
    return {name: hints[name] for name in inspect.signature(kind).parameters}


# --- Writing -------------------------------------------------------------------------------------------------------------


def encoded(value: Any) -> Any:
    """What JSON has of an object; a TypeError for what no file can hold."""
    kind: type = type(value)
    return _encoded(value, _known(kind)[1])


def _encoded(value: Any, codec: Codec) -> Any:
    if isinstance(value, Enum):
        return {type(value).__name__: value.name}
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
        dtype = "U" if value.dtype.kind == "U" else value.dtype.str  # texts have the room that they need when they are read
        return {"array": entries, "shape": value.shape, "dtype": dtype}
    if isinstance(value, Mapping):
        return {"mapping": [[_encoded(entry, codec) for entry in pair] for pair in value.items()]}
    if type(value) in (tuple, list):
        return [_encoded(entry, codec) for entry in value]
    if hasattr(value, "_arguments"):
        arguments = value._arguments()
    elif _is_kept(type(value)):
        arguments = {name: getattr(value, name) for name in types_of(type(value))}
    else:
        raise TypeError(f"expected something that can be saved, given {type(value).__name__}")
    return {type(value).__name__: {name: _encoded(entry, codec) for name, entry in arguments.items()}}


# --- Reading -------------------------------------------------------------------------------------------------------------


def decoded(data: Any, kind: type, place: str = "") -> Any:
    """What `encoded` wrote of an object of a class, or of what may be in one; `place` names it in messages."""
    kinds, codec = _known(kind)
    readers = {one.__name__: decode for one, (_, decode) in codec.items()}
    return _Decoder(kinds, readers).decoded(data, place)


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
        kind = self.kinds.get(name)
        if kind is not None and issubclass(kind, Enum):
            with entry(place):
                return kind(content)
        if kind is None or not isinstance(content, dict):
            raise ValueError(f"{place}: expected one of {', '.join([*self.kinds, *self.codec])}, given {shown(name)}")
        inside = f"{place}." if place else ""
        values = {key: self.decoded(one, f"{inside}{key}") for key, one in content.items()}
        known = list(_arguments_of(kind))
        for missing in (one for one in known if one not in values):  # a default would stand for what was lost
            raise ValueError(f"{inside}{missing}: expected an entry, given none")
        for unknown in (one for one in values if one not in known):
            raise ValueError(f"{place or name}: expected entries {listed(known)}; given unknown {shown(unknown)}")
        with entry(place or name):
            return _built(kind, values, inside)


def _built(kind: type, values: dict[str, Any], inside: str) -> Any:
    """The object; fields that a constructor would derive are as they were, as a later version may derive them in another way."""
    derived = [one.name for one in fields(kind) if not one.init] if is_dataclass(kind) else []
    kept = {name: values.pop(name) for name in derived}
    made = getattr(kind, "_made", kind)(**values)
    for name, value in kept.items():
        check_type_of(value, types_of(kind)[name], f"{inside}{name}")
        object.__setattr__(made, name, value)
    return made


def _not_finite(content: Any, place: str) -> float:
    if content not in ("nan", "inf", "-inf"):
        raise ValueError(f"{place}: expected 'nan', 'inf' or '-inf', given {shown(content)}")
    return float(content)
