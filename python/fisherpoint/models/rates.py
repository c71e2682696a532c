"""The rates of a model's states at the start, as outputs of a model without states: at rest they are zero."""

from __future__ import annotations

from collections.abc import Sequence

import sympy

from ..basics.checks import check_known
from ..basics.quantity import names_of
from .base import Model
from .expressions import symbol
from .surfaces.printing import to_text
from .symbolic import SymbolicModel
from .tape.defined import value_of
from .tape.parts import replaced


def rates_of(given: Model, names: Sequence[str], outputs: Sequence[str], unknown: Sequence[str]) -> SymbolicModel:
    """Return the rates of these states at the start, and then these outputs, as outputs of a model without states.

    Its last parameters are the states and inputs that are `unknown`; the other inputs and states are its inputs, in this order.

    Raises
    ------
    TypeError, ValueError
        Where the model has no equations, or rates that cannot vanish.
    """
    model = given.symbolic()
    assert isinstance(model, SymbolicModel)
    check_known(names, names_of(model.states), "states", "names of states,")
    if model.latches:
        raise ValueError(f"model: expected one without latch(), on whose memory its rates depend, given {model.name}")
    start = {} if model.clock is None else {model.clock: sympy.S.Zero}
    by_name = zip(names_of(model.states), model.equations.rates, strict=True)
    rates = [(name, replaced(rate, start)) for name, rate in by_name if name in names]
    further = [replaced(one, start) for q, one in zip(model.outputs, model.equations.output, strict=True) if q.name in outputs]
    values = {symbol(name) for name in model.constants}
    for name, rate in rates:
        if not value_of(rate).free_symbols - values:
            raise ValueError(f"states: expected states whose rates may vanish, given {name!r} with {to_text(rate):.60}")
    inputs = [q for q in (*model.inputs, *model.states) if q.name not in unknown]
    # A model has an input, if need be one that nothing reads.
    taken = {q.name for of in (model.states, model.inputs, model.parameters, model.constant_quantities) for q in of}
    unread = next(name for name in ("none", *(f"none_{i}" for i in range(len(taken) + 1))) if name not in taken)
    return SymbolicModel(
        [],
        [*(rate for _, rate in rates), *further],
        {},
        inputs or {unread: "1"},
        (*model.parameters, *(q for q in (*model.states, *model.inputs) if q.name in unknown)),
        constants={q.name: (model.constants[q.name], q) for q in model.constant_quantities},
        name=model.name,
        check_units=False,
    )
