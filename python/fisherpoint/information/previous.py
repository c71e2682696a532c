"""Information that is already collected: points that were measured, or are planned, before those that are designed now."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, Protocol, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from ..basics.values import FrozenMapping
from ..data.measured_outputs import runs_with_outputs
from ..points.experiments import Experiments
from ..points.points_or_runs import Points, as_runs, points_of
from ..points.rest_starts import start_points
from ..points.runs import Runs
from ..points.settings import on_surface
from ..points.status import Status, failures_of
from .other_groups import without_other_groups
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
        Measurements with labels are of other plants, or days, than the design, where parameters are local to these; without, they
        are of the same.
    threads : int or None

    Raises
    ------
    TypeError, ValueError
        For something else, and for points or outputs that are not those of the problem's model.
    """
    parts = [_of_part(problem, part, threads) for part in _parts(previous)]
    left_out = FrozenMapping(dict(sum((part.lost for part in parts), Counter[str]())))
    found = [part for part in parts if len(part.information)]
    if not found:
        return None, left_out
    information = PointInformation.join([part.information for part in found])
    labels = {}
    for name, one in problem.local_parameters.items():
        of_parts = [part.labels.get(one.by, np.full(len(part.information), None)) for part in found]
        labels[name] = np.concatenate(of_parts)
    return without_other_groups(problem, information, labels), left_out


class _Part(NamedTuple):
    """Information of one set of data, what has none by reason, and labels of the samples, (S,), by name."""

    information: PointInformation
    lost: Counter[str]
    labels: Mapping[str, NDArray[np.object_]]


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


def _of_part(problem: DesignProblem, part: Any, threads: int | None) -> _Part:
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
    points, finite, kept = runs.points, None, np.arange(len(runs))
    if y is not None:
        y = y.reshape(*runs.dt.shape, -1)
        if points is None:
            kept = np.flatnonzero(np.isfinite(y).any(axis=(1, 2)))
            runs, y = runs_with_outputs(runs, y)
            points = runs.points
        finite = np.isfinite(y)
    lost: Counter[str] = Counter()
    keep = np.ones(len(runs), dtype=bool)
    first = start_points(model, runs, problem.theta)
    for surface, rows in on_surface(model, first, problem.theta, problem.crossed).items():
        lost[f"starts on {surface} = 0"] += int(keep[rows].sum())
        keep[rows] = False
    finite = None if finite is None else finite[keep]
    runs = runs[keep]
    found = _of_runs(problem, runs, finite, threads) if points is None else _of_points(problem, points[keep], finite, threads)
    information, ok, failed = found
    kept, samples = kept[keep][ok], runs[ok].measured.sum(axis=1) if ok.any() else np.zeros(0, dtype=int)
    labels = {name: np.repeat(np.array(given, dtype=object)[kept], samples) for name, given in getattr(part, "labels", {}).items()}
    return _Part(information, lost + failed, labels)


def _of_points(
    problem: DesignProblem, points: Experiments, finite: NDArray[np.bool_] | None, threads: int | None
) -> tuple[PointInformation, NDArray[np.bool_], Counter[str]]:
    """Information of points, which of them have some, and how many have none."""
    information, status = point_sensitivities(problem, points, threads)
    if needs_covariances(str(problem.output_covariance)):
        information, over_nodes = with_covariance(problem, information, threads)
        status = np.where(status != Status.ok, status, over_nodes)
    measured = None if finite is None or finite.all() else finite[:, 0]
    ok = status == Status.ok
    return replace(information, measured=measured)[ok], ok, Counter(failures_of(status))


def _of_runs(
    problem: DesignProblem, runs: Runs, finite: NDArray[np.bool_] | None, threads: int | None
) -> tuple[PointInformation, NDArray[np.bool_], Counter[str]]:
    """Information of runs; one that does not reach its end, or its last number, has none as a whole."""
    checked_problem(problem)
    rows = run_rows(problem, runs, problem.theta, problem.integration(threads), finite)
    kept = rows.status == Status.ok
    there = runs.measured[kept]
    samples = rows.sensitivity[kept][there]
    none = np.zeros((len(samples), samples.shape[1], samples.shape[1]))
    measured = None if finite is None else finite[kept][there]
    return PointInformation(runs[kept], samples, none, measured=measured), kept, Counter(failures_of(rows.status))
