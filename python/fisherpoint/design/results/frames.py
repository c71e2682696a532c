"""Tables of points, of parameters and of simulations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...basics.quantity import names_of
from ...information.evaluation import Evaluation
from ...information.problem import DesignProblem
from ...models import Model
from ...points.experiments import Experiments
from ...points.status import Status


def points_frame(model: Model, points: Experiments) -> pd.DataFrame:
    """The coordinates of the points, SI units, one row per point."""
    names = names_of(model.axes)
    return pd.DataFrame(points.table[:, : len(names)], pd.RangeIndex(len(points), name="point"), pd.Index(names))


def simulation_frame(model: Model, points: Experiments, y: NDArray[Any], status: NDArray[Any]) -> pd.DataFrame:
    """The points with their outputs at dt (``y_...``) and the names of their statuses, one row per point."""
    names = [quantity.name for quantity in model.axes]
    frame = pd.DataFrame(points.table[:, : len(names)], columns=names)
    for i, quantity in enumerate(model.outputs):
        frame[f"y_{quantity.name}"] = y[:, i]
    return frame.assign(status=[Status(int(code)).name for code in status])


def parameter_frame(problem: DesignProblem, under_noise: Evaluation | None) -> pd.DataFrame:
    """Mean, prior std, predicted standard error and RSE of each estimated parameter.

    The last two are under the sensor noise, and NaN where that is not known or F is singular.
    """
    units = {quantity.name: quantity.unit for quantity in problem.model.parameters}
    names = list(problem.estimated)
    rows = [(units[name], problem.prior.mean[name], problem.prior.std[name]) for name in names]
    frame = pd.DataFrame(rows, pd.Index(names, name="parameter"), ["unit", "mean", "prior_std"])
    predicted = ["standard_error", "rse", "of_prior"]
    if under_noise is None:
        return frame.assign(**dict.fromkeys(predicted, np.nan))
    return frame.join(under_noise.to_pandas()[predicted])
