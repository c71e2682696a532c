"""Starts at rest: which states of a run have settled before it, and under which held input."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.checks import as_float, as_sequence, by_name, check_name, check_type
from ..basics.messages import listed, shown
from ..basics.quantity import names_of
from ..basics.values import FrozenMapping
from ..models import Model

Rests = NDArray[np.object_]
"""One `Rest`, or None, for each of K runs."""

MOST = 64
"""States at rest, as many as a model of equations has."""


class Conditions(NamedTuple):
    """Conditions at a rest of a model: states whose rates vanish, and outputs that are given; unknown states and inputs."""

    rates: tuple[str, ...]
    outputs: tuple[str, ...]
    states: tuple[str, ...]
    inputs: tuple[str, ...]

    @property
    def moving(self) -> bool:
        """Whether the plant settles there by itself, under an input that is known."""
        return not self.inputs


@dataclass(frozen=True, eq=False)
class Rest:
    """A start at rest under a held input: the start is where the rates of the states are zero, and so depends on the parameters.

    A closed system keeps totals, as of a substance: then the rest is that of the plants that rest anywhere which has the totals of
    x0. Under closed-loop control some states or outputs are known, and not the input that keeps them there: `hold`, `outputs` and
    `solve` say so.

    Parameters
    ----------
    u : mapping of input name to float, optional
        The inputs, SI units, under which the plant has settled before the run; all of them. A model without inputs has none. Of
        inputs to be solved for, the guess; 0 by default.
    states : sequence of str, optional
        The states whose rates are zero; the others start as x0 says. Default: all. A cylinder that creeps has its velocity
        and pressures at rest, and not its position. Of these states, x0 is the guess from which they are found.
    hold : sequence of str, optional
        States at rest that are where x0 says.
    outputs : mapping of output name to float, optional
        Outputs that have given values at the rest, SI units.
    solve : sequence of str, optional
        Inputs that keep the plant there, which are found: as many as `hold` and `outputs` together. They hold before the run only.

    Raises
    ------
    TypeError, ValueError
        For what are no names or numbers, and inputs to be solved for that are more or fewer than what is given instead.
    """

    u: Mapping[str, float] = field(default_factory=lambda: FrozenMapping({}))
    states: Sequence[str] | None = field(default=None, kw_only=True)
    hold: Sequence[str] = field(default=(), kw_only=True)
    outputs: Mapping[str, float] = field(default_factory=lambda: FrozenMapping({}), kw_only=True)
    solve: Sequence[str] = field(default=(), kw_only=True)

    def __post_init__(self) -> None:
        object.__setattr__(self, "u", by_name(self.u, None, "rest.u", as_float))
        object.__setattr__(self, "outputs", by_name(self.outputs, None, "rest.outputs", as_float))
        if self.states is not None:
            object.__setattr__(self, "states", _names(self.states, "rest.states", "states", 1))
        object.__setattr__(self, "hold", _names(() if self.hold is None else self.hold, "rest.hold", "states", 0))
        object.__setattr__(self, "solve", _names(() if self.solve is None else self.solve, "rest.solve", "inputs", 0))
        given = len(self.hold) + len(self.outputs)
        if len(self.solve) != given:
            raise ValueError(
                f"rest.solve: expected as many inputs as states in hold and outputs are given, {given}; given {listed(self.solve)}"
            )
        for name in (name for name in self.hold if self.states is not None and name not in self.states):
            raise ValueError(f"rest.hold: expected states at rest, {listed(self.states or ())}; given {name!r}")

    def _identity(self) -> tuple[object, ...]:
        """Key of the rest, whatever the order of its states."""
        states = None if self.states is None else frozenset(self.states)
        return self.u, states, frozenset(self.hold), self.outputs, frozenset(self.solve)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Rest) and self._identity() == other._identity()

    def __hash__(self) -> int:
        return hash(self._identity())

    def names(self, states: tuple[str, ...]) -> tuple[str, ...]:
        """States of a model that are at rest, in its order."""
        return _known(states if self.states is None else self.states, states, "rest.states", "states")

    def found(self, states: tuple[str, ...]) -> tuple[str, ...]:
        """States of a model that are solved for, and not as x0 says, in its order."""
        held = _known(self.hold, states, "rest.hold", "states")
        return tuple(name for name in self.names(states) if name not in held)

    def conditions(self, states: tuple[str, ...], inputs: tuple[str, ...], outputs: tuple[str, ...]) -> Conditions:
        """Conditions at the rest of a model with these names."""
        given = _known(tuple(self.outputs), outputs, "rest.outputs", "outputs")
        return Conditions(self.names(states), given, self.found(states), _known(self.solve, inputs, "rest.solve", "inputs"))

    def check(self, model: Model) -> None:
        """Raise unless the names are those of a model, and all inputs are given or solved for."""
        inputs = names_of(model.inputs)
        if model.updates:
            raise ValueError(f"rest: expected a model without updates, which are no rest, given {model.name}: give x0")
        self.conditions(names_of(model.states), inputs, names_of(model.outputs))
        self.held(inputs)

    def held(self, inputs: tuple[str, ...]) -> list[float]:
        """The held input, or its guess, in the order of a model's inputs."""
        guessed = dict.fromkeys(_known(self.solve, inputs, "rest.solve", "inputs"), 0.0)
        return list(by_name({**guessed, **self.u}, inputs, "rest.u", as_float, complete=True).values())


def _names(given: Any, label: str, of: str, least: int) -> tuple[str, ...]:
    if isinstance(given, Mapping):
        raise TypeError(f"{label}: expected a sequence of names, given {shown(given)}")
    names = tuple(check_name(name, label) for name in as_sequence(given, label, "names"))
    if not least <= len(names) <= MOST or len(set(names)) != len(names):
        raise ValueError(f"{label}: expected names of {of}, each once, given {listed(names)}")
    return names


def _known(names: Sequence[str], known: tuple[str, ...], label: str, of: str) -> tuple[str, ...]:
    """Names of a model, in its order."""
    for unknown in (name for name in names if name not in known):
        raise ValueError(f"{label}: expected names of {of}, {listed(known)}; given unknown {unknown!r}")
    return tuple(name for name in known if name in names)


def as_rests(given: Any, count: int) -> Rests | None:
    """One for each of `count` runs; None where none starts at rest."""
    if given is None:
        return None
    each = [given] * count if isinstance(given, Rest) else as_sequence(given, "rest", "Rests, or None,")
    if len(each) != count:
        raise ValueError(f"rest: expected one for each of {count} runs, given {len(each)}")
    rests = np.full(count, None, dtype=object)
    for k, one in enumerate(each):
        if one is not None:
            check_type(one, Rest, f"rest[{k}]")
        rests[k] = one
    return any_rests(rests)


def any_rests(rests: Rests) -> Rests | None:
    """Return `rests`, or None where no run starts at rest."""
    return rests if any(one is not None for one in rests) else None


def joined_rests(parts: Sequence[tuple[Rests | None, int]]) -> Rests | None:
    """Join the rests of parts, of so many runs each, one after the other."""
    return any_rests(np.concatenate([np.full(count, None, dtype=object) if rests is None else rests for rests, count in parts]))
