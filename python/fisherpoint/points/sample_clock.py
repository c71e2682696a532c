"""The instants at which outputs are measured, whatever the segments of runs are: one clock for all outputs, or one for each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array
from .sampling import SAME, multiples, same_within, sample_counts

Every: TypeAlias = float | Mapping[str, float]
"""A period of all outputs, s, or one for each that is measured."""


class SampleClock(NamedTuple):
    """Instants after the start at which outputs are measured.

    Attributes
    ----------
    instants : ndarray, (S,)
        s, increasing.
    outputs : ndarray of bool, (S, n_y), or None
        Which outputs are measured at each; None where all are.
    every : float or None
        The period, s, of which the instants are all multiples; None where they are others.
    """

    instants: Array
    outputs: NDArray[np.bool_] | None
    every: float | None

    @classmethod
    def of(cls, every: Every, end: float, outputs: Sequence[str]) -> SampleClock:
        """All multiples up to `end`, s, of a period, or of one for each of some of the `outputs`."""
        if not isinstance(every, Mapping):
            return cls(_multiples(every, end), None, every)
        return cls.of_outputs(every, {}, end, outputs)

    @classmethod
    def of_outputs(cls, every: Mapping[str, float], at: Mapping[str, Array], end: float, outputs: Sequence[str]) -> SampleClock:
        """The instants of outputs, each of which has a period up to `end`, s, or a table (S,) of its own, or is not measured."""
        tables = {name: _multiples(period, end) for name, period in every.items()} | dict(at)
        finest = min(tables, key=lambda name: float(np.diff(tables[name], prepend=0.0).min()))
        order = [*(name for name in tables if name != finest), finest]
        t = np.concatenate([tables[name] for name in order])
        owner = np.repeat([outputs.index(name) for name in order], [len(tables[name]) for name in order])
        by_time = np.argsort(t, kind="stable")
        step = float(np.diff(tables[finest], prepend=0.0).min())
        new = np.diff(t[by_time], prepend=-np.inf) > max(SAME * step, 8 * np.finfo(float).eps * float(t.max()))
        place = np.empty(len(t), dtype=np.intp)
        place[by_time] = np.cumsum(new) - 1
        instants, flags = np.empty(int(new.sum())), np.zeros((int(new.sum()), len(outputs)), dtype=bool)
        instants[place] = t  # of instants that are the same those of the finest, which are the last
        flags[place, owner] = True
        whole = finest in every and len(instants) == len(tables[finest])
        return cls(instants, None if flags.all() else flags, every[finest] if whole else None)

    def counts(self, dt: Array) -> NDArray[np.intp]:
        """How many of the instants there are until the ends of runs with segments dt (K, N), (K,)."""
        if self.every is not None:
            return sample_counts(dt, self.every)
        ends = dt.sum(axis=1) + same_within(dt, float(np.diff(self.instants, prepend=0.0).min()))
        return np.asarray(np.searchsorted(self.instants, ends, side="right"), dtype=np.intp)

    def readings(self, measured: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Which outputs are measured in parts of runs, (K, E, n_y), or (K, E, 1) of all; samples are where `measured` (K, E)."""
        if self.outputs is None:
            return measured[:, :, None]
        return np.asarray(self.outputs[np.maximum(np.cumsum(measured, axis=1) - 1, 0)] & measured[:, :, None])

    def times(self, counts: NDArray[np.intp]) -> Array:
        """The first `counts` (K,) instants of each run, (K, S); inf behind them."""
        if self.every is not None:
            return multiples(self.every, counts)
        instants = self.instants[: int(counts.max(initial=0))]
        return np.asarray(np.where(np.arange(len(instants)) < counts[:, None], instants, np.inf), dtype=np.float64)


def _multiples(every: float, end: float) -> Array:
    return np.asarray(every * np.arange(1, int(sample_counts(np.array([[end]]), every)[0]) + 1), dtype=np.float64)
