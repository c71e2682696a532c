"""The sensors of a model's outputs as arrays, and rows in which white noise of the nominal size gives their information.

With J the derivatives of the noise-free outputs y and M the Fisher information of what is measured about y, F = J^T M J. The rows
R0^1/2 M^1/2 J have this F under the nominal covariance R0 = diag(a^2 + sum s^2), so that whatever takes rows and R0 goes on.
What is drawn anew in each run moves its outputs together: R + H P H^T takes the place of R.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array
from ..engine import _core
from .common_error import CommonError
from .growing import dense_rows, rows_beside_common
from .models import Noise, NoiseModel, NoiseOf, outputs_of
from .reading import averaged_information, past_limit, reading_information

MOST_DENSE = 2000
"""Numbers of one run whose noise has a memory, or is correlated, and grows with the outputs: there R is a whole matrix."""


@dataclass(frozen=True, eq=False)
class Sensors:
    """The sensors of n_y outputs; those that are not measured have unit white noise.

    Attributes
    ----------
    std, relative, resolution, lower, upper : ndarray, (n_y,)
        As in `Noise`.
    parts : tuple of (output, std, correlation time)
        Gauss-Markov parts.
    correlation : ndarray, (n_y, n_y)
        Of the white parts.
    measured : ndarray of bool, (n_y,)
    """

    std: Array
    relative: Array
    resolution: Array
    lower: Array
    upper: Array
    parts: tuple[tuple[int, float, float], ...]
    correlation: Array
    measured: NDArray[np.bool_]

    @classmethod
    def of(cls, noise: NoiseOf, names: Sequence[str]) -> Sensors:
        """The sensors of the outputs of these names."""
        given = outputs_of(noise)
        each = [_noise_of(given, name) for name in names]
        correlation = np.eye(len(names))
        for (i, j), value in (noise.pairs(names) if isinstance(noise, NoiseModel) else {}).items():
            correlation[i, j] = correlation[j, i] = value
        return cls(
            np.array([one.std for one in each]),
            np.array([one.relative for one in each]),
            np.array([one.resolution for one in each]),
            np.array([-np.inf if one.limits[0] is None else one.limits[0] for one in each]),
            np.array([np.inf if one.limits[1] is None else one.limits[1] for one in each]),
            tuple((j, part.std, part.correlation_time) for j, one in enumerate(each) for part in one.parts),
            correlation,
            np.array([name in given for name in names]),
        )

    @cached_property
    def white(self) -> bool:
        """Whether all noise is white, always the same and not correlated, so that R0 says all."""
        limited = np.isfinite(self.lower) | np.isfinite(self.upper)
        return self.independent and not (self.relative.any() or self.resolution.any() or limited.any())

    @cached_property
    def independent(self) -> bool:
        """Whether the readings are independent of each other."""
        return not self.parts and bool((self.correlation == np.eye(len(self.std))).all())

    @cached_property
    def growing(self) -> bool:
        """Whether noise grows with an output."""
        return bool(self.relative.any())

    @cached_property
    def memory_variance(self) -> Array:
        """Variances (n_y,) of what has a memory."""
        found = np.zeros(len(self.std))
        for output, std, _ in self.parts:
            found[output] += std**2
        return found

    @cached_property
    def nominal_std(self) -> Array:
        """Standard deviations (n_y,) of R0, positive."""
        return np.sqrt(np.square(self.std) + self.memory_variance)

    def white_std(self, y: Array) -> Array:
        """Standard deviations of the white parts at noise-free outputs (..., n_y), with that of rounding."""
        return np.sqrt(np.square(self.std) + np.square(self.relative * y) + np.square(self.resolution) / 12)

    @cached_property
    def uneven(self) -> NDArray[np.bool_]:
        """Outputs (n_y,) whose readings inform unevenly, by where the output lies: rounded and limited ones."""
        return np.asarray((self.resolution > 0) | np.isfinite(self.lower) | np.isfinite(self.upper))

    def precision(self, y: Array, spread: Array | None = None) -> Array:
        """Fisher information of independent readings about noise-free outputs (..., n_y), of this shape.

        With standard deviations `spread` of the outputs, that of uneven readings is averaged over where they lie.
        """
        found = np.empty(y.shape)
        for j in range(len(self.std)):
            numbers = (self.std[j], self.relative[j], self.resolution[j], self.lower[j], self.upper[j])
            std, relative, resolution, lower, upper = map(float, numbers)
            if spread is not None and self.uneven[j]:
                found[..., j] = averaged_information(y[..., j], spread[..., j], std, relative, resolution, lower, upper)
            else:
                found[..., j] = reading_information(y[..., j], std, relative, resolution, lower, upper)
        return found

    def past_limits(self, y: Array, spread: Array) -> Array:
        """Information about noise-free outputs (..., n_y), beside 1 of the prior, that they are past a limit: `past_limit`."""
        found = np.zeros(y.shape)
        for j in np.flatnonzero(np.isfinite(self.lower) | np.isfinite(self.upper)):
            wide = float(np.hypot(self.std[j], self.resolution[j] / np.sqrt(12)))
            found[..., j] = past_limit(y[..., j], spread[..., j], wide, float(self.lower[j]), float(self.upper[j]))
        return found

    def whitened(
        self, columns: Array, times: Array, y: Array, measured: NDArray[np.bool_], threads: int = 1
    ) -> tuple[Array, Array]:
        """R^-1/2 of columns, by the Cholesky factor of R in the order of time, and log det R; of Gaussian noise alone.

        Parameters
        ----------
        columns : ndarray, (K, N, n_y, C)
            Residuals, and derivatives.
        times : ndarray, (K, N)
            s, not descending.
        y : ndarray, (K, N, n_y)
            Noise-free outputs, which noise may grow with.
        measured : ndarray of bool, (K, N, n_y)
            Where not, the result is zero.

        Returns
        -------
        white : ndarray, (K, N, n_y, C)
        log_det : ndarray, (K,)
            Of what is measured.
        """
        std = np.ascontiguousarray(np.broadcast_to(self.white_std(y), measured.shape))
        found = _core.whiten(columns, times, std, measured, self.correlation, list(self.parts), threads)
        return np.asarray(found[0]), np.asarray(found[1])

    def covariance(self, times: Array, y: Array) -> Array:
        """R of everything (K, N n_y, N n_y) at times (K, N) and noise-free outputs (K, N, n_y), a whole matrix."""
        count, n, n_y = y.shape
        std = self.white_std(y)
        r = np.zeros((count, n, n_y, n, n_y))
        here = np.arange(n)
        r[:, here, :, here, :] = (std[..., :, None] * self.correlation * std[..., None, :]).swapaxes(0, 1)
        lag = np.abs(times[:, :, None] - times[:, None, :])
        for output, size, correlation_time in self.parts:
            r[:, :, output, :, output] += size**2 * np.exp(-lag / correlation_time)
        return r.reshape(count, n * n_y, n * n_y)

    def rows(
        self,
        j: Array,
        moved: Array | None,
        times: Array,
        y: Array,
        measured: NDArray[np.bool_],
        spread: Array | None = None,
        threads: int = 1,
    ) -> Array:
        """M^1/2 J of K runs: rows whose squares add up to the information, zero where nothing is measured.

        Parameters
        ----------
        j : ndarray, (K, N, n_y, p)
        moved : ndarray, (K, N, n_y, q), or None
            By how much outputs move with a standard deviation of what is drawn anew.
        times, y, measured
            As in `whitened`.
        spread : ndarray, (K, N, n_y), optional
            As in `precision`.

        Raises
        ------
        ValueError
            For noise that grows and is not independent, of runs of more than `MOST_DENSE` numbers.
        """
        there = measured[..., None]
        j, y = np.where(there, j, 0.0), np.where(measured, y, 0.0)
        moved = None if moved is None else np.where(there, moved, 0.0)
        if self.independent:
            found = self._independent(j, moved, y, None if spread is None else np.where(measured, spread, 0.0))
        elif self.growing:
            found = self._dense(j, moved, times, y, measured)
        else:
            columns = j if moved is None else np.concatenate([j, moved], axis=3)
            found, _ = self.whitened(columns, times, y, measured, threads)
            if moved is not None:
                found = _beside_common(found[..., : j.shape[3]], found[..., j.shape[3] :])
        return found if moved is None else np.where(there, found, 0.0)

    def _independent(self, j: Array, moved: Array | None, y: Array, spread: Array | None) -> Array:
        exact = not self.uneven.any()
        if moved is None or not (self.growing and exact):
            # Beside what is common, rounded and limited readings count as normal ones that inform as much.
            scale = np.sqrt(self.precision(y, spread))[..., None]
            if moved is None:
                return np.asarray(scale * j)
            return _beside_common(scale * j, scale * moved)
        variance = np.square(self.white_std(y)).reshape(len(y), -1)
        slope = (np.square(self.relative) * y).reshape(len(y), -1)
        flat, by = (array.reshape(len(array), -1, array.shape[3]) for array in (j, moved))
        return rows_beside_common(flat, by, variance, slope).reshape(j.shape)

    def _dense(self, j: Array, moved: Array | None, times: Array, y: Array, measured: NDArray[np.bool_]) -> Array:
        count, n, n_y, p = j.shape
        if n * n_y > MOST_DENSE:
            raise ValueError(
                f"noise: expected runs of at most {MOST_DENSE} numbers where noise that grows has a memory or is correlated, "
                f"given {n * n_y}"
            )
        white, found = self.white_std(y), np.empty(j.shape)
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = np.where(white > 0, np.square(self.relative) * y / white, 0.0)
        for k in range(count):
            flat = measured[k].ravel()
            r = self.covariance(times[k : k + 1], y[k : k + 1])[0]
            if moved is not None:
                by = moved[k].reshape(n * n_y, -1)
                r = r + by @ by.T
            turned = np.zeros((n, n_y, n, n_y))  # d std_k times the row of the white parts' covariance
            here = np.arange(n)
            turned[here, :, here, :] = slope[k][:, :, None] * self.correlation * white[k][:, None, :]
            g = turned.reshape(n * n_y, n * n_y)[np.ix_(flat, flat)]
            rows = np.zeros((n * n_y, p))
            rows[flat] = dense_rows(j[k].reshape(n * n_y, p)[flat], r[np.ix_(flat, flat)], g)
            found[k] = rows.reshape(n, n_y, p)
        return found


def _beside_common(j: Array, moved: Array) -> Array:
    """White rows (K, N, n_y, p), with what moves outputs together beside the noise."""
    flat, by = (array.reshape(len(array), -1, array.shape[3]) for array in (j, moved))
    return CommonError.of(by).whitened(flat).reshape(j.shape)


def _noise_of(given: Mapping[str, float | Noise], name: str) -> Noise:
    one = given.get(name, 1.0)
    if isinstance(one, Noise):
        return one
    found = Noise(1.0)
    object.__setattr__(found, "std", one)  # which may be zero: of a simulated sensor
    return found
