"""Kinds of equations as parts of random models: something drives them, something else reads them, in any form and at any scale."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import fisherpoint as fp
from automaton import Automaton, Guard, Mode
from kinds import KINDS, Kind, Range
from reading import Floats

ON_SURFACE = 0.4  # of starts, for each surface that a kind names
DURATIONS = (0.3, 4.0)


@dataclass(frozen=True)
class Driver:
    """What drives a kind: states with their rates, inputs and parameters; its value w and the rate of that, dw."""

    w: str
    dw: str
    states: Mapping[str, Range] = field(default_factory=dict)
    rates: tuple[str, ...] = ()
    inputs: Mapping[str, Range] = field(default_factory=dict)
    parameters: Mapping[str, Range] = field(default_factory=dict)


DRIVERS = (
    Driver("u1", "0.0", inputs={"u1": (-1, 1)}),
    Driver("A*sin(2*tau)", "2*A*cos(2*tau)", {"tau": (0, 3)}, ("1",), parameters={"A": (0.4, 1.2)}),
    Driver("1.5*s1", "1.5*om*s2", {"s1": (-1, 1), "s2": (-1, 1)}, ("om*s2", "-om*s1"), parameters={"om": (0.5, 3)}),
    Driver("r1", "2*(u1 - r1)", {"r1": (-1, 1)}, ("2*(u1 - r1)",), {"u1": (-1, 1)}),
    Driver("0.8*cos(3*tau) + u1", "-2.4*sin(3*tau)", {"tau": (0, 3)}, ("1",), {"u1": (-0.5, 0.5)}),
)
NONE = Driver("0.0", "0.0")
Reader = tuple[tuple[str, ...], Mapping[str, Range]]
"""The rate of a state Z that reads a kind, if there is one, and parameters."""

READERS: tuple[Reader, ...] = (
    ((), {}),
    (("{x}",), {}),
    (("qz*{x} - Z",), {"qz": (0.5, 2)}),
    (("sin({x}) - qz*Z",), {"qz": (0.5, 2)}),
    (("exp(-{x}) - Z*Z",), {}),
)


@dataclass(frozen=True)
class Drawn:
    """A model, the same as an automaton in natural units, and from where its numbers are drawn.

    `sizes` are of states, inputs and parameters, by name; `time` is the unit of time.
    """

    name: str
    kind: Kind
    arguments: dict[str, Any]
    automaton: Automaton
    outputs: tuple[str, ...]
    states: dict[str, Range]
    inputs: dict[str, Range]
    parameters: dict[str, Range]
    sizes: dict[str, float]
    time: float

    def model(self) -> fp.SymbolicModel:
        return fp.SymbolicModel(**self.arguments, check_units=False)

    def size(self, names: Mapping[str, Any]) -> Floats:
        return np.array([self.sizes[name] for name in names])

    def numbers(self, rng: np.random.Generator, nice: bool) -> tuple[Floats, Floats, float, Floats]:
        """x0, u, dt and theta in natural units; nice ones are multiples of 0.1, and often start on a surface."""

        def one(between: Range) -> float:
            value = float(rng.uniform(*between))
            return float(np.clip(round(value, 1), *np.round(between, 2))) if nice else value

        theta = {name: one(between) for name, between in self.parameters.items()}
        start = {name: one(between) for name, between in self.states.items()}
        for name, place in self.kind.meets.items():
            if rng.random() < ON_SURFACE:
                start[name] = start[place] if isinstance(place, str) else place
        u = [one(between) or 0.3 for between in self.inputs.values()]
        dt = one(DURATIONS)
        return np.array(list(start.values())), np.array(u), dt, np.array(list(theta.values()))

    def experiments(self, x0: Any, u: Any, dt: Any) -> fp.Experiments:
        """Points in the model's units, of rows in natural ones."""
        x0, u, dt = np.atleast_2d(x0), np.asarray(u).reshape(len(np.atleast_2d(x0)), -1), np.atleast_1d(dt)
        return fp.Experiments(x0 * self.size(self.states), u * self.size(self.inputs), dt * self.time)

    def code(self, call: str) -> str:
        arguments = ", ".join(f"{name}={value!r}" for name, value in self.arguments.items())
        return f"import fisherpoint as fp\n\nmodel = fp.SymbolicModel({arguments}, check_units=False)\n{call}"


def drawn(name: str, rng: np.random.Generator, scaled: bool = False) -> Drawn:
    """A kind in one of its forms, with a driver and a reader, at random sizes if it is to be scaled."""
    kind = KINDS[name]()
    driver, reader = DRIVERS[rng.integers(len(DRIVERS))], READERS[rng.integers(len(READERS))]
    form = kind.forms[rng.integers(len(kind.forms))]
    return built(name, kind, form, driver if kind.driven else NONE, reader, rng if scaled else None)


def built(
    name: str, kind: Kind, form: Sequence[str], driver: Driver, reader: Reader, rng: np.random.Generator | None = None
) -> Drawn:
    """The same of what was drawn; `rng` draws sizes."""
    reads, further = reader
    w = f"(0.8 + 0.4*tanh({driver.w}))" if kind.positive else f"({driver.w})"

    def filled(text: str) -> str:
        return text.replace("{w}", w).replace("{dw}", driver.dw).replace("{x}", kind.x)

    before, after = [*driver.rates], [filled(text) for text in reads]
    states = {**driver.states, **kind.states, **({"Z": (0.0, 1.0)} if reads else {})}
    inputs, parameters = dict(driver.inputs), {**driver.parameters, **kind.parameters, **further}
    modes = {}
    for mode, of in kind.modes.items():
        # What reads a state that a mode integrates as its root reads the square of that.
        read = [re.sub(rf"\b({'|'.join(of.roots)})\b", r"(\1*\1)", text) if of.roots else text for text in after]
        guards = [Guard(filled(guard.height), guard.to, guard.reset) for guard in of.guards]
        modes[mode] = Mode([*before, *map(filled, of.rates), *read], guards, of.roots)
    outputs = tuple(kind.outputs) or tuple(kind.states)
    outputs += ("Z",) * len(reads)
    names = [*states, *inputs, *parameters]
    sizes = {of: float(10.0 ** rng.integers(-6, 7)) if rng else 1.0 for of in names}
    time = float(10.0 ** rng.integers(-4, 5)) if rng else 1.0

    def sized(text: str) -> str:
        return re.sub(rf"\b({'|'.join(names)})\b", lambda found: shown(found[1], sizes[found[1]]), text) if rng else text

    def anew(of: str, text: str) -> str:
        return f"{sizes[of]:g}*({sized(text)})" if rng else text

    rates = [*before, *map(filled, form), *after]
    arguments = {
        "f": [
            text if sizes[of] == time else f"{sizes[of] / time:g}*({text})"
            for of, text in zip(states, map(sized, rates), strict=True)
        ],
        "g": [sized(text) for text in outputs],
        "states": {of: ("1", sizes[of]) for of in states},
        "inputs": dict.fromkeys(inputs, "1"),
        "parameters": dict.fromkeys(parameters, "1"),
    }
    if kind.resets:
        arguments["resets"] = {
            sized(condition): {of: anew(of, text) for of, text in these.items()} for condition, these in kind.resets.items()
        }
    automaton = Automaton(list(states), list(inputs), list(parameters), modes, kind.memory)
    return Drawn(name, kind, arguments, automaton, outputs, states, inputs, parameters, sizes, time)


def shown(name: str, size: float) -> str:
    return name if size == 1 else f"({name}/{size:g})"
