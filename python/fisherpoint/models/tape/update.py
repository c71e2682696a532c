"""States that get new values at known times."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...basics.values import Array

EACH_SEGMENT = "each segment"

_TIMES = re.compile(rf"\s*(?:{EACH_SEGMENT}\s*$|(?:every|at)\s+(?!and\b|or\b)[\w.])")


def at_known_times(text: str) -> bool:
    """Whether a text is one of times, such as "every 5 ms", and no condition."""
    return _TIMES.match(text) is not None


@dataclass(frozen=True)
class UpdateTimes:
    """When an update comes: at the start of each segment of a run, at given times, or at `first` and every so often from then on.

    Attributes
    ----------
    text : str
        As it was written.
    at : tuple of float
        Times, s; alone, or with `every` the first one. None of each segment.
    every : float
        Period, s; 0 for none.
    """

    text: str
    at: tuple[float, ...] = ()
    every: float = 0.0

    @property
    def each_segment(self) -> bool:
        return not self.at

    def until(self, end: float) -> Array:
        """Those up to a time, in s from the start."""
        if not self.every:
            return np.array([t for t in self.at if t <= end], dtype=np.float64)
        count = max(0, int(np.floor((end - self.at[0]) / self.every)) + 2)
        return np.array(self.at[0] + self.every * np.arange(count), dtype=np.float64)


@dataclass(frozen=True)
class Update:
    """States that get new values at known times.

    Attributes
    ----------
    times : UpdateTimes
    values : tuple of (sympy.Symbol, sympy.Expr)
        States with what they are set to, by the states just before.
    """

    times: UpdateTimes
    values: tuple[tuple[Any, Any], ...]
