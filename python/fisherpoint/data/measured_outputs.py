"""Outputs as they are measured, some of them not."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..quantity import Array


def measured_outputs(values: ArrayLike, count: int) -> Array:
    """Outputs (count, n_y), NaN where not measured, of which one at least was; (count,) is taken for a single output."""
    try:
        if np.iscomplexobj(values):
            raise TypeError("complex numbers")
        y = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"y: expected numbers, given {values!r:.80}") from error
    if y.ndim == 1 and len(y) == count:
        y = y.reshape(count, 1)
    if y.ndim != 2 or len(y) != count:
        raise ValueError(f"y: expected shape ({count}, n_y), given {y.shape}")
    if np.isinf(y).any():
        row, column = (int(i) for i in np.argwhere(np.isinf(y))[0])
        raise ValueError(f"y: expected finite numbers, or NaN for what was not measured; given {y[row, column]} at {(row, column)}")
    if np.isnan(y).all():
        raise ValueError("y: expected at least one measured number, given none")
    return y
