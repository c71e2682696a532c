"""The time axis of a run's picture: time itself, or segment beside segment where some are too short to be seen."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ..basics.quantity import Quantity
from ..basics.values import Array
from .durations import duration, make_logarithmic
from .early_transients import begin, is_fast
from .style import scale

SHARES = (1e-5, 1e-4, 1e-3, 3e-3, 0.01, 0.02, 0.04, 0.08, 0.15, 0.25, 0.4, 0.6, 0.8, 1.0)
"""Shares of each segment at which outputs are drawn: behind a change of the inputs they may change fast."""

ALONG = tuple(np.unique(np.concatenate([np.geomspace(1e-7, 1.0, 99), np.linspace(0.0, 1.0, 41)[1:]])).tolist())
"""The same of a run that is a single segment: its input does not change, and it may be fast at first."""

SHORTEST = 0.01
"""Share of a run below which a segment is no more than a line in a picture of the whole."""

WIDTH = 0.42
"""Inches of a segment with its duration below it."""


def shares_of(segments: int) -> tuple[float, ...]:
    """Shares of each segment at which the outputs of runs with so many segments are drawn."""
    return SHARES if segments > 1 else ALONG


class RunTime:
    """Positions at which the instants of a run are drawn.

    A single segment that is fast at first has a logarithmic axis, as a point has. A run with a segment below `SHORTEST` of it has
    an axis on which all segments are equally wide, with their durations written below; within a segment it is linear. Any other
    run has an ordinary axis.

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
        self.by_segment = bool(durations.min() < SHORTEST * self.ends[-1])
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
