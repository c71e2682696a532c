"""Robust standard errors: a covariance of the estimate that does not need the noise to be white, from the residuals themselves.

F^-1 M F^-1 with the covariance M of the scores J^T v. With many series (points, runs, records), M is the sum of squares of their
scores, with the correction of Bell and McCaffrey (2002) for what the fit has taken from each. With few, it is that of Newey and
West (1987) over lags, with the bandwidth of Andrews (1991); the residuals are prewhitened before and M is recoloured after, as by
Andrews and Monahan (1992), but by white noise beside Gauss-Markov noise, as an autoregression alone fails where there is both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array
from .noise_memory import NoiseMemory, slices_of

MANY_SERIES = 20.0
"""Number of series, of equal weight in the information, from which on each counts as one."""

LEAST_LEFT = 0.1
"""Least share of a residual's variance that the fit is taken to have left."""


@dataclass(frozen=True, eq=False)
class Sandwich:
    """A robust covariance.

    Attributes
    ----------
    covariance : ndarray, (P, P)
        In standardised coordinates.
    method : {"series", "window"}
        Whether series count as one each, or lags within them are weighted.
    bandwidth : float
        Lags, in samples, past which products of prewhitened scores do not count; zero of "series".
    weight : float
        Number of series, of equal weight in the information, that the data are worth.
    """

    covariance: Array
    method: Literal["series", "window"]
    bandwidth: float
    weight: float


def sandwich(
    e: Array,
    jacobian: Array,
    covariance: Array,
    series: NDArray[np.intp],
    measured: NDArray[np.bool_],
    memories: Sequence[NoiseMemory],
    of_prior: Array,
    shares: tuple[Array, int] | None = None,
) -> Sandwich:
    """The robust covariance of an estimate.

    Parameters
    ----------
    e : ndarray, (N, n_y)
        Whitened residuals, zero where not measured.
    jacobian : ndarray, (N, n_y, P)
        Of these.
    covariance : ndarray, (P, P)
        F^-1, of what is determined.
    series : ndarray of int, (N,)
        Number of each sample's series.
    measured : ndarray of bool, (N, n_y)
    memories : sequence of NoiseMemory, (n_y,)
        By which each output's residuals are prewhitened.
    of_prior : ndarray, (P, P)
        The prior's information.
    shares : (ndarray (N, n_y, k), int), optional
        Q, where each series has columns of its own behind so many common ones, by which it has its weight.
    """
    if shares is None:
        leverage = np.einsum("tip,pq,tiq->t", jacobian, covariance, jacobian, optimize=True)
    else:
        leverage = np.square(shares[0][..., : shares[1]]).sum(axis=(1, 2))
    of_series = np.bincount(series, leverage)
    weight = float(of_series.sum() ** 2 / np.square(of_series).sum()) if of_series.any() else 0.0
    if weight >= MANY_SERIES:
        middle, bandwidth, method = _of_series(e, jacobian, covariance, slices_of(series), shares), 0.0, "series"
    else:
        (middle, bandwidth), method = _of_lags(e, jacobian, covariance, slices_of(series), measured, memories), "window"
    return Sandwich(covariance @ (middle + of_prior) @ covariance, method, bandwidth, weight)  # type: ignore[arg-type]


def root(covariance: Array) -> Array:
    """A factor H (P, P) with H H^T = covariance, positive semidefinite, whatever the units."""
    std = np.sqrt(np.diag(covariance))
    unit = np.where(std > 0, std, 1.0)
    sizes, directions = np.linalg.eigh(covariance / np.outer(unit, unit))
    factor: Array = unit[:, None] * directions * np.sqrt(np.maximum(sizes, 0.0))
    return factor


def _of_series(
    e: Array, jacobian: Array, covariance: Array, parts: Sequence[slice], shares: tuple[Array, int] | None = None
) -> Array:
    factor, p = root(covariance) if shares is None else None, len(covariance)
    firsts, lengths = np.array([part.start for part in parts]), np.array([part.stop - part.start for part in parts])
    middle = np.zeros((p, p))
    for length in np.unique(lengths):
        rows = firsts[lengths == length][:, None] + np.arange(length)
        own, r = jacobian[rows].reshape(len(rows), -1, p), e[rows].reshape(len(rows), -1, 1)
        taken = own @ factor if shares is None else shares[0][rows].reshape(len(rows), -1, shares[0].shape[2])
        left, sizes, _ = np.linalg.svd(taken, full_matrices=False)
        grown = 1 / np.sqrt(np.maximum(1 - np.square(sizes), LEAST_LEFT)) - 1
        r = r + left @ (grown[..., None] * (left.transpose(0, 2, 1) @ r))
        scores = (own * r).sum(axis=1)
        middle += scores.T @ scores
    return middle


def _of_lags(
    e: Array,
    jacobian: Array,
    covariance: Array,
    parts: Sequence[slice],
    measured: NDArray[np.bool_],
    memories: Sequence[NoiseMemory],
) -> tuple[Array, float]:
    scores = np.zeros((len(e), len(covariance)))
    for i, memory in enumerate(memories):
        innovations, recoloured, used = (np.zeros((len(e), width)) for width in (1, len(covariance), len(covariance)))
        for part in parts:
            rows = np.arange(part.start, part.stop)[measured[part, i]]
            if len(rows):
                innovations[rows] = memory.whitened(e[rows, i, None])
                used[rows] = memory.whitened(jacobian[rows, i])
                recoloured[rows] = memory.adjoint(jacobian[rows, i])
        # u = B^-1 (I - J C J^T) v for v = B u: what is left of the variance of each innovation
        taken = used @ covariance
        left = 1 - 2 * (taken * recoloured).sum(axis=1) + ((taken @ (recoloured.T @ recoloured)) * taken).sum(axis=1)
        scores += recoloured * innovations / np.sqrt(np.maximum(left, LEAST_LEFT))[:, None]
    bandwidth = _bandwidth(scores, parts)
    middle = scores.T @ scores
    for lag in range(1, int(bandwidth) + 1):
        for part in (part for part in parts if part.stop - part.start > lag):
            product = scores[part.start : part.stop - lag].T @ scores[part.start + lag : part.stop]
            middle += (1 - lag / (bandwidth + 1)) * (product + product.T)
    return middle, bandwidth


def _bandwidth(scores: Array, parts: Sequence[slice]) -> float:
    """Andrews' bandwidth of Bartlett's window by autoregressions of first order of the scores (N, P)."""
    longest = max(part.stop - part.start for part in parts)
    if longest < 4:
        return 0.0
    before = np.concatenate([scores[part.start : part.stop - 1] for part in parts])
    after = np.concatenate([scores[part.start + 1 : part.stop] for part in parts])
    squares = np.square(before).sum(axis=0)
    rho = np.divide((before * after).sum(axis=0), squares, out=np.zeros(len(squares)), where=squares > 0)
    rho = np.clip(rho, -0.97, 0.97)
    there = squares > 0
    if not there.any():
        return 0.0
    # each score in units of itself, so that no unit counts
    above = 4 * np.square(rho) / ((1 - rho) ** 6 * (1 + rho) ** 2)
    alpha = float(above[there].sum() / (1 / (1 - rho[there]) ** 4).sum())
    return float(min(1.1447 * np.cbrt(alpha * len(scores)), longest / 4))
