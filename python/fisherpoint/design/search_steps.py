"""What bars show of searches for points."""

from __future__ import annotations

from collections.abc import Callable

from ..show.progress import Step
from .optimality.goal import Goal
from .points.point_search import Progress


def points_step(goal: Goal) -> Callable[[Progress], Step]:
    """Steps of a progress bar for a search for points."""
    what = "log det" if goal.criterion == "D" else "log of the criterion"

    def step(now: Progress) -> Step:
        rate = now.drawn / now.seconds if now.seconds > 0 else 0.0
        state = f"{what} {now.log_det:.3f}, {rate:.0f} points/s"
        if now.iteration == now.max_iterations:
            state = "proving how good it is"
        return Step(now.iteration, now.max_iterations, state)

    return step


def sizes_step(sizes: list[int]) -> Callable[[int, Progress], Step]:
    """Steps of a progress bar for searches for designs of these sizes."""
    return lambda size, now: Step(sizes.index(size), len(sizes), f"{size} points, log det {now.log_det:.3f}")
