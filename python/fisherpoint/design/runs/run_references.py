"""What classical runs tell, next to which a design is shown."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .run_objective import RunObjective
from .run_plants import RunPlants
from .run_pool import RunPool
from .run_profiles import CLASSICAL
from .sample_choice import best_samples

DRAWN = 100
"""Random runs of each profile."""

MOST_SEGMENTS = 100_000
"""Of all of them, on all plants; at least a few are drawn."""


class ClassicalRuns(NamedTuple):
    """log det F of runs of a classical profile, -inf where F is singular, and the share of the plants that can run them."""

    log_det: float
    share: float


def classical_runs(
    objective: RunObjective, plants: RunPlants, n_runs: int, samples: int | None, seed: int
) -> dict[str, ClassicalRuns]:
    """The best of some random runs of each classical profile, by its name.

    Best is what tells most at the prior mean, whether other plants can run it or not. Profiles of which hardly any run reaches its
    end are left out; and all, where no input changes from segment to segment.
    """
    if not objective.coordinates.inputs:
        return {}
    found: dict[str, ClassicalRuns] = {}
    objective.kappa = 0.0
    _, where = objective.coordinates.inputs[0]
    segments = where.stop - where.start
    wanted = max(4 * n_runs, 20, min(DRAWN, MOST_SEGMENTS // (segments * len(objective.plants))))
    for place, (name, profile) in enumerate(CLASSICAL.items()):
        rng = np.random.default_rng([seed, 2, place])
        try:
            z = RunPool(objective, wanted, rng, [profile]).chosen(n_runs, rng, part=1)
        except ValueError:
            continue
        runs = objective.coordinates.runs(z)
        selected = None if samples is None else best_samples(objective, runs, samples)
        value = objective.of(objective.judged(objective.tried(z, selected)))
        found[name] = ClassicalRuns(value, float(plants.can_run(runs).mean()))
    return found
