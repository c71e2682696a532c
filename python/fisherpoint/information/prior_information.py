"""Prior information, as rows H (k, n_unknowns) beside those of data, in units of the unknowns' std: H^T H is the information."""

from __future__ import annotations

import numpy as np

from ..basics.values import Array
from .problem import DesignProblem

LEAST = 1e-5
"""Root of the information that searches count of a parameter of which nothing is known, in units of its prior std; no figure has
it."""


def parameter_rows(problem: DesignProblem) -> Array:
    """The prior of the estimated parameters: with their correlation L L^T, L^-1, and zeros for the nuisance parameters."""
    p = len(problem.estimated)
    correlation = problem.prior.marginal(problem.estimated).correlation
    return np.concatenate([np.linalg.solve(np.linalg.cholesky(correlation), np.eye(p)), np.zeros((p, problem.n_nuisance))], axis=1)


def nuisance_rows(problem: DesignProblem) -> Array:
    """What is known of the nuisance parameters: 1 for each, but for local parameters without a spread."""
    rows = np.eye(problem.n_unknowns)[len(problem.estimated) :]
    return rows if problem.assumed is None else np.delete(rows, problem.assumed.open, axis=0)


def least_rows(problem: DesignProblem) -> Array:
    """Next to nothing of local parameters without a spread, for searches: F stays regular where a design has nothing on them."""
    rows = np.eye(problem.n_unknowns)[len(problem.estimated) :]
    return LEAST * rows[[] if problem.assumed is None else problem.assumed.open]
