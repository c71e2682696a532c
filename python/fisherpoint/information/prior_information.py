"""Prior information, as Fisher information beside that of the data."""

from __future__ import annotations

import numpy as np

from ..basics.values import Array
from .problem import DesignProblem


def prior_rows(problem: DesignProblem, of_parameters: bool) -> Array:
    """Rows H (k, n_unknowns), as those of data, whose H^T H is the prior information on the unknowns, in units of their std.

    That is 1 for each nuisance parameter, and with `of_parameters` the inverse of the prior's covariance of the estimated ones:
    with their correlation L L^T, L^-1.
    """
    p, rows = len(problem.estimated), np.eye(problem.n_unknowns)
    if not of_parameters:
        return rows[p:]
    correlation = problem.prior.marginal(problem.estimated).correlation
    rows[:p, :p] = np.linalg.solve(np.linalg.cholesky(correlation), np.eye(p))
    return rows


def prior_information(problem: DesignProblem, of_parameters: bool) -> Array:
    """H^T H (n_unknowns, n_unknowns) itself, which counts once beside the sum over the measurements."""
    rows = prior_rows(problem, of_parameters)
    return np.asarray(rows.T @ rows, dtype=np.float64)
