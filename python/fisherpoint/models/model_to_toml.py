"""From a model to the table [model] of a TOML file."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from ..basics.quantity import Quantity, names_of
from .base import Model


class Texts(NamedTuple):
    """Equations of a model as text: each reset as its condition, or its times, with what states are set to."""

    rates: tuple[str, ...]
    output: tuple[str, ...]
    domain: tuple[str, ...]
    resets: tuple[tuple[str, Mapping[str, str]], ...]
    definitions: Mapping[str, str]


def cylinder_toml(model: Model, smooth: Mapping[str, float]) -> str:
    """The built-in cylinder as the table [model], with its widths of transitions."""
    lines = _head(model)
    if smooth:
        lines.append(f"smooth = {{ {', '.join(f'{name} = {width!r}' for name, width in smooth.items())} }}")
    return "\n".join([*lines, *_constants(model), ""])


def equations_toml(model: Model, texts: Texts, domain: Sequence[str]) -> str:
    """A model as the table [model], with all conditions of its domain; its equations stand in it as they were given."""
    lines = _head(model)
    if domain:
        lines.append(f"domain = [{', '.join(map(_string, domain))}]")
    for kind in ("states", "inputs", "parameters"):
        lines += _table(kind, [(q.name, _entry(q, nominal=model.nominal.get(q.name))) for q in getattr(model, kind)])
    lines += _constants(model)
    states, g = names_of(model.states), texts.output
    own = {q.name: text for q, text in zip(model.outputs, g, strict=True) if q.name in states and text != q.name}
    lines += _table("outputs", [(q.name, _entry(q, equation=own.get(q.name))) for q in model.outputs])
    lines += _table("definitions", [(name, _string(text)) for name, text in texts.definitions.items()])
    equations = [*zip(states, texts.rates, strict=True)]
    equations += [(q.name, text) for q, text in zip(model.outputs, g, strict=True) if q.name not in states]
    lines += _table("equations", [(name, _string(text)) for name, text in equations])
    if texts.resets:
        lines += ["", "[model.resets]"]
        lines += [
            f"{_string(when)} = {{ {', '.join(f'{x} = {_string(text)}' for x, text in of.items())} }}" for when, of in texts.resets
        ]
    return "\n".join([*lines, ""])


def _head(model: Model) -> list[str]:
    return ["[model]", f"name = {_string(model.name)}"]


def _constants(model: Model) -> Iterator[str]:
    return _table("constants", [(q.name, _entry(q, value=model.constants[q.name])) for q in model.constant_quantities])


def _table(name: str, entries: list[tuple[str, str]]) -> Iterator[str]:
    if entries:
        yield from ("", f"[model.{name}]")
        yield from (f"{key if key.isascii() else _string(key)} = {entry}" for key, entry in entries)


def _entry(quantity: Quantity, **others: float | str | None) -> str:
    given = {"unit": quantity.unit, "scale": quantity.scale, "description": quantity.description or None}
    numbers = {key: value for key, value in others.items() if not isinstance(value, str)}
    given = numbers | given | others
    known = {key: value for key, value in given.items() if value is not None}
    if list(known) == ["unit"]:
        return _string(quantity.unit)
    return f"{{ {', '.join(f'{key} = {_string(v) if isinstance(v, str) else repr(float(v))}' for key, v in known.items())} }}"


def _string(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
