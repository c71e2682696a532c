"""Prior information, as rows H (k, n_unknowns) beside those of data, in units of the unknowns' std: H^T H is the information."""

from __future__ import annotations

import numpy as np

from ..basics.values import Array
from .problem import DesignProblem


def parameter_rows(problem: DesignProblem) -> Array:
    """The prior of the estimated parameters: with their correlation L L^T, L^-1, and zeros for the nuisance parameters."""
    p = len(problem.estimated)
    correlation = problem.prior.marginal(problem.estimated).correlation
    return np.concatenate([np.linalg.solve(np.linalg.cholesky(correlation), np.eye(p)), np.zeros((p, problem.n_nuisance))], axis=1)


def nuisance_rows(problem: DesignProblem) -> Array:
    """What is known of the nuisance parameters: 1 for each."""
    return np.eye(problem.n_unknowns)[len(problem.estimated) :]
