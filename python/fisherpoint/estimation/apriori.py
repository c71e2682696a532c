"""D of (17) for data that were taken: how outputs were expected to scatter about the prior's prediction before they were known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..data.measurements import Measurements
from ..predictive import predictive_covariance
from ..quantity import Array, names_of
from ..rules import DEFAULT_RULE
from ..trajectories import Status

if TYPE_CHECKING:
    from .fit import Fit


def apriori_covariance(fit: Fit) -> Array | None:
    """The noise's covariance plus the mean predictive covariance (16) of the points over the prior, (n_y, n_y).

    None where there is no prior of all parameters, where there are records, and where no point has its trajectories.
    """
    names = names_of(fit.model.parameters)
    if fit.prior is None or set(names) - set(fit.prior.names) or not all(isinstance(part, Measurements) for part in fit.data):
        return None
    points = Measurements.join(fit.data).points
    _, first, counts = np.unique(points.table, axis=0, return_index=True, return_counts=True)
    varied = tuple(name for name in names if name in fit.parameters)
    spread = predictive_covariance(fit.model, points[first], fit.prior.marginal(names), DEFAULT_RULE, parameters=varied)
    ok = spread.status == Status.ok
    if not ok.any():
        return None
    mean: Array = np.average(spread.covariance[ok], axis=0, weights=counts[ok])
    return mean + fit.noise_covariance
