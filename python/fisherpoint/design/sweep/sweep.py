"""`fp.sweep`: what designs of several sizes are worth, and what they cost."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Unpack

import numpy as np

from ...basics.checks import as_sequence, check_positive_int, check_type
from ...basics.extras import needed_for
from ...basics.options import with_options
from ...basics.result_files import Kept
from ...basics.stop_reason import StopReason
from ...basics.work_clock import Clock, OutOfTime
from ...engine.workers import Workers, check_workers, distributed_over
from ...information.evaluation import Evaluation
from ...information.point_information import PointInformation
from ...information.previous import Previous, previous_information
from ...information.problem import DesignProblem
from ...information.problem_report import problem_sections
from ...points.settings import check_threads, resolve_threads
from ...show.display import Plots, Shown
from ...show.progress import Progress, check_progress, following
from ...show.section import Report, Section
from ..goal.criteria import Criterion
from ..goal.estimability import determined, not_estimable, refuse_open
from ..goal.goal import Goal, goal_of
from ..goal.goal_criterion import known_beforehand
from ..points.candidate_archive import CandidateArchive
from ..points.exchange import check_determined, scenarios_of
from ..points.point_search import PointSearch
from ..points.size_search import SizedSearches
from ..points.starts import best_of_starts
from ..points.tuning import TimeTuning
from ..results.cost import Cost
from ..results.settings import MOST, ExchangeMethod, ExchangeSettings, SearchLimits, check_goal, method_of, most_iterations
from .sweep_record import SizedDesign, SweptDesigns, log_det_of
from .sweep_report import sweep_report

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

MOST_SIZES = 1000

NO_TIME = 1e-9
"""A time limit in seconds that is over at once."""


@dataclass(frozen=True, eq=False, repr=False)
class Sweep(SweptDesigns, Shown, Kept):
    """Designs of several sizes, as `sweep` found them; `SweptDesigns` has its attributes."""

    def _problem_sections(self) -> Sequence[Section]:
        return problem_sections(self.problem)

    def _plots(self) -> Plots:
        return {"sweep": self.plot}

    def report(self) -> Report:
        """The designs by size: their information, what is proven of them, and what they cost."""
        return sweep_report(self)

    def to_pandas(self) -> pd.DataFrame:
        """One row per size: information, at_least, duration, cost, and the standard errors of all parameters, SI units."""
        with needed_for("to_pandas"):
            import pandas as pd

        rows = []
        for of in self.designs:
            row: dict[str, Any] = {"n_experiments": len(of.points), "information": of.information, "at_least": of.at_least}
            row |= {"duration": float(of.points.dt.sum()), "cost": of.cost}
            rows.append(row | {name: (of.evaluation.standard_errors or {}).get(name) for name in self.problem.estimated})
        return pd.DataFrame(rows).set_index("n_experiments").astype(float)

    def plot(self, *, path: str | Path | None = None) -> Figure:
        """Draw the standard errors and the D-efficiency over the size, with the knee; needs matplotlib.

        Parameters
        ----------
        path : path, optional
            Where the picture is also written; the ending says the format, PNG where there is none.
        """
        with needed_for("plot"):
            from ...show.style import drawn
            from .sweep_picture import plot_sweep

        return drawn(plot_sweep(self), path)


@with_options
def sweep(
    problem: DesignProblem,
    n_experiments: Iterable[int],
    *,
    goal: str | Goal = "D",
    cost: Cost | None = None,
    method: str | ExchangeMethod = "auto",
    previous: Previous | None = None,
    n_candidates: int = 50,
    max_iterations: int | None = None,
    seed: int = 0,
    threads: int | None = None,
    workers: Workers | None = None,
    progress: bool | Callable[[Progress], None] | None = None,
    **limits: Unpack[SearchLimits],
) -> Sweep:
    """Find designs of several sizes, each from the last one and the candidates of all before.

    Parameters
    ----------
    problem : DesignProblem
        With a region and the sensor noise.
    n_experiments : iterable of int
        The sizes, such as ``range(9, 31)``.
    goal : str or Goal
        As for :func:`fisherpoint.exchange`, for each size; without `confidence`.
    cost : Cost, optional
        What the designs are charged with. It does not change the designs: each is the best that was found of its size.
    method : {"auto", "paper"} or ExchangeMethod
        As for :func:`fisherpoint.exchange`, for each size: also its `starts`. Its `time_limit` is that of all sizes: the sweep then
        has the sizes that are done and the best design so far of the next one.
    previous, n_candidates, max_iterations, seed, threads, workers
        As for :func:`fisherpoint.exchange`, for each size.
    progress : bool or callable, optional
        True shows a bar, on the terminal and in notebooks; needs rich. A function is called with a `Progress` after each iteration:
        the sizes that are done, and the log det of the best design so far of the next one.
    **limits
        ``starts`` and ``time_limit`` of the `method`.

    Returns
    -------
    Sweep
        Ctrl-C returns the sizes that are done; before the first is done, the best design of that size so far, if there is one.

    Raises
    ------
    TypeError, ValueError
        For misuse, and as `exchange`.
    """
    started = time.perf_counter()
    check_type(problem, DesignProblem, "problem")
    if problem.noise is None:
        raise ValueError("noise: expected the sensor noise, as sizes are compared by it, given None")
    if cost is not None:
        check_type(cost, Cost, "cost")
        cost.check(problem.model)
    check_progress(progress)
    check_workers(workers)
    sizes, given_threads, threads = _sizes(n_experiments), check_threads(threads), resolve_threads(threads)
    goal, method = goal_of(goal, "sweep"), method_of(method, **limits)
    settings = ExchangeSettings(
        n_experiments=sizes[0],
        goal=goal,
        method=method,
        n_candidates=n_candidates,
        max_iterations=most_iterations(max_iterations, method, problem),
        seed=seed,
    )
    check_goal(settings, problem)
    known, _ = previous_information(problem, previous, threads)
    scenarios = None if goal.over is None else scenarios_of(problem, settings, previous, None, known, threads)
    of_prior = known_beforehand(problem, goal)
    clock = Clock(method.time_limit)
    tuning = TimeTuning()
    clock.reserve = tuning.bounds_of_sweep * (method.time_limit or 0.0)
    seen = CandidateArchive(problem, threads, of_prior=of_prior, clock=clock, expected=tuning.tried_per_point * sizes[-1])
    searches = SizedSearches(problem, known, seen, scenarios)
    found: list[_Found] = []
    space, ridge, criteria = None, 0.0, seen.criteria
    search: PointSearch | None = None
    stop_reason = StopReason.completed
    try:
        with (
            following(progress, "sizes", "drawing the first points") as report,
            distributed_over(workers if method.starts > 1 else None, given_threads) as distributor,
        ):
            for size in sizes:
                of_size, limit = replace(settings, n_experiments=size), method.time_limit
                if limit is not None:  # what is left of it
                    left = max((1.0 - tuning.bounds_of_sweep) * limit - clock.seconds, NO_TIME)
                    of_size = replace(of_size, method=replace(method, time_limit=left))
                begun = None if report is None else partial(_report, report, size, len(found), len(sizes), started)
                search, ended = best_of_starts(searches.make(of_size), of_size, threads, distributor, begun)
                if ended == StopReason.interrupted:
                    raise KeyboardInterrupt
                check_determined(search)
                one = _found(search)
                if one.evaluation.null_directions:
                    space = search.find_estimable_space()
                    if goal.requires_all:
                        refuse_open(problem, space, size)
                seen.include(search.seen)
                criteria = search.criteria
                seen.criteria = (search.at_mean,)  # candidates for the next size are chosen by it, at the mean too
                ridge = max(ridge, search.ridge)
                found.append(one)
                searches.last = search
                if ended == StopReason.time_limit:
                    stop_reason = StopReason.time_limit
                    break
    except OutOfTime:
        stop_reason = StopReason.time_limit
    except KeyboardInterrupt:
        stop_reason = StopReason.interrupted
        if not found:
            if search is None:
                raise
            stop_reason = StopReason.interrupted_first  # who interrupts wants an end: nothing is proven of this one
            found.append(_found(search))
    level = None if space is None or not len(space.null) else determined(problem, space)
    seen.criteria, clock.reserve = criteria, 0.0
    designs, bound = [], None
    for information, evaluation, criterion, maximised in found:
        own = level if maximised is None else criterion.level
        value = log_det_of(evaluation, level) if maximised is None else maximised
        # Beside what is known it depends on the size.
        afresh = bound is None or known is not None or of_prior.any()
        if afresh and stop_reason != StopReason.interrupted_first and np.isfinite(value):
            try:
                bound = seen.bound(information, known) if scenarios is None else seen.bound_over(information, known, scenarios)
            except OutOfTime:
                bound = None
        points = information.experiments
        at_most = None if bound is None or not np.isfinite(value) else max(bound.log_det, value)
        costs = None if cost is None else cost.of(points, problem.model)
        degree = 1 if maximised is None else criterion.degree
        designs.append(SizedDesign(points, evaluation, costs, at_most, maximised=maximised, level=own, degree=degree))
    return Sweep(
        problem=problem,
        designs=tuple(designs),
        cost=cost,
        n_previous=0 if known is None else len(known),
        n_candidates=0 if bound is None else bound.n_candidates,
        stop_reason=stop_reason,
        settings=settings,
        seconds=time.perf_counter() - started,
        not_estimable=() if space is None else not_estimable(problem, space),
        ridge=ridge,
    )


def _report(report: Callable[[Progress], None], size: int, done: int, sizes: int, started: float, now: Progress) -> None:
    """Report the search for one size as a part of all."""
    far = now.message if now.value is None else f"log det {now.value:.3f}"
    report(Progress(done, sizes, now.value, f"{size} points, {far}", time.perf_counter() - started))


class _Found(NamedTuple):
    """A design of one size; `maximised` is None where that is log det F at the prior mean, and -inf where points are too few."""

    information: PointInformation
    evaluation: Evaluation
    criterion: Criterion
    maximised: float | None


def _found(search: PointSearch) -> _Found:
    evaluation, criterion, maximised = search.under_noise(), search.criteria[0], search.best.log_det
    assert evaluation is not None
    if criterion.name != search.settings.goal.criterion:  # the points are too few for it, and chosen by log det F
        criterion, maximised = search.unrestricted[0], -np.inf
    usual = search.scenarios is None and search.unrestricted[0].of_all
    return _Found(search.best.information, evaluation, criterion, None if usual else maximised)


def _sizes(given: Iterable[int]) -> list[int]:
    if isinstance(given, Mapping):
        raise TypeError("n_experiments: expected a sequence of whole numbers, such as range(9, 31), given a mapping")
    numbers = as_sequence(given, "n_experiments", "whole numbers, such as range(9, 31)")
    sizes = sorted({check_positive_int(size, "n_experiments", most=MOST["n_experiments"]) for size in numbers})
    if not sizes or len(sizes) > MOST_SIZES:
        raise ValueError(f"n_experiments: expected between 1 and {MOST_SIZES} sizes, given {len(sizes)}")
    return sizes
