"""What is known of the parameters before any measurement, as Fisher information beside that of the data."""

from __future__ import annotations

import numpy as np

from ..basics.values import Array
from .problem import DesignProblem


def prior_rows(problem: DesignProblem) -> Array:
    """H (p, p) of which H^T H is the inverse of the prior's covariance, for the estimated parameters in units of their std.

    With the correlation L L^T that is L^-1: rows as those of data, one of each parameter where they are not correlated.
    """
    correlation = problem.prior.marginal(problem.estimated).correlation
    return np.asarray(np.linalg.solve(np.linalg.cholesky(correlation), np.eye(len(correlation))), dtype=np.float64)


def prior_information(problem: DesignProblem) -> Array:
    """The inverse (p, p) itself, which counts once beside the sum over the measurements."""
    rows = prior_rows(problem)
    return np.asarray(rows.T @ rows, dtype=np.float64)
