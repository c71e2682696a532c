"""Tests of whether residuals are white: autocorrelation and spectrum of series, sign changes of points along a setting.

Residuals e = (I - Q Q^T) v of a fit with p unknowns are not white even where the noise v is: their autocorrelations have means and
covariances that follow from Q. These are exact for the ratio of quadratic forms of a single output, so the tests
hold their size in small samples too. Lags count measured samples of one series, whatever the steps between them are.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array

ORDERS = (1, 4, 16)
"""Numbers of lags that are tested together. The probability is the smallest of these tests' times their number."""

DEGREES_PER_LAG = 10
"""Degrees of freedom for each lag that is tested: with fewer, the sum of squares has heavier tails than chi-square."""

FEWEST_ORDINATES = 8
"""Ordinates of the periodogram from which on it is tested."""

CHUNK = 8192
"""Samples whose lagged products are computed at once."""


@dataclass(frozen=True, eq=False)
class Autocorrelation:
    """Autocorrelation of one output's residuals at the lags 1 to L, beside what white noise leads to after the fit.

    Attributes
    ----------
    values : ndarray, (L,)
        Sum of products of samples so far apart over the sum of squares of all; L is zero where there is nothing to judge.
    expected : ndarray, (L,)
        Mean of these if the noise is white.
    covariance : ndarray, (L, L)
        Of these if the noise is white.
    degrees_of_freedom : float
        Number of samples less what the fit has used up.
    """

    values: Array
    expected: Array
    covariance: Array
    degrees_of_freedom: float

    @property
    def band(self) -> Array:
        """Half width of the band around `expected` that has 95 % of white noise's values, (L,)."""
        return 1.959964 * np.sqrt(np.diag(self.covariance))


def autocorrelation(
    e: Array,
    share: Array,
    series: NDArray[np.intp],
    most_lags: int = ORDERS[-1],
    blocks: tuple[int, NDArray[np.intp]] | None = None,
) -> Autocorrelation:
    """The autocorrelation of residuals.

    Parameters
    ----------
    e : ndarray, (n,)
        Whitened residuals, series after series.
    share : ndarray, (n, p)
        Q: I - Q Q^T is the covariance of the residuals if the noise is white.
    series : ndarray of int, (n,)
        Number of each sample's series, the same for consecutive samples.
    most_lags : int
        Lags are left out at which less than half of the samples have a partner.
    blocks : (int, ndarray of int (n,)), optional
        How many columns of Q all samples share, and the number of each sample's block, of which the others are columns of its own;
        a series is within a block.
    """
    lengths = np.unique(series, return_counts=True)[1]
    pairs = np.array([np.maximum(lengths - k, 0).sum() for k in range(most_lags + 1)])
    n_lags = int((pairs[1:] >= max(len(e) / 2, 2)).sum())
    products, mean, second = np.zeros(n_lags + 1), np.zeros(n_lags + 1), np.zeros((n_lags + 1, n_lags + 1))
    for values, partners in _lagged(e[:, None], series, n_lags):
        products += np.einsum("tc,ktc->k", values, partners)
    common, number = (share.shape[1], np.zeros(len(e), dtype=np.intp)) if blocks is None else blocks
    shared = np.zeros((n_lags + 1, common, common))
    order = np.argsort(number, kind="stable")
    each = [slice(None)] if blocks is None else np.split(order, np.flatnonzero(np.diff(number[order])) + 1)
    for some in each:
        first = np.zeros((n_lags + 1, share.shape[1], share.shape[1]))  # Q^T A_k Q, where e^T A_k e is the sum of products at lag k
        for q, partners in _lagged(share[some], series[some], n_lags):
            first += q.T @ partners
            flat = partners.reshape(n_lags + 1, -1)
            second -= 2 * flat @ flat.T
        mean -= np.einsum("kpp->k", first)
        shared += first[:, :common, :common]
        own, between = (part.reshape(n_lags + 1, -1) for part in (first[:, common:, common:], first[:, :common, common:]))
        second += own @ own.T + 2 * between @ between.T
    mean[0] += len(e)
    second += shared.reshape(n_lags + 1, -1) @ shared.reshape(n_lags + 1, -1).T
    second[np.diag_indices(n_lags + 1)] += np.where(np.arange(n_lags + 1) > 0, pairs[: n_lags + 1] / 2, len(e))
    degrees = float(mean[0])
    if n_lags == 0 or degrees < 2 or not products[0] > 0:
        return Autocorrelation(np.zeros(0), np.zeros(0), np.zeros((0, 0)), degrees)
    ratio = mean / mean[0]
    covariance = second - np.outer(ratio, second[0]) - np.outer(second[0], ratio) + np.outer(ratio, ratio) * second[0, 0]
    covariance *= 2 / (mean[0] ** 2 + 2 * second[0, 0])
    return Autocorrelation(products[1:] / products[0], ratio[1:], covariance[1:, 1:], degrees)


def _lagged(columns: Array, series: NDArray[np.intp], n_lags: int) -> Iterator[tuple[Array, Array]]:
    """Chunks of columns (c, p), with (L + 1, c, p): themselves, then half the sum of the samples k later and k earlier."""
    n = len(columns)
    padded = np.pad(columns, ((n_lags, n_lags), (0, 0)))
    numbers = np.pad(series, n_lags, constant_values=-1)
    for begin in range(n_lags, n_lags + n, CHUNK):
        end = min(begin + CHUNK, n_lags + n)
        partners = np.empty((n_lags + 1, end - begin, columns.shape[1]))
        partners[0] = padded[begin:end]
        for k in range(1, n_lags + 1):
            later, earlier = slice(begin + k, end + k), slice(begin - k, end - k)
            partners[k] = np.where((numbers[later] == numbers[begin:end])[:, None], padded[later], 0.0) / 2
            partners[k] += np.where((numbers[earlier] == numbers[begin:end])[:, None], padded[earlier], 0.0) / 2
        yield padded[begin:end], partners


