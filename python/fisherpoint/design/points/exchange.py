"""The exchange of points: Algorithm 1, or a search that goes on to the best design it can find.

Lines 11 and 13 of the algorithm print "arg min"; the reading is that the candidate with the largest Phi enters, and the point whose
removal leaves the largest Phi leaves. That may be the candidate itself, so Phi never falls.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Unpack

import numpy as np

from ...basics.checks import check_type
from ...basics.options import with_options
from ...basics.stop_reason import StopReason
from ...basics.work_clock import Clock, OutOfTime
from ...engine.workers import Distributor, Workers, check_workers, distributed_over
from ...information.candidates import surviving
from ...information.evaluation import Evaluation
from ...information.nuisance import beside_nuisance
from ...information.output_covariance import needs_covariances
from ...information.point_information import PointInformation, with_covariance
from ...information.previous import Previous, previous_information
from ...information.problem import DesignProblem
from ...points.experiments import Experiments
from ...points.points_or_runs import as_runs, points_of
from ...points.region import ExperimentRegion
from ...points.settings import check_threads, resolve_threads
from ...points.status import Status, failures_of
from ...show.progress import Progress, check_progress, following
from ..goal.estimability import determined, refuse_open
from ..goal.goal import Goal, goal_of
from ..goal.over_prior import Scenarios, moved_problems
from ..results.design import Design
from ..results.efficiency import LEAST_RANDOM_DESIGNS, Efficiency, efficiency_of, median_of, random_designs
from ..results.found_design import FoundDesign
from ..results.settings import ExchangeMethod, ExchangeSettings, SearchLimits, check_goal, method_of, most_iterations, searched_by
from .auto_search import AutoSearch
from .exchange_search import ExchangeSearch
from .point_search import PointSearch
from .starts import best_of_starts


@with_options
def exchange(
    problem: DesignProblem,
    n_experiments: int = 12,
    *,
    goal: str | Goal = "D",
    method: str | ExchangeMethod = "auto",
    previous: Previous | None = None,
    keep: Experiments | FoundDesign | None = None,
    n_candidates: int = 50,
    max_iterations: int | None = None,
    seed: int = 0,
    threads: int | None = None,
    workers: Workers | None = None,
    progress: bool | Callable[[Progress], None] | None = None,
    **limits: Unpack[SearchLimits],
) -> Design:
    """Find the design with the largest det F, or the best by another goal, by exchanging points for candidates.

    Parameters
    ----------
    problem : DesignProblem
        With a region.
    n_experiments : int
        L points, a million at most.
    goal : str or Goal
        The name of a criterion, such as "A", or all that the design is to be good for, such as
        ``Goal("c", of="a / b", over=OverPrior("log"))``. All but log det F at the prior mean is for method "auto" with D = R,
        `confidence` is for method "auto": points then keep so far away from jumps and limits that plants further out than the
        prior's can run them, and `Design.feasible` says whether that was enough. Where points are too few for "A", "E" and "ME",
        they are chosen by log det F.
    method : {"auto", "paper"} or ExchangeMethod
        The search, or that with its own options: :class:`fisherpoint.ExchangeMethod`.
    previous : Measurements, Experiments, Design, or a sequence of these, optional
        Points whose information is already collected. They are added to every design and never leave: F is that of all L points,
        previous and new, and so are the design's evaluations and what it is compared with. The standard errors are then those of
        an estimate from all data together; they do not take in the prior, also where this is the posterior of the previous data.
    keep : Experiments or Design, optional
        Points that the design must have, such as those that were chosen by hand, or those of a design to be enlarged. They are
        its first points, never leave, and count among the `n_experiments`.
    n_candidates : int
        M candidates per draw, a million at most.
    max_iterations : int, optional
        Default: 800, and 200 where the search is that of the paper.
    seed : int
        The same seed gives the same design, for any number of threads and workers.
    threads : int, optional
        Default: every core.
    workers : int, Executor or Dask client, optional
        Who does the starts of the `method`, one each at a time (docs/how_to/workers.md). The design is the same. Default: this
        process.
    progress : bool or callable, optional
        True shows a bar, on the terminal and in notebooks; needs rich. A function is called with a `Progress` after each
        iteration, or of several starts after each of them; its value is the log det, or the log of the criterion, of the best
        design so far.
    **limits
        ``starts`` and ``time_limit`` of the `method`, as in ``exchange(problem, starts=8, time_limit=60)``.

    Returns
    -------
    Design
        Ctrl-C during the search returns the best design so far, with stop_reason "interrupted"; of starts that workers do, the best
        of those that have ended without a gap.

    Raises
    ------
    ValueError
        For misuse, points to keep that are not valid, a region in which hardly a point survives, a singular output covariance,
        points that do not determine what "c", "Ds" or "I" need, and parameters that are left open where the goal has
        ``singular="error"``.
    """
    check_type(problem, DesignProblem, "problem")
    method = method_of(method, **limits)
    settings = ExchangeSettings(
        n_experiments=n_experiments,
        goal=goal_of(goal),
        method=method,
        n_candidates=n_candidates,
        max_iterations=most_iterations(max_iterations, method, problem),
        seed=seed,
    )
    *_, found = designs(problem, settings, previous=previous, keep=keep, threads=threads, workers=workers, progress=progress)
    return found


def designs(
    problem: DesignProblem,
    settings: ExchangeSettings,
    *,
    previous: Previous | None = None,
    keep: Experiments | FoundDesign | None = None,
    threads: int | None = None,
    workers: Workers | None = None,
    progress: bool | Callable[[Progress], None] | None = None,
) -> Iterator[Design]:
    """Yield the design as soon as it is found, and at last with what it is compared with; arguments are as of `exchange`."""
    check_goal(settings, problem)
    check_progress(progress)
    check_workers(workers)
    with distributed_over(workers if settings.method.starts > 1 else None, check_threads(threads)) as distributor:
        yield from _designs(problem, settings, previous, keep, resolve_threads(threads), distributor, progress)


def _designs(
    problem: DesignProblem,
    settings: ExchangeSettings,
    previous: Previous | None,
    keep: Experiments | FoundDesign | None,
    threads: int,
    distributor: Distributor,
    progress: bool | Callable[[Progress], None] | None,
) -> Iterator[Design]:
    known, left_out = previous_information(problem, previous, threads)
    kept = scenarios = None
    if keep is not None:
        known, kept = _with_kept(problem, keep, known, settings.n_experiments, threads)
    if settings.goal.over is not None:
        scenarios = scenarios_of(problem, settings, previous, keep, known, threads)
    with following(progress, "iteration", "drawing the first points") as report:
        make = partial(_search, problem, previous=known, kept=kept, scenarios=scenarios)
        search, stop_reason = best_of_starts(make, settings, threads, distributor, report)
        interrupted = stop_reason == StopReason.interrupted
        if not interrupted:
            check_determined(search)
        efficiency = None
        search.time.reserve *= search.settings.method.references * search.tuning.limit.kept_for_references
        under_noise = search.under_noise()
        search.time.reserve = 0.0
        evaluation = search.evaluation(under_noise)
        if evaluation.null_directions:
            space = search.find_estimable_space()
            if settings.goal.requires_all and not interrupted:
                refuse_open(problem, space, settings.n_experiments)
        if settings.method.references and not interrupted:
            yield Design(**vars(search.found(stop_reason, evaluation, under_noise, None, left_out)))
            try:
                efficiency = _references(search, evaluation, under_noise)
            except OutOfTime:
                stop_reason = StopReason.time_limit
                search.left_out.append("what the design is compared with")
            except KeyboardInterrupt:
                stop_reason = StopReason.interrupted
    yield Design(**vars(search.found(stop_reason, evaluation, under_noise, efficiency, left_out)))


def check_determined(search: PointSearch) -> None:
    """Raise where no points were found that determine a criterion other than log det F."""
    criterion, count = search.settings.goal.criterion, search.settings.n_experiments
    if not np.isfinite(search.best.log_det) and not search.criteria[0].of_all:
        raise ValueError(
            f"n_experiments: expected enough points to determine criterion {criterion!r}, given {count}: no design that does was"
            " found; increase n_experiments"
        )


def scenarios_of(
    problem: DesignProblem,
    settings: ExchangeSettings,
    previous: Previous | None,
    keep: Experiments | FoundDesign | None,
    at_mean: PointInformation | None,
    threads: int,
) -> Scenarios:
    """The problem at each scenario, and what is known there."""
    assert settings.goal.over is not None
    problems, average = moved_problems(problem, settings.goal.over)
    of_all = []
    for moved in problems:
        known = at_mean
        if moved is not problem:
            known, _ = previous_information(moved, previous, threads)
            if keep is not None:
                known, _ = _with_kept(moved, keep, known, settings.n_experiments, threads)
        of_all.append(known)
    return Scenarios(problems, average, tuple(of_all))


def _with_kept(
    problem: DesignProblem, keep: Experiments | FoundDesign, known: PointInformation | None, n_experiments: int, threads: int
) -> tuple[PointInformation, Experiments]:
    """Return the known points beside those to be found, and the points that are kept."""
    given = points_of(keep)
    kept = None if given is None else as_runs(given).points
    if kept is None:
        raise TypeError(f"keep: expected Experiments or a Design of points, given {type(keep).__name__}")
    if not 0 < len(kept) < n_experiments:
        raise ValueError(f"keep: expected fewer points than n_experiments, {n_experiments}, and at least one; given {len(kept)}")
    region = problem.region if isinstance(problem.region, ExperimentRegion) else None
    information, places, lost = surviving(problem, region, kept, threads)
    if needs_covariances(str(problem.output_covariance)) and len(places) == len(kept):
        information, status = with_covariance(problem, information, threads)
        places, lost = np.flatnonzero(status == Status.ok), Counter(failures_of(status))
    if len(places) < len(kept):
        wrong = int(np.setdiff1d(np.arange(len(kept)), places)[0])
        raise ValueError(f"keep: expected valid points, given points[{wrong}], which is none: {', '.join(+lost)}")
    return information if known is None else PointInformation.join([known, information]), kept


def _search(
    problem: DesignProblem,
    settings: ExchangeSettings,
    threads: int,
    previous: PointInformation | None,
    kept: Experiments | None,
    scenarios: Scenarios | None = None,
    clock: Clock | None = None,
) -> PointSearch:
    """The search of a method; where D depends on all points, or on a point's own covariance, that of the paper."""
    if searched_by(settings.method.name, problem) == "auto":
        return AutoSearch(problem, settings, threads, previous, kept, scenarios, clock)
    return ExchangeSearch(problem, settings, threads, previous, kept, clock=clock)


