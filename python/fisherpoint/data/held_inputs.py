"""Times of samples, and inputs that are held from one to the next."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..basics.checks import as_floats, as_rows
from ..basics.values import Array


def checked_times(values: ArrayLike, name: str = "t") -> Array:
    """Times of samples, increasing."""
    t = as_floats(values, name)
    if t.ndim != 1 or not len(t):
        raise ValueError(f"{name}: expected shape (N,), at least one sample, given {t.shape}")
    late = np.flatnonzero(np.diff(t) <= 0)
    if len(late):
        n = int(late[0]) + 1
        raise ValueError(f"{name}: expected increasing times in s, given {t[n]:g} after {t[n - 1]:g} at sample {n}")
    return t


def held_inputs(values: ArrayLike, count: int) -> Array:
    """Inputs (count, n_u)."""
    return as_rows(as_floats(values, "u"), count, "u", "n_u")
