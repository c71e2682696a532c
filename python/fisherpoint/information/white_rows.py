"""Sensitivities as rows whose squares add up to the information, whatever the noise is and whatever is drawn anew."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array, IntArray
from ..noise.common_error import beside_free
from ..points.status import Status, only_finite
from .problem import DesignProblem


def white_rows(
    problem: DesignProblem,
    scaled: Array,
    dy_dtheta: Array,
    times: Array,
    y: Array,
    measured: NDArray[np.bool_],
    status: IntArray,
    place: Array | None = None,
) -> tuple[Array, IntArray]:
    """Rows (K, N, n_y, p) that R whitens, whatever the noise is, and statuses (K,): see `Sensors.rows`.

    From standardised sensitivities, and those by all parameters of `assumed`. What has a value of its own in each run is taken
    out: with a spread by the covariance, without by projection.
    The information of rounded and limited readings is averaged over where the prior has the outputs, so that no design counts
    on parameters by which one lies just at an edge; or it is that where the unknowns are by `place` (n_unknowns,) of their
    standard deviations, in independent coordinates, from their means.
    """
    if problem.sensors is None:
        raise ValueError("noise: expected the sensor noise, given none")
    p, moved, columns = scaled.shape[3], None, scaled
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is given a status
        if problem.assumed is not None and problem.assumed.columns:
            moved = np.where(measured[..., None], dy_dtheta[..., problem.assumed.columns] * problem.assumed.std, 0.0)
            status = only_finite(status, moved)
        if problem.assumed is not None and problem.assumed.free:
            free = np.where(measured[..., None], dy_dtheta[..., problem.assumed.free] * problem.assumed.free_std, 0.0)
            status, columns = only_finite(status, free), np.concatenate([scaled, free], axis=3)
        there = measured & (status == Status.ok)[:, None, None]
        moved = None if moved is None else np.where(there[..., None], moved, 0.0)
        spread = None
        if place is not None:
            y = y + independently(problem, columns[..., : problem.n_unknowns]) @ place
        elif problem.has_uneven_readings:
            spread = np.sqrt(np.square(independently(problem, columns)).sum(axis=-1))
        rows = problem.sensors.rows(columns, moved, times, np.where(there, y, 0.0), there, spread)
        rows = beside_free(rows[..., :p], rows[..., p:])
        rows *= np.sqrt(np.diag(problem.noise_covariance))[:, None]
    return rows, only_finite(status, rows)


def independently(problem: DesignProblem, scaled: Array) -> Array:
    """Standardised derivatives (..., n_y, n) by independent standard normal coordinates instead of the parameters."""
    if not problem.prior.correlated:
        return scaled
    own = len(problem.estimated)
    factor = np.linalg.cholesky(problem.prior.marginal(problem.estimated).correlation)
    return np.concatenate([scaled[..., :own] @ factor, scaled[..., own:]], axis=-1)