def _references(search: PointSearch, evaluation: Evaluation, under_noise: Evaluation | None) -> Efficiency:
    """The median random design, a bound for designs of the candidates, and where D is not R what a search with D = R finds."""
    if under_noise is None:
        return efficiency_of(search.problem, search.d, search.best.log_det)
    problem, settings, seen = search.problem.replace(output_covariance="noise"), search.settings, search.seen
    best_found = None
    if search.d.kind != "noise":
        other_seed = replace(settings, seed=settings.seed + 1)
        other = _search(problem, other_seed, search.threads, search.previous, search.kept, clock=search.time)
        with search.time.part(search.tuning.limit.other_share):
            ended = other.run(None)
        if ended == StopReason.interrupted:
            raise KeyboardInterrupt
        if ended != StopReason.time_limit or other.trace[-1].iteration > 1:
            best_found = other.best.log_det
        else:
            search.left_out.append("another search, with D = R")
        seen.include(other.seen)
    criterion, log_det = search.at_mean, under_noise.log_det
    if not criterion.plain:
        log_det = criterion.objective(beside_nuisance(under_noise.fisher, search.problem.n_nuisance))
    too_few = search.space is not None and evaluation.rank < determined(search.problem, search.space)
    total = search.count + (0 if search.previous is None else len(search.previous))
    random, bound = np.empty(0), None
    with search.time.part(search.tuning.limit.random_share):
        start = search.count, settings.seed, search.threads, search.previous, search.time
        random = random_designs(problem, *start, lambda fisher: criterion.objective(fisher + 2 / total * search.of_prior))
    if search.time.limited and len(random) < LEAST_RANDOM_DESIGNS:
        search.left_out.append("random designs")
    try:
        if not too_few or not settings.goal.of_all:
            own, over = search.best.information, search.scenarios
            bound = seen.bound(own, search.previous) if over is None else seen.bound_over(own, search.previous, over)
    except OutOfTime:
        search.left_out.append("the bound of all designs of the candidates")
    return efficiency_of(
        search.problem,
        search.d,
        search.best.log_det,
        log_det,
        bound,
        best_found,
        median_of(random) if len(random) >= LEAST_RANDOM_DESIGNS else None,
        of_criterion=search.scenarios is not None,
        level=criterion.level,
    )
