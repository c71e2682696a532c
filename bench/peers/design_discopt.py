"""discopt-doe: all points are the inputs of one experiment, searched by `optimal_experiment` with exact derivatives from JAX.

`batch_optimal_experiment` states the same problem as a batch; it computes F point by point, and takes ten times as long.
"""

from __future__ import annotations

import math
import os
from typing import Any

os.environ.setdefault("JAX_PLATFORMS", "cpu")
os.environ.setdefault("JAX_ENABLE_X64", "1")

import discopt.modeling as dm
import jax  # noqa: F401
from discopt.doe import optimal_experiment
from discopt.estimate import Experiment, ExperimentModel

from .design_cases import DesignCase

PACKAGES = ("discopt-doe", "discopt", "jax")
STARTS = {"10 starts": 10, "1000 starts": 1000}


class PointsExperiment(Experiment):  # type: ignore[misc, unused-ignore]
    def __init__(self, case: DesignCase) -> None:
        self.case = case

    def create_model(self, **given: Any) -> Any:
        case, model = self.case, dm.Model("points")
        theta = {name: model.continuous(name, lb=value / 10, ub=value * 10) for name, value in case.parameters.items()}
        low, high = _bounds(case)
        inputs = {f"x{i}": model.continuous(f"x{i}", lb=low, ub=high) for i in range(case.n_points)}
        y = case.output(dm.exp)
        responses = {f"y{i}": y(dm.exp(x) if case.log_grid else x, theta) for i, x in enumerate(inputs.values())}
        return ExperimentModel(model, theta, inputs, responses, dict.fromkeys(responses, case.sigma))


def solve(case: DesignCase, variant: str) -> list[float]:
    """Return the points; `variant` is one of `STARTS`, of which 10 is the default."""
    bounds = {f"x{i}": _bounds(case) for i in range(case.n_points)}
    found = optimal_experiment(PointsExperiment(case), dict(case.parameters), bounds, n_starts=STARTS[variant])
    return [math.exp(value) if case.log_grid else float(value) for value in found.design.values()]


def _bounds(case: DesignCase) -> tuple[float, float]:
    """The starts are uniform between bounds, so that where a user would space them geometrically the input is the logarithm."""
    low, high = case.bounds
    return (math.log(low), math.log(high)) if case.log_grid else (low, high)
