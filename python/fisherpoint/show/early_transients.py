"""Early transients: axes of time that are logarithmic, and from when on, so that they are seen beside slow changes."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from ..basics.values import Array
from .durations import duration, is_wide, mark

EARLY, MUCH, LITTLE = 0.01, 0.1, 0.01
"""Shares: a trajectory is fast at first where within `EARLY` of the time `MUCH` of all change is over; and what is hardly any."""


def is_fast(outputs: Array, shares: ArrayLike) -> bool:
    """Whether much of what outputs (T, n_y) do at these shares of a duration is over so early that it looks like a jump."""
    return bool((_changed(outputs)[np.searchsorted(shares, EARLY)] >= MUCH).any())


def begin(outputs: Array) -> int:
    """Time from which on outputs (T, n_y) are drawn over a logarithmic axis: before that hardly anything happens."""
    return max(0, int((np.nanmax(_changed(outputs), axis=1) < LITTLE).sum()) - 1)


def _changed(outputs: Array) -> Array:
    """The share (T, n_y) of all change of each output until then; NaN of an output that does not change."""
    steps = np.nancumsum(np.abs(np.diff(outputs, axis=0, prepend=outputs[:1])), axis=0)
    still = steps[-1] <= 1e-6 * np.nanmax(np.abs(outputs), axis=0, initial=0.0)
    return np.where(still, np.nan, steps / np.where(still, 1.0, steps[-1]))


def is_crowded(t: Array) -> bool:
    """Whether samples at increasing times are so much denser at first that half of them lie in a tenth of the time."""
    return len(t) > 2 and is_wide(np.diff(t)) and bool(np.median(t) - t[0] < 0.1 * (t[-1] - t[0]))


def make_logarithmic_from_zero(axes: Axes, first: float, high: float) -> None:
    """Have the horizontal axis, in s, begin at zero, be linear up to the first duration, and logarithmic from there on."""
    axes.set_xscale("symlog", linthresh=first, linscale=0.16 * float(np.log10(high / first)))  # room for both their names
    mark(axes.xaxis, first, high, 6)
    named = axes.xaxis.get_majorticklocs()
    axes.set_xticks([0.0, *named], ["0", *map(duration, named)])
    axes.set_xlim(-0.15 * first, 1.4 * high)
