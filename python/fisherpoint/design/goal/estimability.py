"""Estimability: which directions of the parameters candidates can determine, and criteria restricted to these."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...basics.values import Array
from ...information.combinations import combinations
from ...information.null_space import information_without_rounding, null_directions, without_rounding
from ...information.problem import DesignProblem
from ..candidates.candidate_rows import CandidateRows
from .criteria import Criterion
from .estimable_space import Estimable, estimable
from .goal import Goal
from .goal_criterion import criterion_of

NOT_ESTIMABLE = 1e-6
"""Share of what a criterion is about that may lie outside of the estimable space, as rounding."""

LOOKED_AT = 200
"""Number of candidates that are checked first for how many directions one of them determines."""

POINTS, RUNS = ("n_experiments", "points"), ("n_runs", "runs")
"""What errors call the count, and what is counted."""


def restricted_criteria(
    problem: DesignProblem,
    criteria: Sequence[Criterion],
    rows: Array,
    known: Array,
    count: int,
    singular: str,
    named: tuple[str, str] = POINTS,
    spaces: Sequence[Estimable] | None = None,
) -> tuple[tuple[Criterion, ...], tuple[Estimable, ...]]:
    """The objective for `count` points, or runs, and the space that the candidates determine together, in each scenario.

    Criteria of all parameters are restricted to what the candidates determine. Where so few points cannot determine all of that,
    the objective is log det F with a little added to F: other criteria would depend on the addition alone. For runs, which are
    many samples each, that is an error.

    Parameters
    ----------
    problem : DesignProblem
    criteria : sequence of Criterion
    rows : ndarray, (S, K, n, p)
        Whitened rows of the candidates in each scenario.
    known : ndarray, (S, p, p)
        Information available without them.
    count : int
    singular : {"estimable", "error"}
    named : (str, str)
        `POINTS` or `RUNS`.
    spaces : sequence of Estimable, optional
        What candidates determine in each scenario, where that is known from more than these.

    Raises
    ------
    ValueError
        Where they do not determine the functions or parameters of the criterion, or nothing at all; with "error" where they do
        not determine all parameters, or so few points cannot.
    """
    size, kind = named
    result: list[Criterion] = []
    if problem.output_covariance != "noise":  # only in units of the noise does the size say what is rounding
        unit = float(np.sqrt(np.square(rows).mean())) or 1.0
        rows, known = rows / unit, known / unit**2
    if spaces is None:
        spaces = [estimable(CandidateRows(own, there / count).triangle()) for own, there in zip(rows, known, strict=True)]
    for criterion, own, there, space in zip(criteria, rows, known, spaces, strict=True):
        name = criterion.name
        if not determined(problem, space) or criterion.outside(space) > NOT_ESTIMABLE:
            raise ValueError(
                f"region: expected {kind} that determine criterion {name!r}, given none with information on "
                f"{combinations(not_estimable(problem, space))}"
            )
        if criterion.restricted(space.span) is criterion:
            result.append(criterion)
            continue
        most = space.rank if count >= space.rank else _most(own, there, count, space.rank)
        too_few = most < space.rank
        if singular == "error":
            refuse_open(problem, space, count if too_few else None, named)
        if too_few and not criterion.of_all:
            if named == RUNS:
                raise ValueError(
                    f"{size}: expected enough {kind} to determine {determined(problem, space)} parameters, all of which criterion "
                    f"{name!r} needs, given {count}, which determine {most - problem.n_nuisance} at most"
                )
            criterion = criterion_of(problem, Goal())
        result.append(criterion.restricted_to(space))
    return tuple(result), tuple(spaces)


def refuse_open(problem: DesignProblem, space: Estimable, count: int | None, named: tuple[str, str] = POINTS) -> None:
    """Raise where points of a space leave parameters open; `count` is their number where these are too few."""
    size, kind = named
    if len(space.null):
        raise ValueError(
            f"region: expected {kind} that determine all parameters, as singular = 'error' requires, given none with "
            f"information on {combinations(not_estimable(problem, space))}, in prior std: estimate fewer parameters "
            "(parameters = [...]), measure other outputs, or widen the region"
        )
    if count is not None:
        raise ValueError(
            f"{size}: expected enough {kind} to determine {determined(problem, space)} parameters, as singular = 'error' requires, "
            f"given {count}, which leave some of them open whatever the {kind} are: take more {kind}, or estimate fewer parameters "
            "(parameters = [...])"
        )


def determined(problem: DesignProblem, space: Estimable) -> int:
    """How many combinations of the estimated parameters candidates determine: something is known of each nuisance one."""
    return space.rank - problem.n_nuisance


def not_estimable(problem: DesignProblem, space: Estimable) -> tuple[Mapping[str, float], ...]:
    """Combinations of standardised parameters that no candidate has information on."""
    p = len(problem.estimated)  # nuisance parameters take no part in any: something is known of each
    return null_directions(space.null[:, :p], space.length[:p], problem.estimated)


def _most(rows: Array, known: Array, count: int, enough: int) -> int:
    """How many directions so many points can determine at most; no less than `enough` where they can determine these."""
    known = information_without_rounding(known)
    size = np.sqrt(np.maximum(np.diag(known), 0.0))
    size = np.where(size > 0, size, 1.0)  # squares of well and badly determined parameters would differ by more than rounding
    most = int(np.linalg.matrix_rank(known / np.outer(size, size), hermitian=True))
    flat = without_rounding(rows.reshape(-1, rows.shape[2]))
    length = np.linalg.norm(flat, axis=0)
    scaled = (flat / np.where(length > 0, length, 1.0)).reshape(rows.shape)
    each = 0
    for some in (scaled[:: max(1, len(rows) // LOOKED_AT)], scaled):  # all, where the first do not suffice
        each = int(np.linalg.matrix_rank(some).max())
        if most + count * each >= enough:
            break
    return most + count * each
