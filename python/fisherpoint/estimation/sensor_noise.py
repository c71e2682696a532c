"""Noise that is more than white, as the samples of data have it: with a memory, or of independent readings of any kind."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array
from ..data.measurements import Measurements
from ..data.record import Record
from ..noise.likelihood import ReadingLikelihood
from ..noise.score_kurtosis import score_kurtosis
from ..noise.sensors import Sensors


@dataclass(frozen=True, eq=False)
class SensorNoise:
    """The noise of N samples in a row.

    Attributes
    ----------
    sensors : Sensors
    times : ndarray, (N,)
        s, of each sample in its run or record.
    series : ndarray of int, (N,)
        Number of each sample's run or record; a point has a number of its own.
    outputs : ndarray, (N, n_y)
        Noise-free outputs at which noise that grows is taken, where readings are weighed as normal ones.
    normal : bool
        Whether they are: with a memory, correlated, or beside what is drawn anew. Otherwise the likelihood is that of each reading.
    threads : int
    """

    sensors: Sensors
    times: Array
    series: NDArray[np.intp]
    outputs: Array
    normal: bool
    threads: int

    @classmethod
    def of(cls, sensors: Sensors, data: Sequence[Measurements | Record], anew: bool, threads: int) -> SensorNoise | None:
        """The noise of data, beside what is drawn `anew` in each point or run or not; None of white noise.

        Raises
        ------
        ValueError
            For limits beside what is drawn anew.
        """
        if sensors.white:
            return None
        if anew and (np.isfinite(sensors.lower).any() or np.isfinite(sensors.upper).any()):
            raise ValueError("limits: expected none beside varies or starts that deviate, given both")
        times, series = times_and_series(data)
        outputs = np.zeros((len(times), len(sensors.std)))
        return cls(sensors, times, series, outputs, anew or not sensors.independent, threads)

    @property
    def changes(self) -> bool:
        """Whether weights change with the outputs."""
        return self.normal and self.sensors.growing

    def at(self, y: Array) -> SensorNoise:
        """This at noise-free outputs (N, n_y)."""
        return replace(self, outputs=y)

    @property
    def covariance(self) -> Array:
        """Covariances of each sample, (N, n_y, n_y), or (n_y, n_y) where all have the same."""
        sensors = self.sensors
        std = sensors.white_std(self.outputs if self.changes else self.outputs[:1])
        found = std[:, :, None] * sensors.correlation * std[:, None, :] + np.diag(sensors.memory_variance)
        return np.asarray(found if self.changes else found[0])

    @cached_property
    def _groups(self) -> list[NDArray[np.intp]]:
        """Samples (K, N) of the series of two samples and more, those of one length together."""
        _, first, lengths = np.unique(self.series, return_index=True, return_counts=True)
        return [first[lengths == n][:, None] + np.arange(n) for n in np.unique(lengths) if n > 1]

    def whiten_series(self, measured: NDArray[np.bool_], given: Sequence[Array], white: Sequence[Array]) -> None:
        """Replace in `white` the rows of series with a memory by R^-1/2 of those of `given`, all (B, N, n_y, ...)."""
        if not self.sensors.parts:
            return
        columns = np.concatenate([a.reshape(*a.shape[:3], -1) for a in given], axis=3)
        columns = np.where(measured[:, :, None], columns, 0.0)
        for rows in self._groups:
            some = columns[:, rows].reshape(-1, *rows.shape[1:], *columns.shape[2:])
            count = len(columns)
            times, y = (np.tile(of[rows], (count, *(1,) * of.ndim)) for of in (self.times, self.outputs))
            there = np.tile(measured[rows], (count, 1, 1))
            found, _ = self.sensors.whitened(np.ascontiguousarray(some), times, y, there, self.threads)
            found = found.reshape(count, *rows.shape, *columns.shape[2:])
            first = 0
            for a in white:
                width = int(np.prod(a.shape[3:]))
                a[:, rows] = found[..., first : first + width].reshape(count, *rows.shape, *a.shape[2:])
                first += width

    def likelihoods(self, y: Array, measured: NDArray[np.bool_]) -> Readings:
        """The likelihoods of readings y (B, N, n_y)."""
        outputs = np.flatnonzero(measured.any(axis=0))
        given = {int(j): np.where(measured[:, j], y[:, :, j], 0.0) for j in outputs}
        of = {j: ReadingLikelihood.of(readings.ravel(), self.sensors, j).shaped(readings.shape) for j, readings in given.items()}
        return Readings(self.sensors, measured, of)

    def kurtosis(self, y: Array, output: int) -> Array:
        """Fourth moments (N,) of the score residuals of one output at noise-free outputs y (N, n_y)."""
        return np.full(len(y), 3.0) if self.normal else score_kurtosis(y[:, output], self.sensors, output)


def times_and_series(data: Sequence[Measurements | Record]) -> tuple[Array, NDArray[np.intp]]:
    """Times (N,) of the samples in their run or record, s, and the number (N,) of that; a point has a number of its own."""
    times, series, first = [], [], 0
    for part in data:
        if isinstance(part, Record):
            own, at = np.zeros(len(part), dtype=np.intp), part.t
        else:
            runs = part.runs
            own, at = np.nonzero(runs.measured)[0], np.cumsum(runs.dt, axis=1)[runs.measured]
        times.append(at)
        series.append(first + own)
        first += int(own.max(initial=-1)) + 1
    return np.concatenate(times), np.concatenate(series)


@dataclass(frozen=True, eq=False)
class Readings:
    """Independent readings of B problems and N samples, and their likelihood, by the number of the output."""

    sensors: Sensors
    measured: NDArray[np.bool_]
    likelihoods: dict[int, ReadingLikelihood]

    def some(self, rows: NDArray[np.intp]) -> Readings:
        """Those of some of the problems."""
        return replace(self, likelihoods={j: of.some(rows) for j, of in self.likelihoods.items()})

    def _each(self) -> Iterator[tuple[int, ReadingLikelihood, NDArray[np.bool_]]]:
        for j, of in self.likelihoods.items():
            yield j, of, self.measured[:, j]

    def deviance(self, y: Array, dy: Array) -> tuple[Array, Array]:
        """Deviance residuals (B, N, n_y) and their Jacobian (B, N, n_y, P) at noise-free outputs y and their derivatives."""
        r, slope = np.zeros(y.shape), np.zeros(y.shape)
        for j, of, there in self._each():
            found = of.residuals(y[:, :, j])
            r[:, :, j], slope[:, :, j] = (np.where(there, a, 0.0) for a in found)
        return r, dy * slope[..., None]

    def rows(self, y: Array, dy: Array) -> Array:
        """Rows J (B, N, n_y, P) with the information J^T J."""
        return np.asarray(dy * (np.sqrt(self.sensors.precision(y)) * self.measured)[..., None])

    def scores(self, y: Array, dy: Array) -> tuple[Array, Array]:
        """Score residuals (B, N, n_y) and rows J (B, N, n_y, P) with the information J^T J."""
        root = np.sqrt(self.sensors.precision(y)) * self.measured
        e = np.zeros(y.shape)
        for j, of, there in self._each():
            _, slope = of.logarithm(y[:, :, j])
            here = there & (root[:, :, j] > 0)
            e[:, :, j] = np.divide(-slope, root[:, :, j], out=np.zeros(slope.shape), where=here)
        return e, dy * root[..., None]
