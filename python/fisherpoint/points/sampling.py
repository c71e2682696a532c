"""Runs whose outputs are sampled at given instants, whatever their segments are: held segments divided at these.

An instant that is the end of a segment but for rounding is that end. The other way round, held segments and a period are found
again from the parts: files and reports have these, as an operator programs them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array

SAME = 1e-9
"""Share of the shortest segment or step between samples, up to which instants are the same."""

MANY, DENSE = 60, 4
"""Segments of a run, and samples of each hold on average, from which on a run is written by what it holds and its period."""

_NONE = -2


class Divided(NamedTuple):
    """Parts of the held segments of K runs, E at most of each.

    Attributes
    ----------
    dt : ndarray, (K, E)
        Durations, s; 0 behind the last part of a run.
    of : ndarray of int, (K, E)
        The segment that each part is of.
    measured : ndarray of bool, (K, E)
        Which parts are sampled at their ends.
    ends : ndarray of int, (K, N)
        The part at whose end each held segment ends.
    """

    dt: Array
    of: NDArray[np.intp]
    measured: NDArray[np.bool_]
    ends: NDArray[np.intp]


def divided(dt: Array, times: Array, every: float | None = None) -> Divided:
    """Held segments of K runs divided at instants.

    What is later than the end of a run prolongs its last segment.

    Parameters
    ----------
    dt : ndarray, (K, N)
        Durations of the segments, s; 0 behind the last one of a run.
    times : ndarray, (K, S)
        Instants, s, increasing; inf where there are no more.
    every : float, optional
        How long a part from one sample to the next lasts, s, without the rounding of differences.
    """
    if len(dt) > 1 and (dt == dt[0]).all() and (times == times[0]).all():  # one clock for all
        one = divided(dt[:1], times[:1], every)
        shape = len(dt), one.dt.shape[1]
        ends = np.broadcast_to(one.ends, dt.shape)
        return Divided(np.broadcast_to(one.dt, shape), np.broadcast_to(one.of, shape), np.broadcast_to(one.measured, shape), ends)
    count, n = dt.shape
    ends = np.where(dt > 0, np.cumsum(dt, axis=1), np.inf)
    with np.errstate(invalid="ignore"):  # behind the ends of shorter runs
        steps = np.diff(times, axis=1, prepend=0.0) if every is None else np.full((count, times.shape[1]), every)
    same = same_within(dt, np.where(times < np.inf, steps, np.inf).min(axis=1))[:, None]

    # All instants in order; an end and a sample that are the same are one, and numbers of both are kept, from 1 on.
    both = np.concatenate([ends, times], axis=1)
    order = np.argsort(both, axis=1, kind="stable")
    t = np.take_along_axis(both, order, axis=1)
    finite = t < np.inf
    with np.errstate(invalid="ignore"):
        first = finite & (np.diff(t, axis=1, prepend=-np.inf) > same)
    place = np.cumsum(first, axis=1) - 1
    k, m = np.nonzero(finite)
    shape, at, number = (count, int(place.max()) + 1), place[k, m], order[k, m]
    instant, end, sample = np.full(shape, np.inf), np.full(shape, _NONE), np.full(shape, _NONE)
    instant[k, at] = t[k, m]
    end[k[number < n], at[number < n]] = number[number < n] + 1
    sample[k[number >= n], at[number >= n]] = number[number >= n] - n + 1

    def before(numbers: NDArray[np.intp]) -> NDArray[np.intp]:
        return np.concatenate([np.zeros((count, 1), dtype=np.intp), numbers[:, :-1]], axis=1)

    there = instant < np.inf
    with np.errstate(invalid="ignore"):
        parts = np.where(there, np.diff(instant, axis=1, prepend=0.0), 0.0)
    to_next = (sample > 0) & (before(sample) == sample - 1)
    parts = np.where(to_next, np.take_along_axis(steps, np.maximum(sample - 1, 0), axis=1), parts)
    whole = (end > 0) & (before(end) == end - 1)
    parts = np.where(whole, np.take_along_axis(dt, np.maximum(end - 1, 0), axis=1), parts)
    of = np.minimum(np.cumsum(before((end > 0).astype(np.intp)), axis=1), np.count_nonzero(dt, axis=1)[:, None] - 1)
    places = np.tile(there.sum(axis=1)[:, None] - 1, (1, n))
    k, m = np.nonzero(end > 0)
    places[k, end[k, m] - 1] = m
    return Divided(parts, of, sample > 0, places)


def multiples(every: float, counts: NDArray[np.intp]) -> Array:
    """The first `counts` (K,) multiples of a period, (K, S); inf behind them."""
    number = np.arange(1, int(counts.max(initial=0)) + 1)
    return np.where(number <= counts[:, None], every * number, np.inf)


def sample_counts(dt: Array, every: float) -> NDArray[np.intp]:
    """How many multiples of a period there are until the ends of runs with segments dt (K, N)."""
    return np.asarray(np.floor((dt.sum(axis=1) + same_within(dt, every)) / every), dtype=np.intp)


def same_within(dt: Array, step: Array | float) -> Array:
    """Distance (K,), s, within which instants are the same, of runs with segments dt (K, N) and samples a step apart."""
    shortest = np.minimum(np.where(dt > 0, dt, np.inf).min(axis=1), step)
    return np.asarray(np.maximum(SAME * shortest, 8 * np.finfo(float).eps * dt.sum(axis=1)))


class Holds(NamedTuple):
    """Runs as they are programmed.

    Attributes
    ----------
    u : ndarray, (K, N, n_u)
        Inputs of the holds, or of the segments of runs that are as they were.
    dt : ndarray, (K, N)
        Durations, s.
    measured : ndarray of bool, (K, N)
        Which are sampled at their ends.
    every : ndarray, (K, 1) or (K, n_y)
        Periods at which outputs are measured, s: (K, 1) where all are measured in each sample. NaN of an output that is not
        measured, and of all outputs of runs that are as they were.
    """

    u: Array
    dt: Array
    measured: NDArray[np.bool_]
    every: Array

    @property
    def dense(self) -> NDArray[np.bool_]:
        """Which runs have periods, (K,)."""
        return np.asarray(~np.isnan(self.every).all(axis=1))

    @property
    def by_output(self) -> bool:
        """Whether outputs have different periods."""
        return bool((self.every[:, :1] != self.every)[self.dense].any())


def holds_of(u: Array, dt: Array, readings: NDArray[np.bool_]) -> Holds:
    """Densely sampled runs by what they hold, and others as they are.

    Parameters
    ----------
    u : ndarray, (K, N, n_u)
    dt : ndarray, (K, N)
        s.
    readings : ndarray of bool, (K, N, 1) or (K, N, n_y)
        Which outputs are measured at the ends of segments, as `Runs.readings`.
    """
    every, parts, measured = np.full((len(dt), readings.shape[2]), np.nan), [], np.asarray(readings.any(axis=2))
    for k, n in enumerate(np.count_nonzero(dt, axis=1).tolist()):
        held, durations, flags = u[k, :n], dt[k, :n], measured[k, :n]
        last = ~flags | np.append((np.diff(held, axis=0) != 0).any(axis=1), True)  # ends that are not sampled are there to stay
        dense = n >= MANY and flags.sum() >= DENSE * last.sum()
        periods = _periods(durations, readings[k, :n]) if dense else None
        if periods is not None:
            every[k], period = periods, float(np.nanmin(periods))
            ends = np.cumsum(durations)[last]
            whole, durations = np.diff(np.rint(ends / period), prepend=0.0), np.diff(ends, prepend=0.0)
            near = np.abs(durations - whole * period) <= SAME * period  # without the rounding of sums
            durations = np.where(near, [float(f"{one:.12g}") for one in whole * period], durations)
            held, flags = held[last], flags[last]
        parts.append((held, durations, flags))
    return Holds(*(segments_of(parts) if parts else (u, dt, measured)), every)


def segments_of(parts: Sequence[tuple[Array, Array, NDArray[np.bool_]]]) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Segments u (K, N, n_u), dt (K, N) and measured (K, N), or (K, N, n_y), of runs of different lengths, a tuple each."""
    shape, of_one = (len(parts), max(len(dt) for _, dt, _ in parts)), parts[0][2].shape[1:]
    u, dt, measured = np.zeros((*shape, parts[0][0].shape[1])), np.zeros(shape), np.zeros((*shape, *of_one), dtype=bool)
    for k, (held, durations, flags) in enumerate(parts):
        u[k, : len(held)], u[k, len(held) :] = held, held[-1]
        dt[k, : len(held)], measured[k, : len(held)] = durations, flags
    return u, dt, measured


def _periods(dt: Array, readings: NDArray[np.bool_]) -> Array | None:
    """The period of each output in a run with segments dt (N,), NaN of those that it has none of; None where one is irregular."""
    of = [_period(dt, flags) if flags.any() else np.nan for flags in readings.T]
    return None if None in of else np.array(of, dtype=np.float64)


def _period(dt: Array, measured: NDArray[np.bool_]) -> float | None:
    """The period at all multiples of which a run with segments dt (N,) is sampled, up to its end; None where there is none."""
    times = np.cumsum(dt)
    period = float(times[int(np.argmax(measured))])
    nearest = float(dt[np.argmin(np.abs(dt - period))])
    period = nearest if abs(nearest - period) <= SAME * period else float(f"{period:.12g}")  # without the rounding of sums
    found = times[measured]
    regular = np.abs(found - period * np.arange(1, len(found) + 1)) <= SAME * period + 8 * np.finfo(float).eps * times[-1] * len(dt)
    return period if regular.all() and len(found) == int(sample_counts(dt[None], period)[0]) else None
