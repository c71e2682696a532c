"""Outputs as they are measured, some of them not."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..basics.checks import as_numbers, as_rows
from ..basics.values import Array


def measured_outputs(values: ArrayLike, count: int) -> Array:
    """Outputs (count, n_y), NaN where not measured, of which one at least was; (count,) is taken for a single output."""
    y = as_rows(as_numbers(values, "y"), count, "y", "n_y")
    if np.isinf(y).any():
        row, column = (int(i) for i in np.argwhere(np.isinf(y))[0])
        raise ValueError(f"y: expected finite numbers, or NaN for what was not measured; given {y[row, column]} at {(row, column)}")
    if np.isnan(y).all():
        raise ValueError("y: expected at least one measured number, given none")
    return y
