"""What models remember beside their states, and where states are set anew.

A latch in equations is a further state, 0 or 1, which moves only where it is set anew: nobody else sees it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy

from ..tape.latch import Latch, condition_of, holds
from ..tape.parts import contain, rebuilt
from ..tape.reset import Reset


class Memory:
    """Puts a symbol in place of every latch.

    Attributes
    ----------
    starts : dict of sympy.Symbol to int
        The symbols of the latches, and their values at first.
    resets : list of Reset
        What sets them.
    """

    def __init__(self) -> None:
        self.starts: dict[Any, int] = {}
        self.resets: list[Reset] = []
        self._known: dict[Any, Any] = {}
        self._symbols: dict[Any, Any] = {}

    def without_latches(self, expression: Any) -> Any:
        """The expression with symbols for latches."""
        return rebuilt(expression, lambda _, now: self._symbol(now) if isinstance(now, Latch) else now, self._known)

    def _symbol(self, latch: Any) -> Any:
        if latch not in self._symbols:
            on, off, start = latch.args
            state = sympy.Dummy(f"latch_{len(self._symbols) + 1}", real=True)
            self._symbols[latch], self.starts[state] = state, int(start)
            both = sympy.And(_true_where(on), sympy.Not(_true_where(off)), evaluate=False)
            self.resets += [
                Reset(holds(both), ((state, sympy.S.One),), by_level=True),
                Reset(off, ((state, sympy.S.Zero),), by_level=True),
            ]
        return self._symbols[latch]


def _true_where(of: Any) -> Any:
    return condition_of(of) if isinstance(of, sympy.Piecewise) else sympy.true if of == 1 else sympy.false


def has_latch(expression: Any) -> bool:
    """Whether a latch stands in an expression."""
    return contain([expression], Latch)


def remembered(resets: Sequence[Reset], memory: Memory) -> tuple[Reset, ...]:
    """All resets, those of latches first, with symbols for the latches that they read themselves."""
    given = [
        Reset(memory.without_latches(one.condition), tuple((x, memory.without_latches(value)) for x, value in one.values))
        for one in resets
    ]
    return (*memory.resets, *given)
