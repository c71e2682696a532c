"""Runs that a search has come to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array


class ReachedRuns(NamedTuple):
    """Runs that the search has come to; replaced as a whole, so that an interrupt cannot tear it.

    `share` is that of the plants on which they reach their ends, of those that the search has tried; `regular` says whether they
    determine all parameters. `worth` is what they are compared by: whether they are regular, whether enough plants can run them,
    and the criterion, less something where these are too few.
    """

    z: Array
    selected: NDArray[np.bool_] | None
    value: float
    share: float
    feasible: bool
    regular: bool
    worth: tuple[bool, bool, float]
