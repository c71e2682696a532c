"""Time in equations, as t: a clock among the states that the core follows, which nobody else sees (`hidden_states.py`).

It begins at zero with each point, run or record, and moves at the rate 1: time is exact, and a switch by time is a jump like any
other.
"""

from __future__ import annotations

from collections.abc import Collection

from ..basics.quantity import Quantity

NAMES = "t", "time"
"""Names of the time in equations, where no quantity has the name."""


def clock_names(taken: Collection[str]) -> list[str]:
    """Names of the time in the equations of a model with quantities of these names; the first is shown."""
    return [name for name in NAMES if name not in taken]


def clock_quantity(name: str) -> Quantity:
    """Time as a state."""
    return Quantity(name, "s", "time since the start")
