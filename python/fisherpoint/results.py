"""What reports, pictures and files show: evaluated points, and tables of parameters and of simulations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import pandas as pd
from numpy.typing import NDArray

import fisherpoint as fp


class Evaluated(Protocol):
    """What reports and pictures need: a :class:`fisherpoint.Design` has it, and :class:`EvaluatedPoints`."""

    @property
    def problem(self) -> fp.DesignProblem: ...
    @property
    def points(self) -> fp.Experiments: ...
    @property
    def evaluation(self) -> fp.Evaluation: ...
    @property
    def under_noise(self) -> fp.Evaluation | None: ...


@dataclass(frozen=True)
class EvaluatedPoints:
    """Points that were not designed here, with their evaluation under the criterion's D and under the sensor noise."""

    problem: fp.DesignProblem
    points: fp.Experiments
    evaluation: fp.Evaluation
    under_noise: fp.Evaluation | None


def evaluate_points(problem: fp.DesignProblem, points: fp.Experiments, threads: int | None = None) -> EvaluatedPoints:
    """Evaluate `points` under the problem's output covariance and, where the noise is known, under it alone."""
    evaluation = fp.evaluate_design(problem, points, threads=threads)
    if problem.output_covariance == "noise":
        return EvaluatedPoints(problem, points, evaluation, evaluation)
    return EvaluatedPoints(problem, points, evaluation, fp.evaluate_under_noise(problem, points, threads=threads))


def simulation_frame(model: fp.Model, points: fp.Experiments, y: NDArray[Any], status: NDArray[Any]) -> pd.DataFrame:
    """The points with their outputs at dt (``y_...``) and the names of their statuses, one row per point."""
    names = [quantity.name for quantity in model.axes]
    frame = pd.DataFrame(points.table[:, : len(names)], columns=names)
    for i, quantity in enumerate(model.outputs):
        frame[f"y_{quantity.name}"] = y[:, i]
    return frame.assign(status=[fp.Status(int(code)).name for code in status])


def parameter_frame(problem: fp.DesignProblem, under_noise: fp.Evaluation | None) -> pd.DataFrame:
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