def portmanteau(found: Autocorrelation) -> tuple[int, float | None]:
    """Number of lags that were tested, and the probability of larger autocorrelations by chance; None with too few samples.

    Ljung and Box's sum of squares over the first, the first 4 and the first 16 lags, each with as many degrees of freedom, as
    far as there are lags and ten times as many degrees of freedom are left; the first alone with three.
    """
    from scipy.special import chdtrc

    off, least = found.values - found.expected, [3 if m == 1 else DEGREES_PER_LAG * m for m in ORDERS]
    orders = [m for m, few in zip(ORDERS, least, strict=True) if found.degrees_of_freedom >= few and m <= len(off)]
    p_values = []
    for m in orders:
        sizes, directions = np.linalg.eigh(found.covariance[:m, :m])
        there = sizes > 1e-9 * max(sizes[-1], 1e-300)
        p_values.append(float(chdtrc(there.sum(), np.sum(np.square(directions[:, there].T @ off[:m]) / sizes[there]))))
    return (orders[-1], min(1.0, len(orders) * min(p_values))) if orders else (0, None)


@dataclass(frozen=True, eq=False)
class Periodogram:
    """Cumulative periodogram of one output's residuals, over the series' Fourier frequencies, cycles per sample.

    Attributes
    ----------
    frequencies : ndarray, (m,)
        Ascending, above zero and below half a cycle per sample; series of different lengths have different ones.
    cumulative, expected : ndarray, (m,)
        Share of the periodogram up to each frequency, and that of white noise after the fit.
    ordinates : int
        Number of ordinates: each series has one at each of its frequencies.
    """

    frequencies: Array
    cumulative: Array
    expected: Array
    ordinates: int

    @property
    def p_value(self) -> float | None:
        """Probability of a larger distance by chance, by Kolmogorov's distribution (Bartlett's test); None with few ordinates."""
        from scipy.special import kolmogorov

        if self.ordinates < FEWEST_ORDINATES:
            return None
        root = np.sqrt(self.ordinates - 1)
        return float(kolmogorov((root + 0.12 + 0.11 / root) * np.abs(self.cumulative - self.expected).max()))


def spectrum(e: Array, share: Array, series: NDArray[np.intp]) -> Periodogram:
    """The cumulative periodogram of residuals; see `autocorrelation` for the arguments."""
    _, first, lengths = np.unique(series, return_index=True, return_counts=True)
    frequencies, power, expected = [np.zeros(0)], [np.zeros(0)], [np.zeros(0)]
    for n in np.unique(lengths):
        inner = slice(1, (n - 1) // 2 + 1)
        rows = first[lengths == n][:, None] + np.arange(n)
        found = np.square(np.abs(np.fft.rfft(e[rows], axis=1)[:, inner]))
        left = np.full(found.shape, float(n))
        for q in share.T:
            left -= np.square(np.abs(np.fft.rfft(q[rows], axis=1)[:, inner]))
        frequencies.append(np.tile(np.arange(n // 2 + 1)[inner] / n, len(rows)))
        power.append(found.ravel())
        expected.append(np.maximum(left, 0.0).ravel())
    at, place = np.unique(np.concatenate(frequencies), return_inverse=True)
    sums = [np.cumsum(np.bincount(place.ravel(), np.concatenate(part), len(at))) for part in (power, expected)]
    if not len(at) or not all(total[-1] > 0 for total in sums):
        return Periodogram(np.zeros(0), np.zeros(0), np.zeros(0), 0)
    return Periodogram(at, sums[0] / sums[0][-1], sums[1] / sums[1][-1], len(place))


@dataclass(frozen=True)
class SignChanges:
    """Sign changes of the residuals of points that are sorted along a setting.

    Attributes
    ----------
    setting : str
    count, most : int
        Sign changes that there are, and that there could be; half of these are expected.
    p_value : float
        Probability of so few by chance, times the number of settings that were tried.
    """

    setting: str
    count: int
    most: int
    p_value: float


def fewest_sign_changes(e: Array, settings: Array, names: tuple[str, ...]) -> SignChanges | None:
    """The setting along which signs change improbably seldom; None where no setting has five different values.

    Parameters
    ----------
    e : ndarray, (n,)
        Residuals of points in units of the noise; the sum of replicates counts.
    settings : ndarray, (n, s)
        Inputs, starts and durations.
    names : tuple of str
        Of the settings.
    """
    from scipy.special import bdtr

    distinct, of = np.unique(settings, axis=0, return_inverse=True)
    sums = np.bincount(of.ravel(), weights=e, minlength=len(distinct))
    distinct, sums = distinct[sums != 0], sums[sums != 0]
    varied = [j for j in range(len(names)) if len(np.unique(distinct[:, j])) >= 5]
    found = []
    for j in varied:
        others = [distinct[:, i] for i in reversed(range(len(names))) if i != j]
        signs = np.sign(sums[np.lexsort([*others, distinct[:, j]])])
        count, most = int((signs[1:] != signs[:-1]).sum()), len(signs) - 1
        found.append(SignChanges(names[j], count, most, min(1.0, len(varied) * float(bdtr(count, most, 0.5)))))
    return min(found, key=lambda one: one.p_value, default=None)
