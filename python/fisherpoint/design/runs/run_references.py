"""What classical runs tell, next to which a design is shown."""

from __future__ import annotations

import numpy as np

from .run_objective import RunObjective
from .run_pool import RunPool
from .run_profiles import CLASSICAL
from .sample_choice import best_samples

DRAWN = 100
"""Random runs of each profile."""

MOST_SEGMENTS = 100_000
"""Of all of them, on all plants; at least a few are drawn."""


def classical_log_dets(objective: RunObjective, n_runs: int, samples: int | None, seed: int) -> dict[str, float]:
    """log det F of the best of some random runs of each classical profile, by its name; -inf where F is singular.

    Whether plants can run them is not asked. Profiles of which hardly any run reaches its end are left out; and all, where no
    input changes from segment to segment.
    """
    if not objective.coordinates.inputs:
        return {}
    objective.kappa, found = 0.0, {}
    _, where = objective.coordinates.inputs[0]
    segments = where.stop - where.start
    wanted = max(4 * n_runs, 20, min(DRAWN, MOST_SEGMENTS // (segments * len(objective.plants))))
    for place, (name, profile) in enumerate(CLASSICAL.items()):
        rng = np.random.default_rng([seed, 2, place])
        try:
            z = RunPool(objective, wanted, rng, [profile]).chosen(n_runs, rng, part=1)
        except ValueError:
            continue
        selected = None if samples is None else best_samples(objective, objective.coordinates.runs(z), samples)
        found[name] = objective.of(objective.judged(objective.tried(z, selected)))
    return found
