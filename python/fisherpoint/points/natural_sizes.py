"""Natural sizes of states: a warning where none is stated and a state stays far below 1, as tolerances then mean little for it."""

from __future__ import annotations

import warnings

import numpy as np

from ..basics.messages import listed
from ..basics.values import Array
from ..models import Model

SMALL = 0.01
"""A state that keeps below this has too few digits where its natural size is taken as 1."""

ROUNDING = 1e-13
"""Share of the largest state; a state below it may be zero but for rounding."""


MOST_ALONE = 3
"""Maximum number of states that are each warned of."""


def warn_of_small_states(model: Model, where: str, *states: Array, stacklevel: int = 3) -> None:
    """Warn of states without a stated natural size (`Quantity.scale`) of which all values (..., n_x) are small and some not zero.

    `where` completes "as ... it below 1e-3 mol": "the region keeps" or "the trajectories keep".
    """
    unstated = model.states_without_size
    if not unstated or not any(values.size for values in states):
        return
    largest = np.max([np.abs(values).reshape(-1, len(model.states)).max(axis=0, initial=0.0) for values in states], axis=0)
    small = [i for i in unstated if ROUNDING * largest.max() < largest[i] < SMALL]
    for i in small[:MOST_ALONE]:
        quantity = model.states[i]
        warnings.warn(
            f"{quantity.name}: expected its natural size, as {where} it below {largest[i]:.3g} {quantity.unit} and rtol refers"
            f" to 1 {quantity.unit} where none is stated; in states, write ({quantity.unit!r}, {largest[i]:.1g})",
            RuntimeWarning,
            stacklevel=stacklevel + 1,
        )
    if rest := small[MOST_ALONE:]:
        names = listed([model.states[i].name for i in rest])
        warnings.warn(f"{names}: expected their natural sizes too", RuntimeWarning, stacklevel=stacklevel + 1)
