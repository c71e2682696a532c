"""The instants at which outputs are measured, whatever the segments of runs are: one clock for all outputs, or one for each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..basics.checks import as_floats, by_name
from ..basics.messages import shown
from ..basics.units import converted
from ..basics.values import Array
from .bounds import split_unit
from .run_checks import MOST_SAMPLES, as_period, check_period
from .sampling import SAME, multiples, same_within, sample_counts

Times: TypeAlias = float | tuple[float, ...]
"""A period, s, or a table of instants after the start, s, increasing."""

Every: TypeAlias = Times | Mapping[str, Times]
"""That of all outputs, or that of each output that is measured."""


def as_every(given: Any, label: str, shortest: float, longest: float) -> Every:
    """A period, a table, or those of outputs, which runs of these durations, s, have room for: each a first instant, and one all.

    Raises
    ------
    TypeError, ValueError
        For anything else; the message begins with the label.
    """

    def times(one: Any, name: str) -> Times:
        found = _as_times(one, name)
        _check_times(found, shortest, longest, name)
        return found

    if not isinstance(given, Mapping):
        return times(given, label)
    if not given:
        raise ValueError(f"{label}: expected at least one output that is measured, given none")
    return by_name(given, None, label, times)


def _as_times(given: Any, name: str) -> Times:
    numbers, unit = split_unit(given)
    if isinstance(given, str) or np.ndim(numbers) == 0 or (unit is not None and len(numbers) == 1):
        return as_period(given, name)
    instants = as_floats(numbers, name)
    if instants.ndim != 1 or not len(instants) or instants[0] <= 0 or (np.diff(instants) <= 0).any():
        raise ValueError(f"{name}: expected a period, or increasing instants above zero, in s, given {shown(given)}")
    if len(instants) > MOST_SAMPLES:
        raise ValueError(f"{name}: expected at most {MOST_SAMPLES} instants, given {len(instants)}")
    return tuple((instants if unit is None else converted(instants, unit, "s", name)).tolist())


def _check_times(times: Times, shortest: float, longest: float, name: str) -> None:
    if not isinstance(times, tuple):
        check_period(times, shortest, longest, name)
    elif times[0] > shortest * (1 + 1e-12) or times[-1] > longest * (1 + 1e-12):
        raise ValueError(
            f"{name}: expected instants within the runs, the first up to {shortest:g} s and the last up to {longest:g} s; "
            f"given {times[0]:g} and {times[-1]:g}"
        )


def in_words(every: Every) -> str:
    """When outputs are measured, such as "every 0.01 s", or "q every 0.01 s, X at 3 instants"."""
    of = every if isinstance(every, Mapping) else {"": every}
    words = {name: f"at {len(one)} instants" if isinstance(one, tuple) else f"every {one:g} s" for name, one in of.items()}
    return ", ".join(f"{name} {text}".strip() for name, text in words.items())


class SampleClock(NamedTuple):
    """Instants after the start at which outputs are measured.

    Attributes
    ----------
    instants : ndarray, (S,)
        s, increasing.
    outputs : ndarray of bool, (S, n_y), or None
        Which outputs are measured at each; None where all are.
    every : float or None
        The period, s, where all instants are multiples of one; else None.
    """

    instants: Array
    outputs: NDArray[np.bool_] | None
    every: float | None

    @classmethod
    def of(cls, every: Every, end: float, outputs: Sequence[str]) -> SampleClock:
        """The instants up to `end`, s, of all outputs, or of each of some of them."""
        if not isinstance(every, Mapping):
            return cls(_instants(every, end), None, None if isinstance(every, tuple) else every)
        tables = {name: _instants(of, end) for name, of in every.items()}
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
        period = every[finest] if len(instants) == len(tables[finest]) else None
        return cls(instants, None if flags.all() else flags, None if isinstance(period, tuple) else period)

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


def _instants(times: Times, end: float) -> Array:
    if isinstance(times, tuple):
        return np.array(times)
    return np.asarray(times * np.arange(1, int(sample_counts(np.array([[end]]), times)[0]) + 1), dtype=np.float64)
