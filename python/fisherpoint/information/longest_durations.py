"""The longest durations at which points can be run on enough of some nodes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array

SHORT = 0.999
"""Share of the time at which a trajectory ends that is used, as this time is known to the tolerance."""


def longest(lasted: Array, weights: Array, allowed: float) -> Array:
    """Return times (K,), a little before more weight is lost than allowed; infinite where that never happens.

    What a trajectory meets by some time it meets by any later one.

    Parameters
    ----------
    lasted : ndarray, (K, m)
        Until when each point could be followed on each node; infinite where that is its end.
    weights : ndarray, (m,)
    allowed : float
        Largest weight of the nodes that may be lost.
    """
    order = np.argsort(lasted, axis=1, kind="stable")
    lost = np.cumsum(weights[order], axis=1) > allowed
    first: NDArray[np.intp] = np.argmax(lost, axis=1)
    ends = np.take_along_axis(lasted, np.take_along_axis(order, first[:, None], axis=1), axis=1)[:, 0]
    return np.where(lost.any(axis=1), SHORT * ends, np.inf)
