"""A joint with sharp friction whose position is read on a clock of its own, for tests of sampling and of profiles."""

from __future__ import annotations

from typing import Any

import numpy as np

import fisherpoint as fp
from fisherpoint.design.goal.scenario_average import Average
from fisherpoint.design.runs.run_objective import RunObjective
from fisherpoint.points.run_coordinates import RunCoordinates

THETA = {"J": 0.05, "b": 0.1, "F": 0.3}
PRIOR = fp.GaussianPrior(THETA, relative_std=dict.fromkeys(THETA, 0.1))


def joint(torque: str = "u", friction: str = "sign(w)", **changes: Any) -> fp.SymbolicModel:
    """J dw = u - b w - F sign(w), with the torque and the direction of the friction by some texts."""
    given = {
        "states": {"q": "rad", "w": "rad/s"},
        "inputs": {"u": "N m"},
        "outputs": {"q": "rad"},
        "parameters": {"J": "kg m2", "b": "N m s/rad", "F": "N m"},
    }
    return fp.SymbolicModel(f=["w", f"({torque} - b*w - F*{friction})/J"], g=["q"], **(given | changes))  # type: ignore[arg-type]


def region(segments: int = 50, **changes: Any) -> fp.RunRegion:
    """Held torques on an actuator's clock of 20 ms, and samples each millisecond."""
    bounds = {"q": 0.0, "w": 0.0, "u": (-2.0, 2.0), "dt": 0.02} | changes.pop("bounds", {})
    return fp.RunRegion(bounds, segments, **({"sample_every": 1e-3} | changes))


def problem(of: fp.RunRegion, model: fp.SymbolicModel | None = None, **changes: Any) -> fp.DesignProblem:
    return fp.DesignProblem(model or joint(), PRIOR, of, **({"noise": {"q": 1e-3}} | changes))


def objective_of(given: fp.DesignProblem, plants: int = 1) -> RunObjective:
    """What a search maximises, at the prior mean and at plants beside it."""
    p = given.n_unknowns
    theta = given.theta * (1 + 0.05 * np.arange(plants)[:, None])
    coordinates = RunCoordinates(given.run_region, given.model)
    settings = given.integration(1)._replace(rtol=1e-9)
    return RunObjective(given, coordinates, theta, Average.of_all(plants), np.zeros((plants, p, p)), [], settings)
