"""Classical runs: a search begins from them, and its report compares its design with them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...basics.values import Array
from ...basics.work_clock import OutOfTime
from .run_objective import RunObjective
from .run_pool import RunPool
from .run_profiles import CLASSICAL

CLASSICAL_RUNS = "classical runs to compare with"
"""What there was no time for, in words."""


class ClassicalRuns(NamedTuple):
    """log det F of runs of a classical profile, -inf where F is singular, and the share of the plants that can run them."""

    log_det: float
    share: float


def classical_runs(objective: RunObjective, n_runs: int, seed: int) -> tuple[dict[str, Array], bool]:
    """Free numbers (L, d) of the best of some random runs of each classical profile, by its name; whether there was time for all.

    The best has the most information at the prior mean, whether other plants can run it or not. All are left out where no input
    changes from segment to segment, and those that are not reached in the time.
    """
    found: dict[str, Array] = {}
    if not objective.coordinates.any_values:
        return found, True
    most = objective.tuning.most_classical_segments // (objective.coordinates.segments * len(objective.plants))
    wanted = max(4 * n_runs, 20, min(objective.tuning.classical_runs, most))
    for place, (name, profile) in enumerate(CLASSICAL.items()):
        rng = np.random.default_rng([seed, 2, place])
        try:
            pool = RunPool(objective, wanted, rng, [profile], explain=False)
            found[name] = pool.chosen(n_runs, rng, part=1)
        except ValueError:
            continue
        except OutOfTime:
            return found, False
        if pool.interrupted:
            raise KeyboardInterrupt
    return found, True
