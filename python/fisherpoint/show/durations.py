"""Durations along axes: logarithmic where they span decades, with ticks as people say them, 100 ms, 1 s, 10 min, 1 h."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import NullFormatter
from numpy.typing import ArrayLike

from ..basics.quantity import Quantity
from .style import TIMES, labelled, scale

WIDE = 100.0
"""Largest over smallest duration from which on an axis is logarithmic: on a linear one, small ones lie on one another."""

LADDER = np.array([*10.0 ** np.arange(-9, 2), 60.0, 600.0, 3600.0, 21600.0, *86400.0 * 10.0 ** np.arange(5)])
"""Durations at which a logarithmic axis has ticks, in s."""


class AxisScale(NamedTuple):
    """How a quantity stands along an axis: values times the factor, in the unit; a logarithmic axis is in s and names its units."""

    factor: float
    unit: str
    is_log: bool

    def label(self, name: str) -> str:
        return f"{name}, logarithmic" if self.is_log else labelled(name, self.unit)


def axis_scale(quantity: Quantity, *ranges: ArrayLike) -> AxisScale:
    """The scale of an axis for values; a duration's is logarithmic where one of the ranges is wide."""
    if quantity.unit == "s" and any(is_wide(values) for values in ranges):
        return AxisScale(1.0, "", True)
    return AxisScale(*scale(quantity, ranges[0]), False)


def is_wide(values: ArrayLike) -> bool:
    """Whether durations differ by more than two decades; what begins at zero has no place on a logarithmic axis."""
    values = np.asarray(values, dtype=float)
    return bool(np.nanmin(values, initial=np.inf) > 0 and np.nanmax(values, initial=0.0) > WIDE * np.nanmin(values))


def duration(seconds: float) -> str:
    """A duration in a unit that is easy to read, with three digits."""
    factor, unit = next(((factor, unit) for factor, unit in TIMES if seconds >= factor), TIMES[-1])
    return f"{seconds / factor:.3g} {unit}"


def make_logarithmic(axes: Axes, low: float, high: float, most: int = 6) -> None:
    """Have the horizontal axis, in s, be logarithmic from one duration to another, with so many named ticks at most."""
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    mark(axes.xaxis, low, high, most)


def mark(axis: Any, low: float, high: float, most: int = 6) -> None:
    """Name durations along a logarithmic axis, or along that of a colour bar."""
    first, end = np.searchsorted(LADDER, (low * (1 - 1e-9), high * (1 + 1e-9)))
    places = LADDER[first:end]
    named: list[float] = []
    for place in places.tolist():
        if not named or np.log(place / named[-1]) >= np.log(high / low) / most:
            named.append(place)
    axis.set_ticks(named, [duration(place) for place in named])
    axis.set_ticks(np.setdiff1d(places, named), minor=True)
    axis.set_minor_formatter(NullFormatter())
