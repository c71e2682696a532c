"""How measurements were expected to scatter before: D of (17)."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from ..basics.quantity import names_of
from ..basics.values import Array
from ..data.measurements import Measurements
from ..data.record import Record
from ..models import Model
from ..points.predictive import predictive_covariance
from ..points.status import Status
from ..prior.gaussian import GaussianPrior
from ..prior.rules import DEFAULT_RULE


def apriori_covariance(
    model: Model, data: Sequence[Measurements | Record], prior: GaussianPrior | None, estimated: Collection[str], noise: Array
) -> Array | None:
    """The noise's covariance plus the mean predictive covariance (16) of the points over the prior, (n_y, n_y).

    None where there is no prior of all parameters, where there are records or runs, where no point has its trajectories, and for a
    model with updates or late outputs.
    """
    names = names_of(model.parameters)
    measured = [part for part in data if isinstance(part, Measurements)]
    if prior is None or set(names) - set(prior.names) or len(measured) < len(data):
        return None
    runs = Measurements.join(measured).runs
    points = runs.points
    if points is None or model.updates or model.late_outputs:
        return None
    first, of = runs.distinct()
    counts = np.bincount(of)
    varied = tuple(name for name in names if name in estimated)
    spread = predictive_covariance(model, points[first], prior.marginal(names), DEFAULT_RULE, jumps="cross", parameters=varied)
    ok = spread.status == Status.ok
    if not ok.any():
        return None
    mean: Array = np.average(spread.covariance[ok], axis=0, weights=counts[ok])
    return mean + noise
