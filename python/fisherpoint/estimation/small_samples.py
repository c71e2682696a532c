"""Standard errors and degrees of freedom where the noise was estimated from the residuals that it weighs.

Weights that are estimated are themselves uncertain. The estimate scatters more than it would with the right weights, by L; and the
usual covariance, taken at weights that the residuals flatter, is too small by about L again (Kenward and Roger 1997, for weights of
restricted maximum likelihood). L follows to first order from the covariance of the weights; that of maximum likelihood, (10), is
larger than that of restricted, because an output that gets more weight is fitted better, and then gets more weight still.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array

FEWEST = 1e-3
"""Degrees of freedom that an output at least counts as having."""

FEEDBACK = 0.9
"""Largest feedback of weights on themselves that is believed; at 1 the likelihood has no maximum."""


class Inflated(NamedTuple):
    """Covariance (B, P, P) of the unknowns with what the weights add, and Student's degrees of freedom (B, P) for each."""

    covariance: Array
    degrees_of_freedom: Array


def output_degrees_of_freedom(jacobian: Array, covariance: Array, counts: NDArray[np.intp]) -> Array:
    """Number of measured values of each output less what the unknowns take up of it, (B, n_y).

    Parameters
    ----------
    jacobian : ndarray, (B, N, n_y, P)
        Of the whitened residuals of the data.
    covariance : ndarray, (B, P, P)
        Of the unknowns, the inverse of J^T J.
    counts : ndarray, (n_y,)
        Number of measured values of each output.
    """
    leverage = ((jacobian @ covariance[:, None]) * jacobian).sum(axis=(1, 3))
    degrees: Array = np.maximum(counts - leverage, 0.0)
    return degrees


def unbiased(covariance: Array, degrees: Array, counts: NDArray[np.intp]) -> Array:
    """Residual covariances (B, n_y, n_y) with each variance divided by degrees of freedom instead of the number of values."""
    growth = np.sqrt(np.where(counts > 0, counts / np.maximum(degrees, FEWEST), 1.0))
    return covariance * growth[:, :, None] * growth[:, None, :]


def inflated(jacobian: Array, covariance: Array, counts: NDArray[np.intp], full: bool) -> Inflated:
    """Effect of estimated weights on B fits.

    Parameters
    ----------
    jacobian : ndarray, (B, N, n_y, P)
        Of the data's residuals, whitened by the unbiased covariance.
    covariance : ndarray, (B, P, P)
        Of the unknowns, were these weights the right ones.
    counts : ndarray, (n_y,)
        Number of measured values of each output.
    full : bool
        Whether correlations of the outputs were estimated beside their variances.

    Notes
    -----
    With the noise's covariance I + sum_c delta_c E_c in whitened outputs, the estimate moves with delta_c by B g_c, where
    g_c = J^T E_c e for residuals e = (I - H) v; their covariances are P x P matrices, whatever the number of samples. For a single
    output this leaves the covariance s^2 (J^T J)^-1 alone, and N - P degrees of freedom.
    """
    std = np.sqrt(np.einsum("bpp->bp", covariance))  # unknowns in units of these: squares of hardly determined ones overflow
    std = np.where(std > 0, std, 1.0)
    units, given = std[:, :, None] * std[:, None, :], covariance
    jacobian, covariance = jacobian * std[:, None, None, :], covariance / units
    degrees = output_degrees_of_freedom(jacobian, covariance, counts)
    measured = np.flatnonzero(counts)
    pairs = [(a, b) for a in measured for b in measured if a == b or (full and a < b)]
    b_matrix, n_y = covariance, jacobian.shape[2]
    both = np.zeros((len(jacobian), n_y, n_y, *covariance.shape[1:]))  # sum_k J_ka J_kb^T
    for a in measured:
        for b in measured if full else (a,):
            both[:, a, b] = jacobian[:, :, a].transpose(0, 2, 1) @ jacobian[:, :, b]
    information = np.einsum("baapq->bpq", both)
    x_matrix = 2 * b_matrix - b_matrix @ information @ b_matrix  # of (I - H)(I - H)^T = I - J X J^T

    effect = np.zeros((n_y, n_y, len(pairs)))  # E_c
    for c, (a, b) in enumerate(pairs):
        effect[a, b, c] = effect[b, a, c] = 1.0
    # Of the estimates of delta_c: e^T M_c e / d_c, with M_c the mean of both places of a pair.
    estimator = effect / np.array([1.0 if a == b else 2.0 for a, b in pairs])
    size = np.sqrt([[row[a] * row[b] for a, b in pairs] for row in np.maximum(degrees, FEWEST)])

    def summed(weights: Array) -> Array:
        """sum_k J_k^T E_c J_k, (B, C, P, P)."""
        total: Array = np.einsum("xyc,bxypq->bcpq", weights, both, optimize=True)
        return total

    moved, by_estimator = summed(effect), summed(estimator)
    products = np.einsum("xzc,zyd->xycd", effect, effect), np.einsum("xzc,zyd->xycd", estimator, effect)
    of_effects, of_both = (np.einsum("xycd,bxypq->bcdpq", product, both, optimize=True) for product in products)
    scores = of_effects - np.einsum("bcpq,bqr,bdrs->bcdps", moved, x_matrix, moved, optimize=True)  # E[g_c g_d^T]
    cross = of_both - np.einsum("bcpq,bqr,bdrs->bcdps", by_estimator, x_matrix, moved, optimize=True)
    feedback = 2 * np.einsum("bcdpq,bqp->bcd", cross, b_matrix) / size[:, :, None]

    squares = np.einsum("xzc,zyd->xycd", estimator, estimator)
    samples = np.einsum("xxcd,x->cd", squares, counts)
    once = np.einsum("xycd,bxypq,bqp->bcd", squares, both, x_matrix, optimize=True)
    turned = by_estimator @ x_matrix[:, None]
    twice = np.einsum("bcpq,bdqp->bcd", turned, turned)
    noise = 2 * (samples - 2 * once + twice) / (size[:, :, None] * size[:, None, :])
    largest = np.abs(np.linalg.eigvals(feedback)).max(axis=1)
    feedback *= np.minimum(1.0, FEEDBACK / np.maximum(largest, 1e-300))[:, None, None]
    turn = np.linalg.inv(np.eye(len(pairs)) - feedback)
    weights = turn @ noise @ turn.transpose(0, 2, 1)  # covariance of the estimated delta

    added = b_matrix @ np.einsum("bcd,bcdpq->bpq", weights, scores) @ b_matrix
    # A covariance itself; where next to nothing is determined, it is rounding.
    added[(np.einsum("bpp->bp", added) < 0).any(axis=1)] = 0.0
    shares = np.einsum("bpq,bcqr,brp->bcp", b_matrix, moved, b_matrix, optimize=True)
    spread = np.einsum("bcp,bcd,bdp->bp", shares, weights, shares, optimize=True)
    variance = np.einsum("bpp->bp", b_matrix)
    degrees_of_each = np.divide(2 * variance**2, spread, out=np.full(variance.shape, np.inf), where=spread > 0)
    return Inflated(given + (added + added.transpose(0, 2, 1)) * units, degrees_of_each)
