"""The likelihood of independent readings: residuals whose squares add up to a deviance, and scores.

A reading m of the noise-free output y has the log-likelihood l(y): of a normal density whose standard deviation may grow with y, or
of the probability of a cell of width q, or of a limit. r = sign(y - y*) sqrt(2 (l(y*) - l(y))), with y* where l is largest, has the
slope -l' / r: least squares of r maximises the likelihood. The score residual -l' / sqrt(w), with the Fisher information w, has
mean 0 and variance 1 whatever the sensor, and the slope sqrt(w) on average.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array
from .reading import FINE, TILED, rounded_limits
from .sensors import Sensors

LOG_ROOT = 0.5 * np.log(2 * np.pi)

NEAR = 1e-4
"""Distance of y from y*, in standard deviations, up to which l is a polynomial of third order."""

AT = 1e-9
"""Distance up to which y is y*: what is left of it is rounding."""

ROUNDING = 1e-12
"""Share of a limit up to which a reading is that limit."""

STEPS = 50
"""Steps of Fisher's scoring to y*, at most: it takes a few where noise grows slowly with the output."""


@dataclass(frozen=True, eq=False)
class ReadingLikelihood:
    """The likelihood of readings (N,) of one output, or of an array of them.

    Attributes
    ----------
    low, high : ndarray, (N,)
        Edges of the cell in which a reading was before it was rounded or limited; both are the reading where it is exact.
    std, relative : float
        As in `Noise`; std with that of fine rounding.
    best, largest : ndarray, (N,)
        y*, and l there; of a limit, no y* and zero.
    """

    low: Array
    high: Array
    std: float
    relative: float
    best: Array
    largest: Array

    @classmethod
    def of(cls, readings: Array, sensors: Sensors, output: int) -> ReadingLikelihood:
        """Likelihood of the readings (N,) of an output, none of them NaN."""
        std, relative, q = (float(of[output]) for of in (sensors.std, sensors.relative, sensors.resolution))
        lower, upper = float(sensors.lower[output]), float(sensors.upper[output])
        # A limit with its own rounding, as of a decimal number, is that limit.
        room = ROUNDING * max(abs(bound) if np.isfinite(bound) else 0.0 for bound in (lower, upper))
        fine = q < (TILED if np.isfinite(lower) or np.isfinite(upper) else FINE) * std
        low, high = readings.copy(), readings.copy()
        if q:  # no reading between the limits is as near to them
            lower, upper = rounded_limits(q, lower, upper)
        at_lower, at_upper = readings <= lower + room, readings >= upper - room
        if fine:
            std = float(np.sqrt(std**2 + q**2 / 12))
        else:
            low, high = np.maximum(low - q / 2, lower), np.minimum(high + q / 2, upper)
        low[at_lower], high[at_lower] = -np.inf, lower
        low[at_upper], high[at_upper] = upper, np.inf
        found = cls(low, high, std, relative, readings, np.zeros(len(readings)))
        return found._with_largest(~(at_lower | at_upper))

    def _with_largest(self, inside: NDArray[np.bool_]) -> ReadingLikelihood:
        best = np.where(inside, self.best, 0.0)
        for _ in range(STEPS if self.relative else 0):
            variance = self.std**2 + np.square(self.relative * best)
            width = np.where(np.isfinite(self.high - self.low), self.high - self.low, 0.0)
            step = np.where(inside, self.logarithm(best)[1] * (variance + np.square(width) / 12), 0.0)
            best = best + step
            if (np.abs(step) <= 1e-15 * np.abs(best)).all():
                break
        largest = np.where(inside, self.logarithm(best)[0], 0.0)
        return replace(self, best=best, largest=largest)

    def shaped(self, shape: tuple[int, ...]) -> ReadingLikelihood:
        """These readings as an array of another shape, such as (B, N)."""
        each = (of.reshape(shape) for of in (self.low, self.high, self.best, self.largest))
        low, high, best, largest = each
        return replace(self, low=low, high=high, best=best, largest=largest)

    def some(self, rows: NDArray[np.intp]) -> ReadingLikelihood:
        """Some of the readings, along the first axis."""
        return replace(self, low=self.low[rows], high=self.high[rows], best=self.best[rows], largest=self.largest[rows])

    def logarithm(self, y: Array) -> tuple[Array, Array]:
        """l and its derivative at noise-free outputs (..., N)."""
        sigma = np.sqrt(self.std**2 + np.square(self.relative * y))
        slope = self.relative**2 * y / sigma
        exact = self.low == self.high
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            z = (self.low - y) / sigma
            density = -np.log(sigma) - np.square(z) / 2 - LOG_ROOT
            by_density = (z * (1 + z * slope) - slope) / sigma
            if exact.all():
                return density, by_density
            probability, of_low, of_high = _cell(z, (self.high - y) / sigma)
            ends = ((self.low, of_low), (self.high, of_high))
            moved = [np.where(np.isfinite(edge), share * (1 + (edge - y) / sigma * slope), 0.0) for edge, share in ends]
            by_probability = (moved[0] - moved[1]) / sigma
        return np.where(exact, density, probability), np.where(exact, by_density, by_probability)

    def residuals(self, y: Array) -> tuple[Array, Array]:
        """Deviance residuals r and their slopes dr/dy at noise-free outputs (..., N); positive where y is too large."""
        value, slope = self.logarithm(y)
        inside = np.isfinite(self.low) & np.isfinite(self.high)
        sigma = np.sqrt(self.std**2 + np.square(self.relative * self.best))
        off = y - self.best
        near = inside & (np.abs(off) <= NEAR * sigma)
        # Of the third order, 2 (l(y*) - l(y)) is -3/2 (y - y*) l'(y* + 2/3 (y - y*)).
        square = np.where(near, -1.5 * off * self.logarithm(self.best + off * 2 / 3)[1], 2 * (self.largest - value))
        sign = np.where(inside, np.sign(off), np.where(np.isfinite(self.high), 1.0, -1.0))
        r = sign * np.sqrt(np.maximum(square, 0.0))
        step = NEAR * sigma
        curvature = (self.logarithm(self.best - step)[1] - self.logarithm(self.best + step)[1]) / (2 * step)
        at = (inside & (np.abs(off) <= AT * sigma)) | (r == 0)
        safe = np.where(at, 1.0, r)
        return r, np.where(at, np.where(inside, np.sqrt(np.maximum(curvature, 0.0)), 0.0), -slope / safe)


def _cell(low: Array, high: Array) -> tuple[Array, Array, Array]:
    """log P of a standard normal number between two edges, and the densities at both over P."""
    from scipy.special import log_ndtr

    flip = low > 0  # the tail on whose side both are: there the difference keeps its digits
    first, second = np.where(flip, -high, low), np.where(flip, -low, high)
    of_first, of_second = log_ndtr(first), log_ndtr(second)
    probability = of_second + np.log(-np.expm1(np.minimum(of_first - of_second, -1e-300)))
    shares = [np.exp(np.minimum(-np.square(edge) / 2 - LOG_ROOT - probability, 700.0)) for edge in (low, high)]
    return probability, shares[0], shares[1]
