"""What takes either experiment points or runs: as one of them, and joined."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

from .experiments import Experiments
from .runs import Runs

Points: TypeAlias = Experiments | Runs
"""What is carried out: experiment points, or runs."""


def as_runs(points: Points) -> Runs:
    """Return points as runs of one segment, and runs as they are; raise TypeError for anything else."""
    if isinstance(points, Runs):
        return points
    if not isinstance(points, Experiments):
        raise TypeError(f"points: expected Experiments or Runs, given {type(points).__name__}")
    return Runs.of_points(points)


def points_of(given: Any) -> Points | None:
    """Return the points or runs that something is, or has as designs and measurements do; None where there are none."""
    points = given if isinstance(given, Experiments | Runs) else getattr(given, "points", None)
    return points if isinstance(points, Experiments | Runs) else None


def as_flat(runs: Runs, points: Points) -> Points:
    """Return runs as points where the others are points."""
    return runs if isinstance(points, Runs) else runs.starts


def joined(parts: Sequence[Points]) -> Points:
    """Return all parts, one after the other; points are runs of one segment where runs are among them."""
    points = [part for part in parts if isinstance(part, Experiments)]
    return Experiments.join(points) if len(points) == len(parts) else Runs.join([as_runs(part) for part in parts])
