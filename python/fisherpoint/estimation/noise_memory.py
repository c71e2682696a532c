"""Memory of the noise in samples: white beside first-order Gauss-Markov noise, found in residuals by restricted likelihood."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array

MOST_SAMPLES = 20_000
"""Samples from which the memory is found; further ones are not needed."""

BLOCK = 128
"""Samples that a filter advances at once."""

LONGEST = 1.0
"""Longest correlation time that is tried, as a share of the longest series."""

SHARES = (1.0, 0.9, 0.6, 0.3, 0.1)
"""Shares of the variance with memory that are tried first."""


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

    @property
    def innovation(self) -> float:
        """Variance of the innovations as a share of the noise's."""
        return self._middle / (1 + self.theta**2)

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
    rows = np.concatenate([np.arange(part.start, part.stop) for part in chosen])
    left, sizes, _ = np.linalg.svd(_unit_columns(jacobian[rows]), full_matrices=False)
    basis = left[:, sizes > 1e-8 * max(sizes.max(initial=0.0), 1e-300)]
    columns = np.column_stack([basis, e[rows]])
    lengths = [part.stop - part.start for part in chosen]
    if len(rows) - columns.shape[1] < 3:
        return NoiseMemory()
    ends = np.cumsum(lengths).tolist()
    parts = [slice(end - length, end) for end, length in zip(ends, lengths, strict=True)]
    times = np.geomspace(0.3, max(LONGEST * max(lengths), 1.0), 14)
    tried = {(0.0, 1.0): _deviance(NoiseMemory(), columns, parts)}

    def best_of(log_times: Array, shares: Sequence[float]) -> tuple[float, float]:
        for time in log_times:
            for share in shares:
                tried[time, share] = _deviance(NoiseMemory(float(np.exp(-1 / np.exp(time))), share), columns, parts)
        return min(tried, key=lambda key: tried[key])

    time, share = best_of(np.log(times), SHARES)
    width, part = float(np.log(times[1] / times[0])), 0.15
    for _ in range(4):
        if (time, share) == (0.0, 1.0):
            return NoiseMemory()
        width, part = width / 2, part / 2
        shares = [s for s in (share - part, share, share + part) if 0.01 <= s < 1] + [1.0] * (share + part >= 1)
        time, share = best_of(np.array([time - width, time, time + width]), shares)
    return NoiseMemory(float(np.exp(-1 / np.exp(time))), share)


def _first_samples(series: Sequence[slice]) -> Iterator[slice]:
    """The series of two samples and more, up to so many samples in all."""
    room = MOST_SAMPLES
    for part in series:
        length = min(part.stop - part.start, room)
        if length > 1:
            yield slice(part.start, part.start + length)
            room -= length


def _unit_columns(columns: Array) -> Array:
    length = np.linalg.norm(columns, axis=0)
    unit: Array = columns[:, length > 0] / length[length > 0]
    return unit


def _deviance(memory: NoiseMemory, columns: Array, parts: Sequence[slice]) -> float:
    """-2 log of the restricted likelihood but for a constant, of a basis of the derivatives and, last, the residuals."""
    white = np.empty_like(columns)
    for part in parts:
        white[part] = memory.whitened(columns[part]) / np.sqrt(memory.innovation)
        white[part.start] = columns[part.start]  # the first innovation is the noise itself
    triangle = np.abs(np.diag(np.linalg.qr(white, mode="r")))
    free = len(columns) - columns.shape[1] + 1
    log_det = (len(columns) - len(parts)) * np.log(memory.innovation)
    with np.errstate(divide="ignore"):
        return float(log_det + 2 * np.log(triangle[:-1]).sum() + 2 * free * np.log(triangle[-1]))


def slices_of(series: NDArray[np.intp]) -> list[slice]:
    """The slices of consecutive samples of the same number."""
    ends = [*(np.flatnonzero(np.diff(series)) + 1).tolist(), len(series)] if len(series) else []
    return [slice(begin, end) for begin, end in zip([0, *ends[:-1]], ends, strict=True)]
