"""Dead times of inputs: what `delay(u, tau)` in equations says, and the equations with the inputs themselves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..basics.messages import listed, shown
from .surfaces.structure import Equations
from .tape.delay import delay_in, delayed
from .tape.parts import replaced, symbols_of

Delays = dict[str, str | float]


def without_delays(equations: Equations, places: Sequence[str]) -> tuple[Delays, Equations]:
    """The dead times of inputs in equations, by name or in s, and the equations in which these inputs stand by themselves.

    `places` are those of rates and outputs.

    Raises
    ------
    ValueError
        For what cannot be delayed, or by which time; for an input with two dead times, or with one in some places only.
    """
    resets = [e for reset in equations.resets for e in (reset.condition, *(value for _, value in reset.values))]
    further = [("domain", e) for e in equations.conditions] + [("along", e) for _, e in equations.along]
    further += [("resets", value) for update in equations.updates for _, value in update.values]
    named = [*zip(places, (*equations.rates, *equations.output), strict=True), *further, *(("resets", e) for e in resets)]
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
    return delays, replace(
        equations,
        rates=tuple(replaced(e, own) for e in equations.rates),
        output=tuple(replaced(e, own) for e in equations.output),
        conditions=tuple(replaced(e, own) for e in equations.conditions),
        along=tuple((text, replaced(e, own)) for text, e in equations.along),
        resets=tuple(
            replace(
                reset,
                condition=replaced(reset.condition, own),
                values=tuple((x, replaced(value, own)) for x, value in reset.values),
            )
            for reset in equations.resets
        ),
        updates=tuple(
            replace(update, values=tuple((x, replaced(value, own)) for x, value in update.values)) for update in equations.updates
        ),
        delays=tuple((inputs[u], parameters[str(tau)]) for u, tau in delays.items() if tau in parameters),
    )


def with_delays(delays: Mapping[str, str | float], inputs: Sequence[Any]) -> dict[Any, Any]:
    """For each delayed input what stands for it in equations as they are written."""

    return {symbol: delayed(symbol.name, delays[symbol.name]) for symbol in inputs if symbol.name in delays}


def _check(equations: Equations, place: str, name: str, time: str | float) -> None:
    inputs, states = ([symbol.name for symbol in of] for of in (equations.inputs, equations.states))
    if name in states:
        raise ValueError(f"{place}: expected an input in delay(), given the state {name}: there are no delayed states")
    if name not in inputs:
        raise ValueError(f"{place}: expected an input in delay(), {listed(inputs)}; given {shown(name)}")
    if not states:
        raise ValueError(f"{place}: expected no delay() in a model without states, given one of {name}")
    constants = {symbol.name: value for symbol, value in equations.constants.items()}
    if isinstance(time, str) and time not in (*constants, *(symbol.name for symbol in equations.parameters)):
        raise ValueError(f"{place}: expected a parameter, a known constant or a number as dead time of {name}, given {shown(time)}")
    value = constants.get(time, 0.0) if isinstance(time, str) else time
    if not 0 <= value < float("inf"):
        raise ValueError(f"{place}: expected a dead time of {name} of at least 0 s, given {value:g}")
