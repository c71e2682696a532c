"""Axes of time: durations, early transients, and the segments of a run.

An axis is logarithmic where durations span decades, with ticks as people say them: 100 ms, 1 s, 10 min, 1 h.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import NullFormatter
from numpy.typing import ArrayLike

from ..basics.quantity import Quantity
from ..basics.values import Array
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


SHARES = (1e-5, 1e-4, 1e-3, 3e-3, 0.01, 0.02, 0.04, 0.08, 0.15, 0.25, 0.4, 0.6, 0.8, 1.0)
"""Shares of each segment at which outputs are drawn: behind a change of the inputs they may change fast."""

ALONG = tuple(np.unique(np.concatenate([np.geomspace(1e-7, 1.0, 99), np.linspace(0.0, 1.0, 41)[1:]])).tolist())
"""The same of a run that is a single segment: its input does not change, and it may be fast at first."""

SHORTEST = 0.01
"""Share of a run below which a segment is no more than a line in a picture of the whole."""

ALIKE = 0.5
"""Shortest over longest segment from which on an ordinary axis shows all of them as well."""

WIDTH = 0.42
"""Inches of a segment with its duration below it."""


MANY = 200
"""Segments of a run from which on outputs are drawn at their ends alone."""

MOST_WIDE = 100
"""Segments at most that are drawn equally wide."""


def shares_of(segments: int) -> tuple[float, ...]:
    """Shares of each segment at which the outputs of runs with so many segments are drawn."""
    return (SHARES if segments < MANY else (1.0,)) if segments > 1 else ALONG


class RunTime:
    """Positions at which the instants of a run are drawn.

    A single segment that is fast at first has a logarithmic axis, as a point has. A run of segments of different durations, one
    below `SHORTEST` of the run, and `MOST_WIDE` at most, has an axis on which all segments are equally wide, with their durations
    written below; within a segment it is linear. Any other run has an ordinary axis.

    Parameters
    ----------
    durations : ndarray, (T,)
        Of the segments, s.
    outputs : ndarray, (L, n_y), optional
        At the shares of the segment where there is only one, `shares_of(1)`.
    """

    def __init__(self, durations: Array, outputs: Array | None = None) -> None:
        self.durations = durations
        self.ends = np.concatenate([[0.0], np.cumsum(durations)])
        least, most = durations.min(), durations.max()
        self.by_segment = len(durations) <= MOST_WIDE and bool(least < SHORTEST * self.ends[-1] and least < ALIKE * most)
        self.is_log = len(durations) == 1 and outputs is not None and is_fast(outputs, ALONG)
        self.first = float(durations[0]) * ALONG[begin(outputs)] if self.is_log and outputs is not None else 0.0
        self.factor, self.unit = scale(Quantity("t", "s"), self.ends[-1])

    @property
    def width(self) -> float:
        """Inches that the axis needs."""
        return WIDTH * len(self.durations) if self.by_segment else 0.0

    def __call__(self, t: Array) -> Array:
        """Positions of instants, which are in s from the start of the run."""
        if self.by_segment:
            return np.asarray(np.interp(t, self.ends, np.arange(len(self.ends))))
        return np.asarray(np.maximum(t, self.first) if self.is_log else self.factor * t)

    def within(self, shares: Array) -> Array:
        """Positions of these shares of every segment, also where a segment is too short for the digits of the run's time."""
        if self.by_segment:
            return np.asarray((np.arange(len(self.durations))[:, None] + shares).ravel())
        if self.is_log:
            return np.asarray(np.maximum(self.durations[0] * shares, self.first))
        return np.asarray(self.factor * (self.ends[:-1, None] + self.durations[:, None] * shares).ravel())

    def mark(self, panels: Iterable[Any]) -> None:
        """Ticks and name of the axis that the panels of a column share; the last one is the lowest."""
        *_, lowest = panels = list(panels)
        if self.is_log:
            make_logarithmic(lowest, self.first, 1.4 * float(self.ends[-1]))
            lowest.set_xlabel("time, logarithmic")
            return
        if not self.by_segment:
            lowest.set_xlabel(f"time [{self.unit}]")
            return
        n = len(self.durations)
        labels = [duration(float(d)) for d in self.durations]
        lowest.set_xticks(np.arange(n + 1), [""] * (n + 1))
        lowest.set_xticks(np.arange(n) + 0.5, labels, minor=True, rotation=90 if n > 6 else 0)
        lowest.set_xlim(-0.1, n + 0.1)
        lowest.set_xlabel("segments and their durations, not to scale")
        for panel in panels:
            panel.tick_params(axis="x", which="minor", length=0)
