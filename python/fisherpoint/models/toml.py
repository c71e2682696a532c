"""A model as the tables of a TOML file, and back."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import TYPE_CHECKING

from ..messages import listed, shortened, shown
from ..quantity import Quantity, names_of
from .base import Model
from .hydraulic_cylinder import HydraulicCylinder
from .symbolic import SymbolicModel

if TYPE_CHECKING:
    from ..config_tables import ModelTable


def model_to_toml(model: Model) -> str:
    """The model as the table [model]; equations stand in it as they were given."""
    lines = ["[model]", f"name = {_string(model.name)}"]
    constants = [(q.name, _entry(q, value=model.constants[q.name])) for q in model.constant_quantities]
    if not isinstance(model, SymbolicModel):
        if isinstance(model, HydraulicCylinder) and model.smooth:
            lines.append(f"smooth = {{ {', '.join(f'{name} = {width!r}' for name, width in model.smooth.items())} }}")
        return "\n".join([*lines, *_table("constants", constants), ""])
    f, g, domain = model.texts
    if domain:
        lines.append(f"domain = [{', '.join(map(_string, domain))}]")
    for kind in ("states", "inputs", "parameters"):
        lines += _table(kind, [(q.name, _entry(q, nominal=model.nominal.get(q.name))) for q in getattr(model, kind)])
    lines += _table("constants", constants)
    states = names_of(model.states)
    own = {q.name: text for q, text in zip(model.outputs, g, strict=True) if q.name in states and text != q.name}
    lines += _table("outputs", [(q.name, _entry(q, equation=own.get(q.name))) for q in model.outputs])
    equations = [*zip(states, f, strict=True)]
    equations += [(q.name, text) for q, text in zip(model.outputs, g, strict=True) if q.name not in states]
    return "\n".join([*lines, *_table("equations", [(name, _string(text)) for name, text in equations]), ""])


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


def model_of_table(table: ModelTable) -> SymbolicModel:
    """The model of a table [model] with equations.

    Raises
    ------
    ValueError
        One line that names the key below [model].
    """
    described = {
        kind: {name: Quantity(name, entry.unit, entry.description, entry.scale) for name, entry in entries.items()}
        for kind, entries in table.quantities.items()
    }
    constants = {
        name: (entry.value, Quantity(name, entry.unit or "1", entry.description)) for name, entry in table.constants.items()
    }
    nominal = {name: entry.nominal for name, entry in table.parameters.items() if entry.nominal is not None}
    f, g = _equations(table)
    return SymbolicModel(f, g, **described, constants=constants, domain=table.domain, name=table.name, nominal=nominal)


def _equations(table: ModelTable) -> tuple[list[str], list[str]]:
    equations, states, outputs = table.equations or {}, table.states, table.outputs
    expected = list(dict.fromkeys([*states, *outputs]))
    for name in equations:
        if name not in expected:
            raise ValueError(
                f"equations.{shortened(name)}: expected an equation for each of {listed(expected)}; given one for {shown(name)}"
            )
    for name in expected:
        if name not in equations and (name in states or name not in table.inputs):
            what = f"the rate of {name}" if name in states else name
            raise ValueError(f"equations.{name}: expected {what} as a text, given none")
    for name, output in outputs.items():
        if output.equation is not None and name not in states:
            raise ValueError(f"outputs.{name}.equation: expected only for an output with the name of a state, given {shown(name)}")
    # Without an equation, an output with the name of a state or an input is that.
    g = [entry.equation or (name if name in states else equations.get(name, name)) for name, entry in outputs.items()]
    return [equations[name] for name in states], g
