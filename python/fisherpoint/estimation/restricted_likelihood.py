"""The noise of one output by restricted maximum likelihood: of what residuals hold that no change of the unknowns explains.

With whitened derivatives R^-1/2 J and residuals R^-1/2 e, the restricted likelihood of normal noise is

    -2 log L = log det R + log det J^T R^-1 J + e^T (R^-1 - R^-1 J (J^T R^-1 J)^-1 J^T R^-1) e,

up to a constant (Patterson and Thompson 1971): variances have no bias from the unknowns that were fitted. R is of white noise that
may grow with the output, and of parts with a memory; its whitening takes a time that grows as the number of samples.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array
from ..engine import _core
from .block_basis import basis_of, block_basis
from .bordered import Bordered

MOST_SAMPLES = 100_000
"""Samples from which noise is found; further ones are not needed."""


@dataclass(frozen=True, eq=False)
class OutputNoise:
    """Noise of one output as numbers: standard deviation of the white part, its growth, and parts (std, correlation time)."""

    std: float
    relative: float = 0.0
    parts: tuple[tuple[float, float], ...] = ()

    def scaled(self, factor: float) -> OutputNoise:
        """All of it so many times as large."""
        parts = tuple((std * factor, time) for std, time in self.parts)
        return OutputNoise(self.std * factor, self.relative * factor, parts)


@dataclass(frozen=True, eq=False)
class RestrictedLikelihood:
    """The restricted likelihood of the noise of one output.

    Attributes
    ----------
    columns : ndarray, (n, c + 1)
        An orthonormal basis of the derivatives, and last the residuals, series after series.
    times, outputs : ndarray, (n,)
        s within the series, and predicted outputs, which noise may grow with.
    lengths : ndarray of int
        Number of samples of each series.
    rank : int
        How many vectors the basis has.
    layout : Bordered or None
        How it is stored, where local parameters have values in some of the series alone: a series is of one block.
    """

    columns: Array
    times: Array
    outputs: Array
    lengths: NDArray[np.intp]
    rank: int
    layout: Bordered | None = None

    @classmethod
    def of(
        cls,
        e: Array,
        jacobian: Array,
        times: Array,
        outputs: Array,
        series: NDArray[np.intp],
        places: NDArray[np.intp] | None = None,
    ) -> RestrictedLikelihood:
        """The likelihood of residuals (n,) with derivatives (n, P), times, outputs, and the number of each sample's series.

        With `places` (n, w) of the values of local parameters that a sample depends on, its derivatives by these are the last w.
        """
        some = slice(MOST_SAMPLES)
        e, jacobian, times, outputs, series = e[some], jacobian[some], times[some], outputs[some], series[some]
        lengths = np.unique(series, return_counts=True)[1]
        if places is None:
            basis = basis_of(jacobian)
            return cls(np.column_stack([basis, e]), times, outputs, lengths, int(basis.shape[1]))
        _, own = np.unique(places[some], return_inverse=True)
        layout = Bordered(own.reshape(len(e), -1), jacobian.shape[1] - places.shape[1], int(own.max(initial=-1)) + 1)
        columns, layout, rank = block_basis(jacobian, layout)
        return cls(np.column_stack([columns, e]), times, outputs, lengths, rank, layout)

    @property
    def degrees_of_freedom(self) -> int:
        """Samples less what the unknowns take up."""
        return len(self.columns) - self.rank

    @cached_property
    def spans(self) -> Array:
        """Duration of each series, s; zero of one sample."""
        firsts = np.cumsum(self.lengths) - self.lengths
        spans: Array = self.times[firsts + self.lengths - 1] - self.times[firsts]
        return spans

    @cached_property
    def step(self) -> float:
        """Median time between neighbouring samples of a series, s; zero where there are none."""
        inner = np.ones(len(self.times) - 1, dtype=bool)
        inner[np.cumsum(self.lengths)[:-1] - 1] = False
        steps = np.diff(self.times)[inner]
        return float(np.median(steps)) if len(steps) else 0.0

    def deviance(self, noise: OutputNoise) -> float:
        """-2 log L of the noise."""
        log_det, square = self._parts(noise)
        return log_det + square

    def best_scale(self, noise: OutputNoise) -> tuple[OutputNoise, float]:
        """The most likely one of all noises that are larger or smaller than the given one alone, and -2 log L of it."""
        log_det, square = self._parts(noise)
        degrees = max(self.degrees_of_freedom, 1)
        if not square > 0 or not np.isfinite(log_det):
            return noise, np.inf
        return noise.scaled(np.sqrt(square / degrees)), log_det + degrees * (1 + np.log(square / degrees))

    def _parts(self, noise: OutputNoise) -> tuple[float, float]:
        """log det R + log det J^T R^-1 J, and the sum of squares that is left."""
        white, log_det = self._whitened(noise)
        if not np.isfinite(white).all():
            return np.inf, 0.0
        if self.layout is not None:
            tangent = self.layout.tangent(white[None, :, -1], white[None, :, :-1])
            logs = float(np.log(tangent.factor.pivots()).sum() + np.log(tangent.size).sum())
            return log_det + 2 * logs, max(float(white[:, -1] @ white[:, -1] - np.square(tangent.along).sum()), 0.0)
        triangle = np.abs(np.diag(np.linalg.qr(white, mode="r")))
        with np.errstate(divide="ignore"):
            return log_det + 2 * float(np.log(triangle[:-1]).sum()), float(triangle[-1] ** 2)

    def _whitened(self, noise: OutputNoise) -> tuple[Array, float]:
        std = np.sqrt(noise.std**2 + np.square(noise.relative * self.outputs))
        if not noise.parts:
            return self.columns / std[:, None], 2 * float(np.log(std).sum())
        parts = [(0, size, time) for size, time in noise.parts]
        white, log_det = np.empty_like(self.columns), 0.0
        firsts = np.cumsum(self.lengths) - self.lengths
        for n in np.unique(self.lengths):
            rows = firsts[self.lengths == n][:, None] + np.arange(n)
            there = np.ones((*rows.shape, 1), dtype=bool)
            columns = np.ascontiguousarray(self.columns[rows][:, :, None, :])
            found, logs = _core.whiten(columns, self.times[rows], std[rows][:, :, None], there, np.eye(1), parts, 1)
            white[rows] = np.asarray(found)[:, :, 0]
            log_det += float(np.sum(logs))
        return white, log_det
