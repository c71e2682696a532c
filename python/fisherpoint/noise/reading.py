"""The Fisher information that one reading of a sensor has about the noise-free output.

The reading is that of a normal variable of mean y and variance v = a^2 + b^2 y^2, rounded to multiples of q, and then not past the
limits. With z = (edge - y) / sqrt(v), each value that is shown has a probability P(y), and the information is the sum of P'^2 / P.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array

Places = NDArray[np.intp]

SPAN = 9.0
"""Standard deviations to each side of y, past which no reading falls."""

FINE = 1e-3
"""Steps, in standard deviations, up to which rounding is white noise of the variance q^2 / 12: the error is of the fourth order."""

SPACING = 0.3
"""Spacing, in standard deviations, of cells that stand for their neighbours: the sum is an integral to rounding."""

TILED = 1e-2
"""Steps, in standard deviations, from which on cells are counted one by one beside a limit."""

AT_ONCE = 1 << 20
"""Probabilities of cells that are computed at once, so that memory stays bounded."""


PLACES = 32
"""Places of a noise-free output, of equal probability, over which the information of a rounded reading is averaged."""

ROUNDING = 1e-12
"""Terms of a Fourier series up to this share of the mean are rounding errors."""

TAILS = np.linspace(-4.0, 4.0, 33)
"""Places of an output, in standard deviations, at which it may be past a limit."""

TOGETHER = 10
"""Readings at one place, which are past a limit together: what only a few plants lose then counts. With 1 in its place designs have
errors up to 2.5 times as promised; with 100, F of given runs is 100 times too small."""

BESIDE = 1801
"""Outputs beside a limit at which the information is tabled, for interpolation to 1e-5."""

TINY = 1e-6
"""Information of a reading, beside 1 of the prior, of which everything counts but for rounding."""

WIDEST = 2.0
"""Standard deviation of an output, in steps of rounding, from which on the mean over all places in a step is the average."""


def averaged_information(
    y: Array, spread: Array, std: float, relative: float, resolution: float, lower: float, upper: float
) -> Array:
    """`reading_information` averaged over normal outputs of means y and standard deviations `spread`, of the shape of y.

    Over places in a step it is the mean. Beside limits, which leave nothing to read in some plants, it is what leaves the same mean
    variance of the output, in the mean over the prior, where `TOGETHER` are alike: with information w of each and 1/s^2 of the
    prior, that of 1/(1/s^2 + n w).
    """
    from scipy.special import ndtri

    limited = bool(np.isfinite(lower) or np.isfinite(upper))
    if not limited and not relative:
        return _averaged_over_steps(y, spread, std, resolution)
    if not limited:
        reach, found = np.minimum(spread, WIDEST * resolution), np.zeros(y.shape)
        for place in ndtri((np.arange(PLACES) + 0.5) / PLACES):
            found += reading_information(y + place * reach, std, relative, resolution, lower, upper)
        return found / PLACES
    wide = float(np.hypot(std, resolution / np.sqrt(12)))
    steps, limits = (_of_readings(*of, lower, upper) for of in ((std, relative, resolution), (wide, relative, 0.0)))
    weights = np.exp(-np.square(TAILS) / 2)
    mean, smooth, left = np.zeros(y.shape), np.zeros(y.shape), np.zeros(y.shape)
    for place, weight in zip(TAILS, weights / weights.sum(), strict=True):
        there = y + place * spread
        gained = TOGETHER * np.square(spread) * limits(there)  # steps count by their mean
        mean += weight * steps(there)
        smooth += weight * gained
        left += weight / (1 + gained + past_limit(there, spread, wide, lower, upper))
    share: Array = np.divide(1 / left - 1, smooth, out=np.ones(y.shape), where=smooth > TINY)
    return mean * share


def past_limit(y: Array, spread: Array, std: float, lower: float, upper: float) -> Array:
    """Information, beside 1 of the prior, that outputs y of standard deviations `spread` are past a limit; 0 where they are not.

    Estimates end where readings would just be at the limit: they are off by about as much as the output is past it.
    """
    past = np.maximum(y - upper, lower - y)
    found: Array = np.divide(np.square(spread), np.square(past) + std**2, out=np.zeros(y.shape), where=past > 0)
    return found


def _of_readings(std: float, relative: float, resolution: float, lower: float, upper: float) -> Callable[[Array], Array]:
    """`reading_information` of outputs; from a table where these are limited and no more."""
    if relative or resolution:
        return partial(reading_information, std=std, relative=relative, resolution=resolution, lower=lower, upper=upper)
    places, information = _beside_limits(std, lower, upper)
    return lambda y: np.interp(y, places, information)


@lru_cache(maxsize=64)
def _beside_limits(std: float, lower: float, upper: float) -> tuple[Array, Array]:
    """Outputs beside limits, and the information of readings, which farther away is the same."""
    near = std * np.linspace(-SPAN, SPAN, BESIDE)
    places = np.unique(np.concatenate([limit + near for limit in (lower, upper) if np.isfinite(limit)]))
    return places, reading_information(places, std, lower=lower, upper=upper)


def _averaged_over_steps(y: Array, spread: Array, std: float, resolution: float) -> Array:
    """The mean over normal outputs of an information that repeats with every step: each term of its Fourier series by a factor."""
    around, decay = 2 * np.pi * y / resolution, 2 * np.square(np.pi * spread / resolution)
    found = np.zeros(y.shape)
    for k, size in enumerate(_series_over_a_step(std / resolution)):
        found += size * np.cos(k * around) * np.exp(-decay * k**2)
    return np.maximum(found, 0.0) / std**2


@lru_cache(maxsize=64)
def _series_over_a_step(std: float) -> tuple[float, ...]:
    """Cosine coefficients of the information about an output times the variance, where steps are 1 and the noise is std of them."""
    n = 1 << max(6, int(np.ceil(np.log2(16 / std))))
    w = std**2 * reading_information(np.arange(n) / n, std, resolution=1.0)
    size = np.fft.rfft(w).real / n
    size[1:-1] *= 2
    counts = np.flatnonzero(np.abs(size) > ROUNDING * size[0])
    return tuple(size[: counts[-1] + 1].tolist())


def reading_information(
    y: Array,
    std: float,
    relative: float = 0.0,
    resolution: float = 0.0,
    lower: float = -np.inf,
    upper: float = np.inf,
) -> Array:
    """Fisher information w of readings about noise-free outputs y, in 1 / unit^2, of the shape of y.

    Parameters
    ----------
    y : ndarray
    std, relative, resolution, lower, upper : float
        As in `Noise`.
    """
    variance = std**2 + np.square(relative * y)
    limited = bool(np.isfinite(lower) or np.isfinite(upper))
    if not resolution and not limited:
        slope: Array = 2 * relative**2 * y  # of the variance
        return 1 / variance + np.square(slope / variance) / 2
    shape, y, variance = y.shape, y.ravel(), variance.ravel()
    sigma = np.sqrt(variance)
    fine = resolution < (TILED if limited else FINE) * sigma
    found = np.empty(len(y))
    if resolution and limited:  # the outermost steps that are not shown as limits
        lower, upper = rounded_limits(resolution, lower, upper)
    wide = np.sqrt(variance[fine] + resolution**2 / 12)
    found[fine] = _censored(y[fine], wide, relative**2 * y[fine] / wide, lower, upper)
    for rows in _portions(np.flatnonzero(~fine), sigma, resolution, limited):
        found[rows] = _rounded(y[rows], sigma[rows], relative**2 * y[rows] / sigma[rows], resolution, lower, upper)
    return found.reshape(shape)


def rounded_limits(resolution: float, lower: float, upper: float) -> tuple[float, float]:
    """The values past which a reading that is rounded first shows a limit."""
    with np.errstate(invalid="ignore"):
        below = (np.floor(lower / resolution + 1e-9) + 0.5) * resolution
        above = (np.ceil(upper / resolution - 1e-9) - 0.5) * resolution
    return float(below), float(above)


def _censored(y: Array, sigma: Array, slope: Array, lower: float, upper: float) -> Array:
    """Information of readings that are not rounded: an integral between the limits, and the two probabilities of showing a limit.

    `slope` is d sigma / dy.
    """
    low, high = (lower - y) / sigma, (upper - y) / sigma
    inside = _integral(high, slope) - _integral(low, slope) + (1 + 2 * np.square(slope)) * _probability(low, high)
    at_limits = _share(low, slope, normal_cdf(low)) + _share(high, slope, normal_cdf(-high))
    found: Array = (np.maximum(inside, 0.0) + at_limits) / np.square(sigma)
    return found


def _integral(z: Array, slope: Array) -> Array:
    """Antiderivative of (z + s (z^2 - 1))^2 phi(z), without its (1 + 2 s^2) Phi(z)."""
    z = np.clip(z, -40.0, 40.0)  # where the density is zero
    found: Array = -_density(z) * (z + 2 * slope * (z * z + 1) + np.square(slope) * (z**3 + z))
    return found


def _rounded(y: Array, sigma: Array, slope: Array, q: float, lower: float, upper: float) -> Array:
    """Information of rounded readings: the sum over cells of width q, and the two probabilities of showing a limit."""
    limited = bool(np.isfinite(lower) or np.isfinite(upper))
    smallest = float(sigma.min())
    if limited or q >= SPACING * smallest:
        count = int(np.ceil(SPAN * float(sigma.max()) / q)) + 1
        cells = (np.rint(y / q)[:, None] + np.arange(-count, count + 1)) * q
        left, right, weight = cells - q / 2, cells + q / 2, np.ones((len(y), 1))
    else:
        steps = SPACING * np.arange(-int(SPAN / SPACING), int(SPAN / SPACING) + 1)
        cells = y[:, None] + sigma[:, None] * steps
        left, right, weight = cells - q / 2, cells + q / 2, SPACING * sigma[:, None] / q
    low, high = ((np.clip(edge, lower, upper) - y[:, None]) / sigma[:, None] for edge in (left, right))
    change = _density(high) * (1 + high * slope[:, None]) - _density(low) * (1 + low * slope[:, None])
    found = (weight * _ratio(np.square(change), _probability(low, high))).sum(axis=1)
    low, high = (lower - y) / sigma, (upper - y) / sigma
    found += _share(low, slope, normal_cdf(low)) + _share(high, slope, normal_cdf(-high))
    return np.asarray(found / np.square(sigma))


def _portions(rows: Places, sigma: Array, q: float, limited: bool) -> list[Places]:
    """Rows of similar standard deviations, as many at once as memory has room for, those with representative cells apart."""
    rows = rows[np.argsort(sigma[rows], kind="stable")]
    parts: list[Places] = []
    first = 0
    while first < len(rows):
        least = sigma[rows[first]]
        fits = sigma[rows] <= 2 * least
        if not limited:
            fits &= (q >= SPACING * sigma[rows]) == (q >= SPACING * least)
        last = int(np.flatnonzero(fits)[-1]) + 1
        each = max(1, int(AT_ONCE / (4 * SPAN * least / q + 2 * SPAN / SPACING + 4)))
        last = min(last, first + each)
        parts.append(rows[first:last])
        first = last
    return parts


def _share(z: Array, slope: Array, probability: Array) -> Array:
    """P'^2 / P, times the variance, of one value that is shown from an edge on."""
    finite = np.where(np.isfinite(z), z, 0.0)
    change = np.where(np.isfinite(z), _density(finite) * (1 + finite * slope), 0.0)
    return _ratio(np.square(change), probability)


def _ratio(a: Array, b: Array) -> Array:
    """a / b, and 0 where b is, as a is there."""
    return np.divide(a, b, out=np.zeros(np.broadcast_shapes(a.shape, b.shape)), where=b > 0)


def _density(z: Array) -> Array:
    found: Array = np.exp(-np.square(z) / 2) / np.sqrt(2 * np.pi)
    return found


def normal_cdf(z: Array) -> Array:
    """Distribution function of the standard normal distribution."""
    from scipy.special import ndtr

    return np.asarray(ndtr(z))


def _probability(low: Array, high: Array) -> Array:
    """Phi(high) - Phi(low), by the tail on whose side both are: there the difference keeps its digits."""
    flip = low > 0
    first, second = np.where(flip, -high, low), np.where(flip, -low, high)
    return np.asarray(normal_cdf(second) - normal_cdf(first))
