"""Starts at rest: which states of a run have settled before it, and under which held input."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..basics.checks import as_float, as_sequence, by_name, check_name, check_type
from ..basics.messages import listed, shown
from ..basics.values import FrozenMapping

Rests = NDArray[np.object_]
"""One `Rest`, or None, for each of K runs."""

MOST = 64
"""States at rest, as many as a model of equations has."""


@dataclass(frozen=True, eq=False)
class Rest:
    """A start at rest under a held input: the start is where the rates of the states are zero, and so depends on the parameters.

    Parameters
    ----------
    u : mapping of input name to float, optional
        The inputs, SI units, under which the plant has settled before the run; all of them. A model without inputs has none.
    states : sequence of str, optional
        The states of which the rates are zero; the others start as x0 says. Default: all. A cylinder that creeps has its velocity
        and pressures at rest, and not its position. Of these states, x0 is the guess from which they are found.

    Raises
    ------
    TypeError, ValueError
        For what are no names or numbers.
    """

    u: Mapping[str, float] = field(default_factory=lambda: FrozenMapping({}))
    states: Sequence[str] | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        object.__setattr__(self, "u", by_name(self.u, None, "rest.u", as_float))
        if self.states is not None:
            if isinstance(self.states, Mapping):
                raise TypeError(f"rest.states: expected a sequence of names, given {shown(self.states)}")
            names = tuple(check_name(name, "rest.states") for name in as_sequence(self.states, "rest.states", "names"))
            if not 1 <= len(names) <= MOST or len(set(names)) != len(names):
                raise ValueError(f"rest.states: expected names of states, each once, given {listed(names)}")
            object.__setattr__(self, "states", names)

    def _identity(self) -> tuple[object, ...]:
        """What the rest is, whatever the order of its states."""
        return self.u, None if self.states is None else frozenset(self.states)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Rest) and self._identity() == other._identity()

    def __hash__(self) -> int:
        return hash(self._identity())

    def names(self, states: tuple[str, ...]) -> tuple[str, ...]:
        """Those of a model's states that are at rest, in its order."""
        if self.states is None:
            return states
        for unknown in (name for name in self.states if name not in states):
            raise ValueError(f"rest.states: expected names of states, {listed(states)}; given unknown {unknown!r}")
        return tuple(name for name in states if name in self.states)

    def held(self, inputs: tuple[str, ...]) -> list[float]:
        """The held input, in the order of a model's inputs."""
        return list(by_name(self.u, inputs, "rest.u", as_float, complete=True).values())


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
    """The same; None where none is at rest, which counts as nothing said."""
    return rests if any(one is not None for one in rests) else None


def joined_rests(parts: Sequence[tuple[Rests | None, int]]) -> Rests | None:
    """Those of parts, of so many runs each, one after the other."""
    return any_rests(np.concatenate([np.full(count, None, dtype=object) if rests is None else rests for rests, count in parts]))
