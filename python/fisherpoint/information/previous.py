"""Information that is already collected: points that were measured, or are planned, before those that are designed now."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol, TypeAlias, cast

import numpy as np

from ..basics.values import Array, FrozenMapping
from ..data.measured_outputs import runs_with_outputs
from ..points.rest_starts import start_points
from ..points.runs import Points, Runs, as_runs, points_of
from ..points.settings import on_surface
from ..points.status import Status, failures_of
from .output_covariance import needs_covariances
from .point_information import PointInformation, point_sensitivities, with_covariance
from .problem import DesignProblem
from .run_information import checked_problem, run_rows


class HasPoints(Protocol):
    """A design; measurements have outputs `y` (K, n_y), or (K, N, n_y), too, NaN where nothing was measured."""

    @property
    def points(self) -> Points: ...


Previous: TypeAlias = Points | HasPoints | Sequence[Points | HasPoints]


def previous_information(
    problem: DesignProblem, previous: Previous | None, threads: int | None
) -> tuple[PointInformation | None, Mapping[str, int]]:
    """Information of points that stay whatever is designed, and the number without information, by reason.

    What is no experiment point at the problem's prior mean has no information: measured starts and a mean that has moved since may
    bring a trajectory to a jump that it was planned to miss.

    Parameters
    ----------
    problem : DesignProblem
    previous : Measurements, Experiments, Design, a sequence of these, or None
        An output that was not measured (NaN) has no weight. A design counts as its points, without those that were previous to it.
    threads : int or None

    Raises
    ------
    TypeError, ValueError
        For something else, and for points or outputs that are not those of the problem's model.
    """
    parts = [_of_part(problem, part, threads) for part in _parts(previous)]
    left_out = sum((lost for _, lost in parts), Counter[str]())
    found = [information for information, _ in parts if len(information)]
    return PointInformation.join(found) if found else None, FrozenMapping(dict(left_out))


def _parts(previous: Any) -> list[Any]:
    """Single parts: experiment points, or something that has `points`, and maybe outputs `y`."""
    if previous is None:
        return []
    parts = list(previous) if isinstance(previous, list | tuple) else [previous]
    for part in parts:
        if points_of(part) is None:
            given = type(part).__name__
            raise TypeError(f"previous: expected Measurements, Experiments, Runs, a Design or a sequence of these, given {given}")
    return parts


def _of_part(problem: DesignProblem, part: Any, threads: int | None) -> tuple[PointInformation, Counter[str]]:
    if problem.along is not None:
        problem = problem.replace(along=None)  # what was measured has been possible
    model, runs, y = problem.model, as_runs(cast(Points, points_of(part))), getattr(part, "y", None)
    given, expected = (runs.x0.shape[1], runs.u.shape[2]), (len(model.states), len(model.inputs))
    if given != expected:
        raise ValueError(
            f"previous: expected points of {expected[0]} states and {expected[1]} inputs, given {given[0]} and {given[1]}"
        )
    if y is not None and y.shape[-1] != len(model.outputs):
        raise ValueError(f"previous: expected measurements of {len(model.outputs)} outputs, given {y.shape[-1]}")
    points = runs.points
    if points is None:
        return _of_runs(problem, runs, y, threads)
    lost: Counter[str] = Counter()
    keep = np.ones(len(points), dtype=bool)
    for surface, rows in on_surface(model, points, problem.theta, problem.crossed).items():
        lost[f"starts on {surface} = 0"] += int(keep[rows].sum())
        keep[rows] = False
    kept = np.flatnonzero(keep)
    information, status = point_sensitivities(problem, points[kept], threads)
    if needs_covariances(str(problem.output_covariance)):
        information, over_nodes = with_covariance(problem, information, threads)
        status = np.where(status != Status.ok, status, over_nodes)
    lost.update(failures_of(status))
    measured = None
    if y is not None:
        there = np.isfinite(y.reshape(len(points), -1)[kept])
        measured = None if there.all() else there
    return replace(information, measured=measured)[status == Status.ok], lost


def _of_runs(problem: DesignProblem, runs: Runs, y: Array | None, threads: int | None) -> tuple[PointInformation, Counter[str]]:
    """Information of runs; one that does not reach its end, or its last number, has none as a whole."""
    finite = None
    if y is not None:
        runs, y = runs_with_outputs(runs, y)
        finite = np.isfinite(y)
    first = start_points(problem.model, runs, problem.theta)
    starts = on_surface(problem.model, first, problem.theta, problem.crossed)
    lost = Counter({f"starts on {surface} = 0": len(rows) for surface, rows in starts.items()})
    kept = np.setdiff1d(np.arange(len(runs)), np.concatenate([[], *starts.values()]).astype(int))
    checked_problem(problem)
    rows = run_rows(problem, runs[kept], problem.theta, problem.integration(threads), None if finite is None else finite[kept])
    lost.update(failures_of(rows.status))
    kept, sensitivity = kept[rows.status == Status.ok], rows.sensitivity[rows.status == Status.ok]
    there = runs.measured[kept]
    samples = sensitivity[there]
    none = np.zeros((len(samples), samples.shape[1], samples.shape[1]))
    return PointInformation(runs[kept], samples, none, measured=None if finite is None else finite[kept][there]), lost
