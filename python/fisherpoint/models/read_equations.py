"""The equations of a model, from what a user gives to what follows from it: as they are written, and with nothing but symbols."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Set
from dataclasses import replace
from typing import Any, NamedTuple, TypedDict

import sympy

from ..basics.messages import shown
from ..basics.quantity import Quantity, names_of
from .base import Model
from .clock import clock_names
from .definitions import WrittenOut, read_definitions
from .delays import Delays, without_delays
from .expressions import symbol
from .given_equations import check_count, condition_of, equation_of, limits_of, listed_equations
from .quantities import DescribedModel
from .set_anew import check_moving, pairs_of, states_set_anew
from .surfaces.domain import MOST
from .surfaces.memory import has_latch
from .surfaces.printing import to_text
from .surfaces.structure import Equations
from .tape.defined import value_of
from .tape.parts import symbols_of
from .written import WrittenEquations


class FurtherEquations(TypedDict, total=False):
    """What a model may have beside f and g: see `SymbolicModel`."""

    domain: Iterable[Any]
    resets: Mapping[Any, Mapping[str, Any]] | Iterable[tuple[Any, Mapping[str, Any]]]
    definitions: Mapping[str, Any] | None


class GivenEquations(NamedTuple):
    """Equations as a user has given them, in lists."""

    f: list[Any]
    g: list[Any]
    domain: list[Any]
    resets: Any
    definitions: Any


class ReadEquations(NamedTuple):
    """Equations as they are written and written out, the dead times of inputs, and the time where it is read."""

    written: WrittenEquations
    written_out: WrittenOut
    equations: Equations
    delays: Delays
    clock: Any


def given_equations(f: Any, g: Any, *, domain: Any = (), resets: Any = (), definitions: Any = None) -> GivenEquations:
    """Equations in lists."""
    lists = [listed_equations(of, name) for of, name in ((f, "f"), (g, "g"), (domain, "domain"))]
    return GivenEquations(lists[0], lists[1], lists[2], resets, definitions)


def read_equations(model: DescribedModel, given: GivenEquations) -> ReadEquations:
    """The equations of a model whose quantities, `along` and `offsets` are there.

    Raises
    ------
    ValueError
        For a mistake: one line that names the equation.
    """
    check_count(given.f, "f", model.states)
    check_count(given.g, "g", model.outputs)
    for place, many in (("domain", given.domain), ("along", model.along)):
        if len(many) > MOST:
            raise ValueError(f"{place}: expected at most {MOST} conditions, given {len(many)}")
    symbols: dict[str, Any] = {q.name: symbol(q.name) for quantities in model._quantities() for q in quantities}
    times = clock_names(symbols) if model.states else []
    clocks = {name: symbol(times[0]) for name in times}
    resets = pairs_of(given.resets, names_of(model.states))
    everything = [*given.f, *given.g, *given.domain, *(one for when, new in resets for one in (when, *new.values()))]
    definitions = read_definitions(given.definitions, everything, symbols, clocks)
    places = [f"equations.{q.name}" for q in model.states], [place_of(model, q) for q in model.outputs]
    rates, output = (
        tuple(equation_of(e, symbols, place, clocks) for e, place in zip(of, at, strict=True))
        for of, at in zip((given.f, given.g), places, strict=True)
    )
    conditions = tuple(condition_of(e, symbols, f"domain[{i}]", clocks) for i, e in enumerate(given.domain))
    anew = states_set_anew(resets, names_of(model.states), symbols, clocks)
    written = WrittenEquations(definitions, rates, output, conditions, anew.given)
    written_out = WrittenOut(symbols[name] for name in definitions)
    of: dict[str, Any] = {kind: tuple(symbols[q.name] for q in getattr(model, kind)) for kind in ("states", "inputs", "parameters")}
    equations = Equations(
        tuple(one.expression for one in rates),
        tuple(one.expression for one in output),
        tuple(one.expression for one in conditions),
        **of,
        constants={symbols[name]: value for name, value in model.constants.items()},
        resets=anew.resets,
        updates=anew.updates,
    ).changed(written_out, *places)
    moving = {*of["states"], *of["inputs"]}
    values = {name: written_out(one, name) for name, one in symbols.items()}
    equations = replace(equations, along=limits_of(model.along, values, model.offsets, moving))
    _check(model, equations, written, moving.union(clocks.values()))
    delays, plain = without_delays(equations, *places, clocks)
    read = symbols_of(*plain.rates, *plain.output, *plain.conditions, *plain.values_anew())
    return ReadEquations(written, written_out, plain, delays, next((clock for clock in clocks.values() if clock in read), None))


def place_of(model: Model, output: Quantity) -> str:
    """The place of an output's equation, for messages."""
    return f"{'outputs' if output.name in names_of(model.states) else 'equations'}.{output.name}"


def _check(model: Model, equations: Equations, written: WrittenEquations, moving: Set[Any]) -> None:
    """Raise where an output depends on nothing, a condition of a reset does not move, or a latch stands where none may."""
    constants = set(equations.constants)
    outputs = [(place_of(model, quantity), one) for quantity, one in zip(model.outputs, equations.output, strict=True)]
    for place, expression in outputs:
        if not symbols_of(value_of(expression)) - constants:
            raise ValueError(f"{place}: expected an output that depends on something, given {to_text(expression):.60}")
    check_moving(equations.resets, written.resets, moving)
    for place, expression in (*outputs, ("domain", sympy.Tuple(*equations.conditions))):
        if has_latch(expression):
            raise ValueError(f"{place}: expected no latch(), which rates and resets alone read: set a state of your own by resets")
    for update in equations.updates:
        for x, value in update.values:
            if has_latch(value):
                raise ValueError(f"resets.{shown(update.times.text)}.{x.name}: expected no latch() at known times")
