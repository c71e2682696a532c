"""Outputs as they are measured, some of them not."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..basics.checks import as_numbers
from ..basics.values import Array
from ..points.runs import Runs


def measured_outputs(values: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Outputs (*shape, n_y), NaN where not measured, at least one measured; `shape` itself is taken for a single output."""
    y = as_numbers(values, "y")
    if y.shape == shape:
        y = y[..., None]
    if y.ndim != len(shape) + 1 or y.shape[:-1] != shape:
        raise ValueError(f"y: expected shape ({', '.join(map(str, shape))}, n_y), given {y.shape}")
    if np.isinf(y).any():
        where = tuple(int(i) for i in np.argwhere(np.isinf(y))[0])
        raise ValueError(f"y: expected finite numbers, or NaN for what was not measured; given {y[where]} at {where}")
    if np.isnan(y).all():
        raise ValueError("y: expected at least one measured number, given none")
    return y


def refuse_beside_samples(runs: Runs, y: Array) -> None:
    """Raise for an output of (K, N, n_y) at a segment that is not measured."""
    beside = np.argwhere(~np.isnan(y) & ~runs.readings)
    if len(beside):
        k, n, i = (int(place) for place in beside[0])
        raise ValueError(f"y: expected NaN where runs are not measured, given {y[k, n, i]:g} in segment {n} of runs[{k}]")


def runs_with_outputs(runs: Runs, y: Array) -> tuple[Runs, Array]:
    """Return the runs that have a measured output, up to their last one, and their outputs.

    The trajectories of what is left out may well fail.
    """
    there: NDArray[np.bool_] = np.asarray(np.isfinite(y).any(axis=2))
    rows = np.flatnonzero(there.any(axis=1))
    measured = runs[rows].ending(there[rows])
    return measured, y[rows, : measured.dt.shape[1]]
