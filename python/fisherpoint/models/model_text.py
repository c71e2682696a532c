"""A model for its reader: equations, units, surfaces and domain as plain text and as LaTeX."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

import sympy

from ..basics.messages import printable
from ..basics.quantity import Quantity
from .base import Model
from .blocks import block_lines
from .expressions import symbol
from .given_equations import Written
from .model_to_toml import Texts
from .tape.update import at_known_times
from .written import WrittenEquations

LINES, WIDTH = 60, 160
"""The most lines of a model that is printed, and the most characters of each; a model that is larger is shortened."""


def model_text(model: Model, texts: Texts) -> str:
    """The model as text, for `print`, with its equations as they were given."""
    sections = [list(_table(k, ((q, model.nominal.get(q.name)) for q in getattr(model, k)))) for k in _KINDS]
    sections.append(list(_table("constants", ((q, model.constants[q.name]) for q in model.constant_quantities))))
    definitions = [f"{name} = {_plain(text)}" for name, text in texts.definitions.items()]
    sections += [["", *definitions] if definitions else [], ["", *_equations(model, texts), *_resets(texts.resets)]]
    limits = [f"{name} other than 0" for name in model.poles] + [f"{name} > 0" for name in model.domain[len(model.poles) :]]
    facts = {"jumps": [f"{name} = 0" for name in model.jumps], "kinks": [f"{name} = 0" for name in model.kinks], "domain": limits}
    lines = {kind: [", ".join(names)] for kind, names in facts.items()} | {"blocks": block_lines(model.blocks)}
    if model.idle:
        lines["idle"] = [", ".join(model.idle)]
    sections.append(
        ["", *(f"{kind if i == 0 else '':<12}{line or 'none'}" for kind in lines for i, line in enumerate(lines[kind]))]
    )
    if sum(map(len, sections)) >= LINES:
        sections = _shortened(sections)
    return "\n".join([model.name, *(line for section in sections for line in section)])


_KINDS = "states", "inputs", "parameters", "outputs"


def _shortened(sections: Sequence[Sequence[str]]) -> list[list[str]]:
    """The first lines of each section, as many as fit on a page, and how many more there are."""
    most = max(map(len, sections))
    while sum(min(len(section), most) for section in sections) > LINES - 2:
        most -= 1
    kept = []
    for section in sections:
        cut = len(section) > most
        lines = [line if len(line) <= WIDTH else f"{line[: WIDTH - 4]} ..." for line in section[: most - cut]]
        kept.append([*lines, f"{'' if section[0] == '' else ' ' * 12}... and {len(section) - most + 1} more"] if cut else lines)
    return [*kept, ["all of it: print(model.to_toml())"]]


def _table(kind: str, rows: Iterable[tuple[Quantity, float | None]]) -> Iterator[str]:
    for i, (quantity, value) in enumerate(rows):
        number = "" if value is None else f" = {value:g}"
        size = "" if quantity.scale in (None, 1.0) else f", natural size {quantity.scale:g}"
        description = f": {_plain(quantity.description)}" if quantity.description else ""
        yield f"{kind if i == 0 else '':<12}{quantity.name}{number} [{quantity.unit}]{size}{description}"


def _plain(text: str) -> str:
    return printable(" ".join(text.split()))


def _equations(model: Model, texts: Texts) -> Iterator[str]:
    for quantity, text in zip(model.states, texts.rates, strict=True):
        yield f"d{quantity.name}/dt = {_plain(text)}"
    for quantity, text in zip(model.outputs, texts.output, strict=True):
        if _plain(text) != quantity.name:  # else an output that is a state or an input
            yield f"{quantity.name} = {_plain(text)}"


def _resets(resets: Sequence[tuple[str, Mapping[str, str]]]) -> Iterator[str]:
    for when, values in resets:
        assignments = ", ".join(f"{x} = {_plain(text)}" for x, text in values.items())
        yield f"{'' if at_known_times(when) else 'when '}{_plain(when)}: {assignments}"


def latex(written: WrittenEquations, states: Iterable[str], outputs: Iterable[str]) -> str:
    """The equations in LaTeX, for a notebook."""

    def lines(names: Iterable[str], of: Iterable[Written], left: str = "{}") -> list[str]:
        symbols = (left.replace("{}", str(sympy.latex(symbol(name)))) for name in names)
        return [f"{name} &= {sympy.latex(one.expression)}" for name, one in zip(symbols, of, strict=True)]

    rows = lines(written.definitions, written.definitions.values())
    rows += lines(states, written.rates, r"\dot{{}}") + lines(outputs, written.output)
    return r"$\displaystyle \begin{aligned}" + r" \\ ".join(rows) + r"\end{aligned}$"
