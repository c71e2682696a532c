"""Virtual data: what a rig with the prior's mean would measure."""

from __future__ import annotations

import fisherpoint as fp
from fisherpoint.data.measurement_files import measurements_csv
from fisherpoint.show.numbers import counted


def measured(problem: fp.DesignProblem, points: fp.Experiments | fp.Runs, seed: int) -> tuple[str, str]:
    """The text of a file of measurements, and in a line what was done."""
    starts = problem.initial_state_std
    rig = fp.VirtualRig(problem.model, problem.prior.mean, problem.noise_std or {}, initial_state_std=starts, seed=seed)
    data = rig.measure(points)
    what = counted(len(points), points.kind)
    return measurements_csv(data.points, data.y, problem.model), f"{what} measured virtually at the prior mean, seed {seed}"
