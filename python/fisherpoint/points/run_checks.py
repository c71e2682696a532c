"""Checks of the arrays that runs are made of."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..basics.checks import as_positive
from ..basics.messages import shown
from ..basics.units import converted, seconds
from ..basics.values import Array
from .bounds import split_unit

Flags = NDArray[np.bool_]


def as_flags(measured: ArrayLike | None) -> Flags:
    """Whether the ends of segments are measured, as an array; raise for what is no flags."""
    try:
        flags = np.asarray(True if measured is None else measured)
    except (TypeError, ValueError, OverflowError, RuntimeError):
        flags = np.empty(0)
    if flags.dtype != np.bool_:
        raise ValueError(f"measured: expected flags, given {shown(measured)}")
    return flags


def inputs_before(given: ArrayLike | None, shape: tuple[int, int]) -> Array | None:
    """The inputs before each run; NaN where the default counts, None where it does in all."""
    if given is None:
        return None
    try:
        before = np.asarray(given, dtype=np.float64)
        before = np.array(np.broadcast_to(before, shape)) if before.ndim else np.empty(0)
    except (TypeError, ValueError, OverflowError):
        before = np.empty(0)
    missing = np.isnan(before)
    if before.shape != shape or np.isinf(before).any() or (missing.any(axis=1) & ~missing.all(axis=1)).any():
        raise ValueError(f"before: expected finite inputs of shape {shape}, or rows of NaN, given {shown(given)}")
    return None if missing.all() else before


def of_segments(array: NDArray[Any], shape: tuple[int, int], name: str) -> NDArray[Any]:
    """An array of one entry for every segment."""
    if array.ndim > 2 or (array.ndim and array.shape[-1] != shape[1]) or (array.ndim == 2 and len(array) != shape[0]):
        raise ValueError(f"{name}: expected shape {shape}, given {array.shape}")
    return np.broadcast_to(array, shape).copy()


def of_outputs(flags: Flags, shape: tuple[int, int]) -> Flags:
    """Flags of each output for every segment, (K, N, n_y)."""
    if flags.shape[:2] != shape or not flags.shape[2]:
        raise ValueError(f"measured: expected shape {shape}, or ({shape[0]}, {shape[1]}, n_y) by outputs, given {flags.shape}")
    return flags


def check_segments(dt: Array, measured: Flags) -> None:
    for wrong, what in ((dt < 0, "no negative ones"), ((dt[:, :-1] == 0) & (dt[:, 1:] > 0), "none of zero before others")):
        if wrong.any():
            k, n = (int(i) for i in np.argwhere(wrong)[0])
            raise ValueError(f"dt: expected durations in s, {what}, given {dt[k, n]:g} in segment {n} of runs[{k}]")
    for rows, what in ((~(dt[:, :1] > 0).any(axis=1), "segment"), (~measured.any(axis=1), "measured segment")):
        if rows.any():
            raise ValueError(f"runs: expected at least one {what} in each, given none in runs[{int(np.argmax(rows))}]")


MOST_SAMPLES = 1_000_000
"""Samples of a run at most."""


def as_period(given: Any, name: str) -> float:
    """A period in s, given as a number, with a unit, or as text such as "1 ms"."""
    if isinstance(given, str):
        return as_positive(seconds(given, name), name, "period in s")
    number, unit = split_unit(given)
    if unit is None:
        return as_positive(number, name, "period in s")
    if len(number) != 1:
        raise ValueError(f"{name}: expected a number, or (number, unit), given {shown(given)}")
    return float(converted(np.array(as_positive(number[0], name)), unit, "s", name))


def check_period(every: float, shortest: float, longest: float, name: str) -> None:
    """Raise where runs of these durations have no sample, or too many."""
    if every > shortest * (1 + 1e-12):
        raise ValueError(f"{name}: expected a period of at most the shortest run, {shortest:g} s, given {every:g}")
    if longest / every > MOST_SAMPLES:
        raise ValueError(f"{name}: expected a period with at most {MOST_SAMPLES} samples in {longest:g} s, given {every:g}")
