"""Runs that a search has come to, and the way of a start through them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array

MOST_LOST, MOST_HOPS = 2, 2
"""How often in a row too few plants may be able to run what a start leads to, after enough could; and how often the best start goes
on, in vain, from its best runs by a change that does not gain at first."""


class Found(NamedTuple):
    """Runs that the search has come to; replaced as a whole, so that an interrupt cannot tear it.

    `share` is that of the plants on which they reach their ends, of those that the search has tried; `regular` says whether they
    determine all parameters.
    """

    z: Array
    selected: NDArray[np.bool_] | None
    value: float
    share: float
    feasible: bool
    regular: bool
    worth: tuple[bool, bool, float]


class Way:
    """What a start has gone through: the distance from limits at its best runs, and how often it went on from these in vain."""

    def __init__(self) -> None:
        self.kappa, self._lost, self._hops = 0.0, 0, 0

    def keep(self, kappa: float, better: bool) -> None:
        """Note the distance at which the best runs were found; where they are `better`, hops count anew."""
        self.kappa = kappa
        if better:
            self._hops = 0

    def is_lost(self, best: Found, found: Found) -> bool:
        """Whether too few plants could run what was found, time after time, since enough could."""
        self._lost = self._lost + 1 if best.feasible and not found.feasible else 0
        return self._lost > MOST_LOST

    def ends(self) -> bool:
        """Whether another hop is one too many."""
        self._lost, self._hops = 0, self._hops + 1
        return self._hops > MOST_HOPS
