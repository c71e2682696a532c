"""Data of other plants than the one of a design: what is local to a plant has values of its own there, which are eliminated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array
from ..noise.common_error import CommonError, beside_free
from .point_information import PointInformation
from .problem import DesignProblem


def without_other_groups(
    problem: DesignProblem, information: PointInformation, labels: Mapping[str, NDArray[np.object_]]
) -> PointInformation:
    """The samples with rows from which the values in other groups are eliminated.

    Parameters
    ----------
    problem : DesignProblem
    information : PointInformation
        (K, n_y, n_unknowns)
    labels : mapping of name to ndarray, (K,)
        Of each local parameter, whose value a sample has; None where it is that of the design.
    """
    assumed = problem.assumed
    if assumed is None:
        return information
    shared, p = dict(zip(assumed.nuisance_names, range(problem.n_nuisance), strict=True)), len(problem.estimated)
    columns = {p + shared[name]: of for name, of in labels.items() if name in shared and any(one is not None for one in of)}
    if not columns:
        return information
    if problem.output_covariance != "noise":
        raise ValueError(
            f"local: expected output_covariance='noise' beside data of other plants, given {problem.output_covariance!r}"
        )
    factor, rows = _weighed(problem, information)
    known, free = [np.zeros((*rows.shape[:2], 0))], [np.zeros((*rows.shape[:2], 0))]
    rest = rows.copy()
    for column, of in columns.items():
        elsewhere = np.array([one is not None for one in of])
        groups = sorted({one for one in of if one is not None})
        own = np.where((of[:, None] == np.array(groups, dtype=object))[:, None, :], rows[:, :, column, None], 0.0)
        (free if column - p in assumed.open else known).append(own)
        rest[elsewhere, :, column] = 0.0
    by_known, by_free = np.concatenate(known, axis=2), np.concatenate(free, axis=2)
    count, n_y, width = rest.shape
    together = np.concatenate([rest, by_free], axis=2).reshape(count * n_y, -1)
    white = CommonError.of(by_known.reshape(count * n_y, -1)).whitened(together) if by_known.shape[2] else together
    left = beside_free(white[None, None, :, :width], white[None, None, :, width:])[0, 0].reshape(rest.shape)
    return replace(information, sensitivity=np.asarray(factor @ left))


def _weighed(problem: DesignProblem, information: PointInformation) -> tuple[Array, Array]:
    """L (K, n_y, n_y) of the covariances of the samples, and their rows in units of L, zero where not measured."""
    measured = np.broadcast_to(problem.measured, information.sensitivity.shape[:2])
    if information.measured is not None:
        measured = measured & information.measured
    covariance = problem.noise_covariance if information.assumed is None else problem.noise_covariance + information.assumed
    both = measured[:, :, None] & measured[:, None, :]
    factor = np.linalg.cholesky(np.where(both, covariance, np.eye(measured.shape[1])))
    rows = np.linalg.solve(factor, np.where(measured[:, :, None], information.sensitivity, 0.0))
    return np.asarray(factor), np.asarray(rows)
