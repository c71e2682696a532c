"""Dead times of inputs, and delays of outputs: what `delay(u, tau)` in equations says, and the equations without it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import sympy

from ..basics.messages import listed, shown
from .surfaces.structure import Equations
from .tape.delay import delay_in
from .tape.parts import replaced, symbols_of

Delays = dict[str, str | float]


def without_delays(
    equations: Equations, rates: Sequence[str], outputs: Sequence[str], clocks: Mapping[str, Any]
) -> tuple[Delays, Equations]:
    """The dead times of inputs in equations, by name or in s, and the equations in which inputs and states stand by themselves.

    `rates` and `outputs` are their places. Outputs of states with a delay are `Equations.late`.

    Raises
    ------
    ValueError
        For what cannot be delayed, or by which time; for an input with two dead times, or with one in some places only.
    """
    output, late = _without_late(equations, outputs, clocks)
    equations = replace(equations, output=output, late=late)
    further = [("domain", e) for e in equations.conditions] + [("along", e) for _, e in equations.along]
    further += [("resets", e) for e in equations.values_anew()]
    places = *rates, *outputs
    named = [*zip(places, (*equations.rates, *equations.output), strict=True), *further]
    delays, plain = Delays(), dict[str, str]()
    inputs = {symbol.name: symbol for symbol in equations.inputs}
    own: dict[Any, Any] = {}
    for place, expression in named:
        for symbol in sorted(symbols_of(expression), key=str):
            if symbol.name in inputs:
                plain[symbol.name] = place
            if (found := delay_in(symbol)) is None:
                continue
            name, time = found
            if name in (*clocks, *(state.name for state in equations.states)):
                what = f"the time {name}" if name in clocks else f"the state {name}"
                raise ValueError(f"{place}: expected an input in delay(), given {what}: states are delayed in outputs alone")
            _check(equations, place, name, time)
            own[symbol] = inputs[name]
            if delays.setdefault(name, time) != time:
                raise ValueError(
                    f"{place}: expected one dead time of {name}, given {delays[name]} and {time}: declare a second input with the"
                    " same values"
                )
    for name in delays:
        if name in plain:
            raise ValueError(
                f"{plain[name]}: expected delay({name}, {delays[name]}) wherever {name} stands, given {name} alone: declare a"
                " second input with the same values"
            )
    if not delays:
        return delays, equations
    parameters = {symbol.name: symbol for symbol in equations.parameters}
    plain_equations = equations.changed(lambda expression, _: replaced(expression, own))
    late_inputs = tuple((inputs[u], parameters[str(tau)]) for u, tau in delays.items() if tau in parameters)
    return delays, replace(plain_equations, delays=late_inputs)


def _without_late(equations: Equations, places: Sequence[str], clocks: Mapping[str, Any]) -> tuple[tuple[Any, ...], dict[int, Any]]:
    """Outputs in which states stand by themselves, and the delays of those that are late."""
    moving = {symbol.name: symbol for symbol in equations.states} | dict(clocks)
    known = {symbol.name: symbol for symbol in (*equations.parameters, *equations.constants)}
    output, late = list(equations.output), dict[int, Any]()
    for i, (place, expression) in enumerate(zip(places, equations.output, strict=True)):
        symbols = sorted(symbols_of(expression), key=str)
        found = {symbol: pair for symbol in symbols if (pair := delay_in(symbol)) and pair[0] in moving}
        if not found:
            continue
        for name, time in found.values():
            _check_time(equations, place, name, time)
        times = list(dict.fromkeys(time for _, time in found.values()))
        if len(times) > 1:
            raise ValueError(f"{place}: expected one delay of all states of an output, given {times[0]} and {times[1]}")
        for symbol in symbols:
            name, pair = symbol.name, delay_in(symbol)
            if symbol in moving.values():
                raise ValueError(f"{place}: expected delay({name}, {times[0]}) in an output that is late, given {name} alone")
            if symbol in equations.inputs or (pair and pair[0] not in moving):
                raise ValueError(f"{place}: expected no input in an output that is late, given {pair[0] if pair else name}")
        output[i] = replaced(expression, {symbol: moving[name] for symbol, (name, _) in found.items()})
        late[i] = known[times[0]] if isinstance(times[0], str) else sympy.Float(times[0])
    return tuple(output), late


def _check(equations: Equations, place: str, name: str, time: str | float) -> None:
    inputs = [symbol.name for symbol in equations.inputs]
    if name not in inputs:
        raise ValueError(f"{place}: expected an input in delay(), {listed(inputs)}; given {shown(name)}")
    if not equations.states:
        raise ValueError(f"{place}: expected no delay() in a model without states, given one of {name}")
    _check_time(equations, place, name, time)


def _check_time(equations: Equations, place: str, name: str, time: str | float) -> None:
    constants = {symbol.name: value for symbol, value in equations.constants.items()}
    if isinstance(time, str) and time not in (*constants, *(symbol.name for symbol in equations.parameters)):
        raise ValueError(f"{place}: expected a parameter, a known constant or a number as dead time of {name}, given {shown(time)}")
    value = constants.get(time, 0.0) if isinstance(time, str) else time
    if not 0 <= value < float("inf"):
        raise ValueError(f"{place}: expected a dead time of {name} of at least 0 s, given {value:g}")
