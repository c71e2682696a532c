"""Memory of the noise in samples: white beside first-order Gauss-Markov noise, found in residuals by restricted likelihood."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array
from .noise_forms import MEMORY, WHITE, WHITE_AND_MEMORY, most_likely
from .restricted_likelihood import RestrictedLikelihood

MOST_SAMPLES = 20_000
"""Samples from which the memory is found; further ones are not needed."""

BLOCK = 128
"""Samples that a filter advances at once."""


class NoiseMemory(NamedTuple):
    """Noise with the autocorrelation `share` phi^k at lag k, of one output.

    It is e_t = phi e_(t-1) + u_t - theta u_(t-1) of white innovations u.
    """

    phi: float = 0.0
    share: float = 1.0

    @property
    def samples(self) -> float:
        """Correlation time in samples."""
        return -1 / float(np.log(self.phi)) if self.phi > 0 else 0.0

    @property
    def _middle(self) -> float:
        return 1 + self.phi**2 - 2 * self.share * self.phi**2

    @property
    def theta(self) -> float:
        side = (1 - self.share) * self.phi
        return 2 * side / (self._middle + float(np.sqrt(max(self._middle**2 - 4 * side**2, 0.0))))

    def whitened(self, columns: Array) -> Array:
        """Innovations u of one series of columns (n, p)."""
        changed = columns.copy()
        changed[1:] -= self.phi * columns[:-1]
        return _recursion(changed, self.theta)

    def adjoint(self, columns: Array) -> Array:
        """B^T x of one series of columns (n, p), where e = B u."""
        backwards = _recursion(columns[::-1], self.phi)
        backwards[1:] -= self.theta * _recursion(columns[::-1], self.phi)[:-1]
        return backwards[::-1]


def _recursion(x: Array, a: float) -> Array:
    """y_t = a y_(t-1) + x_t of columns (n, p)."""
    n, p = x.shape
    if a == 0.0:
        return x.copy()
    size = min(BLOCK, n)
    blocks = np.zeros((-(-n // size) * size, p))
    blocks[:n] = x
    steps = np.arange(size)
    triangle = np.where(steps[:, None] >= steps, a ** np.maximum(steps[:, None] - steps, 0), 0.0)
    y = triangle @ blocks.reshape(-1, size, p)
    decay = a ** (steps + 1.0)
    for k in range(1, len(y)):
        y[k] += decay[:, None] * y[k - 1, -1]
    return y.reshape(-1, p)[:n]


def memory_of(e: Array, jacobian: Array, series: Sequence[slice]) -> NoiseMemory:
    """The memory of the noise that has the largest restricted likelihood, of Gaussian noise.

    Parameters
    ----------
    e : ndarray, (n,)
        Residuals of one output in units of any one standard deviation.
    jacobian : ndarray, (n, p)
        Their derivatives. What the unknowns may have taken up counts for nothing: the estimate has no bias from the fit.
    series : sequence of slice
        Consecutive samples.
    """
    chosen = list(_first_samples(series))
    if not chosen:
        return NoiseMemory()
    rows, times, numbers = (
        np.concatenate(of)
        for of in (
            [np.arange(part.start, part.stop) for part in chosen],
            [np.arange(part.stop - part.start, dtype=np.float64) for part in chosen],
            [np.full(part.stop - part.start, k) for k, part in enumerate(chosen)],
        )
    )
    likelihood = RestrictedLikelihood.of(e[rows], jacobian[rows], times, np.ones(len(rows)), numbers)
    if likelihood.degrees_of_freedom < 3:
        return NoiseMemory()
    best = min((most_likely(likelihood, form) for form in (WHITE, MEMORY, WHITE_AND_MEMORY)), key=lambda one: one.deviance)
    if not best.noise.parts:
        return NoiseMemory()
    (std, time) = best.noise.parts[0]
    return NoiseMemory(float(np.exp(-1 / time)), float(std**2 / (std**2 + best.noise.std**2)))


def _first_samples(series: Sequence[slice]) -> Iterator[slice]:
    """The series of two samples and more, up to so many samples in all."""
    room = MOST_SAMPLES
    for part in series:
        length = min(part.stop - part.start, room)
        if length > 1:
            yield slice(part.start, part.start + length)
            room -= length


def slices_of(series: NDArray[np.intp]) -> list[slice]:
    """The slices of consecutive samples of the same number."""
    ends = [*(np.flatnonzero(np.diff(series)) + 1).tolist(), len(series)] if len(series) else []
    return [slice(begin, end) for begin, end in zip([0, *ends[:-1]], ends, strict=True)]
