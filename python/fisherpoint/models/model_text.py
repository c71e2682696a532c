"""A model for its reader: equations, units, surfaces and domain as plain text and as LaTeX."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import sympy

from ..basics.messages import printable
from ..basics.quantity import Quantity
from .base import Model
from .surfaces.structure import Equations
from .tape.update import at_known_times


def model_text(
    model: Model,
    rates: Sequence[str],
    output: Sequence[str],
    resets: Sequence[tuple[str, Mapping[str, str]]] = (),
) -> str:
    """The model as text, for `print`, with its equations as they were given."""
    lines = [model.name]
    for kind in ("states", "inputs", "parameters", "outputs"):
        lines += _table(kind, ((q, model.nominal.get(q.name)) for q in getattr(model, kind)))
    lines += _table("constants", ((q, model.constants[q.name]) for q in model.constant_quantities))
    lines += ["", *_equations(model, rates, output), *_resets(resets), ""]
    limits = [f"{name} other than 0" for name in model.poles] + [f"{name} > 0" for name in model.domain[len(model.poles) :]]
    facts = {"jumps": [f"{name} = 0" for name in model.jumps], "kinks": [f"{name} = 0" for name in model.kinks], "domain": limits}
    facts["blocks"] = [f"{{{', '.join(block)}}}" for block in model.blocks]
    if model.idle:
        facts["idle"] = list(model.idle)
    lines += [f"{kind:<12}{', '.join(facts[kind]) or 'none'}" for kind in facts]
    return "\n".join(lines)


def _table(kind: str, rows: Iterable[tuple[Quantity, float | None]]) -> Iterator[str]:
    for i, (quantity, value) in enumerate(rows):
        number = "" if value is None else f" = {value:g}"
        size = "" if quantity.scale in (None, 1.0) else f", natural size {quantity.scale:g}"
        description = f": {printable(' '.join(quantity.description.split()))}" if quantity.description else ""
        yield f"{kind if i == 0 else '':<12}{quantity.name}{number} [{quantity.unit}]{size}{description}"


def _equations(model: Model, rates: Sequence[str], output: Sequence[str]) -> Iterator[str]:
    f, g = ([printable(" ".join(text.split())) for text in texts] for texts in (rates, output))
    for quantity, text in zip(model.states, f, strict=True):
        yield f"d{quantity.name}/dt = {text}"
    for quantity, text in zip(model.outputs, g, strict=True):
        if text != quantity.name:  # else an output that is a state or an input
            yield f"{quantity.name} = {text}"


def _resets(resets: Sequence[tuple[str, Mapping[str, str]]]) -> Iterator[str]:
    for when, values in resets:
        assignments = ", ".join(f"{x} = {printable(' '.join(text.split()))}" for x, text in values.items())
        yield f"{'' if at_known_times(when) else 'when '}{printable(' '.join(when.split()))}: {assignments}"


def latex(equations: Equations, outputs: Iterable[str]) -> str:
    """The equations in LaTeX, for a notebook."""

    def written(expression: Any) -> str:
        return str(sympy.latex(expression))

    rows = [rf"\dot{{{written(x)}}} &= {written(f)}" for x, f in zip(equations.states, equations.rates, strict=True)]
    names = map(sympy.Symbol, outputs)
    rows += [f"{written(y)} &= {written(g)}" for y, g in zip(names, equations.output, strict=True)]
    return r"$\displaystyle \begin{aligned}" + r" \\ ".join(rows) + r"\end{aligned}$"
