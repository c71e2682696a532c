"""Tables of parameters and of simulations, for files."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..information.evaluation import Evaluation
from ..information.problem import DesignProblem
from ..models import Model
from ..points.experiments import Experiments
from ..points.trajectories import Status


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
    errors = (under_noise and under_noise.standard_errors) or {}
    relative = (under_noise and under_noise.rse) or {}
    frame = pd.DataFrame(
        {
            "unit": [units[name] for name in names],
            "mean": [float(problem.prior.mean[name]) for name in names],
            "prior_std": [float(problem.prior.std[name]) for name in names],
            "standard_error": [float(errors.get(name, np.nan)) for name in names],
            "rse": [float(relative.get(name, np.nan)) for name in names],
        },
        index=pd.Index(names, name="parameter"),
    )
    return frame.assign(of_prior=frame.standard_error / frame.prior_std)
