"""`fp.design_runs`: which runs to make."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from ...basics.checks import check_type
from ...basics.messages import listed, stacklevel_of_user, with_counts
from ...basics.options import with_options
from ...basics.stop_reason import StopReason
from ...basics.values import Array, FrozenMapping
from ...basics.work_clock import Clock
from ...engine.workers import Workers, check_workers, distributed_over
from ...information.combinations import combinations
from ...information.evaluate import evaluate_beside
from ...information.evaluation import NEARBY
from ...information.feasibility import Feasibility, feasibility_within
from ...information.output_covariance import output_covariance
from ...information.point_information import PointInformation
from ...information.previous import Previous, previous_information
from ...information.problem import DesignProblem
from ...information.run_information import checked_problem, information_matrices, information_of
from ...points.run_region import RunRegion
from ...points.runs import Runs
from ...points.settings import check_threads, resolve_threads
from ...show.progress import Progress, check_progress, following
from ..goal.estimable_space import RIDGE
from ..goal.goal import Goal, goal_of
from ..goal.goal_criterion import criterion_of, known_beforehand, prior_rows
from ..goal.over_prior import moved_problems
from ..goal.scenario_average import Average
from ..results.found_design import DRAWS, UNSEEN
from ..results.scenario_values import scenario_values
from ..results.settings import RunSettings
from .run_design import RunDesign
from .run_groups import RunGroup, best_of_groups
from .run_references import CLASSICAL_RUNS, ClassicalRuns
from .run_search import RunSearch
from .tuning import RunSearchTuning


@with_options
def design_runs(
    problem: DesignProblem,
    n_runs: int = 1,
    *,
    goal: str | Goal = "D",
    previous: Previous | None = None,
    keep: Runs | RunDesign | None = None,
    n_starts: int = 8,
    n_candidates: int = 500,
    seed: int = 0,
    time_limit: float | None = None,
    threads: int | None = None,
    workers: Workers | None = None,
    progress: bool | Callable[[Progress], None] | None = None,
) -> RunDesign:
    """Find the runs with the largest det F, or the best by another criterion, that enough of the prior's plants can run.

    Random runs with the usual profiles of inputs are exchanged for each other, then all free numbers of all runs are improved
    together by a Gauss-Newton ascent, and by single changes. Where that is much work, starts race: all get some of it, and the
    best go on (docs/explanation/runs.md).

    Parameters
    ----------
    problem : DesignProblem
        With a `RunRegion` and the sensor noise.
    n_runs : int
        L.
    goal : str or Goal
        The name of a criterion, such as "A", or all that the runs are to be good for. The output of "I" is predicted at experiment
        points. Without a `confidence` 99 % of the plants that the prior allows must reach the ends of all runs.
    previous : Measurements, Experiments, Runs, a design, or a sequence of these, optional
        What is already measured, or planned: its information counts beside that of the runs.
    keep : Runs or RunDesign, optional
        Runs that the design must have, such as those that were chosen by hand, or those of a design to be enlarged. They are its
        first, stay as they are, and count among the `n_runs`; they need not be of the region.
    n_starts : int
        How often the search begins anew, from random runs or classical ones; the problem has many local maxima. More than twelve
        are whole searches of up to twelve starts, with seeds that follow from the given one; the best one counts.
    n_candidates : int
        Random runs to begin with.
    seed : int
        The same seed gives the same design to the last bit, on any machine and with any number of threads and workers, unless a
        time limit ends the search.
    time_limit : float, optional
        Seconds in which the search returns what it has by then, a tenth more at most (docs/how_to/time_limits.md); of workers, each
        search. Without it the work is set by `n_starts` and `n_candidates`.
    threads : int, optional
        Default: every core.
    workers : int, Executor or Dask client, optional
        Who searches from groups of starts, one each at a time (docs/how_to/workers.md): up to twelve starts are one group. The
        runs are the same. Default: this process.
    progress : bool or callable, optional
        True shows a bar, on the terminal and in notebooks; needs rich. A function is called with a `Progress` after each turn of a
        start, with how many have begun; its value is the log det of the best runs so far.

    Returns
    -------
    RunDesign
        On Ctrl-C the best runs so far, once there are some. No classical run that is shown beside the design says more and can be
        run by as many plants.

    Raises
    ------
    TypeError, ValueError
        For misuse, where no run of the region is found that reaches its end, with the limits that end them, where the runs cannot
        determine a criterion other than "D", and parameters that are left open where the goal has ``singular="error"``.
    """
    check_type(problem, DesignProblem, "problem")
    region = problem.run_region
    checked_problem(problem)
    settings = RunSettings(
        n_runs=n_runs,
        goal=goal_of(goal),
        n_starts=n_starts,
        n_candidates=n_candidates,
        seed=seed,
        time_limit=time_limit,
    )
    goal = settings.goal
    check_progress(progress)
    clock = Clock(settings.time_limit)
    clock.reserve = RunSearchTuning().reserved_share * (settings.time_limit or 0.0)
    check_workers(workers)
    given_threads, threads = check_threads(threads), resolve_threads(threads)
    problems, average = ((problem,), Average.of_all(1)) if goal.over is None else moved_problems(problem, goal.over)
    theta = np.array([moved.theta for moved in problems])
    known, left_out = previous_information(problem, previous, threads)
    if left_out:
        reasons = with_counts(left_out)
        warnings.warn(f"previous: expected what is valid at the prior mean, left out {reasons}", stacklevel=stacklevel_of_user())
    beside = [
        known if known is None or moved is problem else previous_information(moved, previous, threads)[0] for moved in problems
    ]
    there = np.array([_matrix(moved, of, threads) for moved, of in zip(problems, beside, strict=True)])
    kept = None
    if keep is not None:
        kept = _kept(keep, region, settings.n_runs)
        there = there + np.array([_information_of_kept(moved, kept, threads) for moved in problems])
    there = there + known_beforehand(problem, goal)
    with following(progress, "start", "drawing the first runs") as report:
        if report is not None:
            clock.beat = lambda: report(Progress(0, settings.n_starts, None, "drawing the first runs", clock.seconds))
            if clock.limited:
                clock.beat()  # the first runs may take seconds
        group = RunGroup(
            problem,
            region,
            settings,
            theta,
            average,
            there,
            [criterion_of(moved, goal, threads) for moved in problems],
            kept,
            threads,
            partial(_check_pool, goal.requires_all),
        )
        with distributed_over(workers if settings.n_starts > settings.RACING else None, given_threads) as distributor:
            search, stop_reason = best_of_groups(group, distributor, clock, threads, report)
        if goal.criterion != "D" and not np.isfinite(search.best.value):
            raise ValueError(
                f"n_runs: expected enough runs to determine criterion {goal.criterion!r}, given {settings.n_runs}: the search "
                "has found none that do"
            )
        end = _judged(search, kept, stop_reason)
        runs, stop_reason = _with_kept(kept, end.runs), end.stop_reason
        search.clock.reserve = 0.0
        evaluation = evaluate_beside(problem, runs, threads, known, prior_rows(problem, goal), search.clock)
        if evaluation.without_nearby:
            search.left_out.append(NEARBY)
        if goal.requires_all and evaluation.null_directions and stop_reason == StopReason.completed:
            _refuse("these runs leave open", evaluation.null_directions, "make more runs, or longer ones with more samples")
    scenarios = None
    if goal.over is not None:
        of_each = [
            evaluate_beside(moved, runs, threads, of, prior_rows(moved, goal)) for moved, of in zip(problems, beside, strict=True)
        ]
        of_mean = None  # of F as in (7)
        if goal.criterion != "D":
            criterion = search.objective.criteria[0]
            of_mean = end.value - criterion.level * criterion.degree * float(np.log(evaluation.n_points / 2))
        scenarios = scenario_values(problems, average, of_each, of_mean)
    return RunDesign(
        problem=problem,
        settings=settings,
        runs=runs,
        evaluation=evaluation,
        log_det=-np.inf if search.singular else end.value,
        scenarios=scenarios,
        ends=tuple(-np.inf if search.singular else found.value + (end.value - search.best.value) for found in search.ends),
        again=search.again,
        feasibility=end.tried,
        stop_reason=stop_reason,
        drawn=search.pool.drawn,
        rejected=FrozenMapping(dict(search.pool.rejected)),
        seconds=clock.seconds,
        classical=FrozenMapping({name: one.log_det for name, one in end.classical.items()}),
        classical_shares=FrozenMapping({name: one.share for name, one in end.classical.items()}),
        n_kept=0 if kept is None else len(kept),
        ridge=RIDGE if search.singular else 0.0,
        signals=search.signals(end.z),
        left_out=tuple(dict.fromkeys(search.left_out)),
    )


def _check_pool(requires_all: bool, search: RunSearch) -> None:
    if requires_all and search.pool.singular:
        advice = "measure other outputs, estimate fewer parameters, or widen the region"
        _refuse("no run has information on", search.pool.open, advice)


def _with_kept(kept: Runs | None, runs: Runs) -> Runs:
    return runs if kept is None else Runs.join([kept, runs])


class _End(NamedTuple):
    """The design by its numbers and as it is carried out, what it is worth, and on which plants; classical runs; why it ended."""

    z: Array
    runs: Runs
    value: float
    tried: Feasibility
    classical: Mapping[str, ClassicalRuns]
    stop_reason: StopReason


def _judged(search: RunSearch, kept: Runs | None, reason: StopReason) -> _End:
    """The best runs, on plants that the search has not seen, which are computed by their held segments.

    Where a classical design says more, and as many of these plants can run it, it is the design.
    """

    def on_unseen(runs: Runs) -> Feasibility:
        seed = search.seed + UNSEEN
        return feasibility_within(search.problem, _with_kept(kept, runs), DRAWS, seed, search.threads, search.clock)

    z, runs, value = search.best.z, search.planned(search.best), search.best.value
    try:
        runs, value = search.tidy(search.best) if reason == StopReason.completed else (runs, value)
    except KeyboardInterrupt:
        reason = StopReason.interrupted
    tried = on_unseen(runs)
    classical: dict[str, ClassicalRuns] = {}
    try:
        for name, found in search.classical.items() if not search.singular else ():
            if search.clock.late():
                reason = StopReason.time_limit
                search.left_out.append(CLASSICAL_RUNS)
                break
            same = found is search.best
            own = runs if same else search.planned(found)
            of_plants = tried if same else on_unseen(own)
            of_all = search.worth_of_all_samples(own, value if same else found.value)
            classical[name] = ClassicalRuns(of_all, of_plants.share)
            if found.value > value and of_plants.share >= tried.share:
                z, runs, value, tried = found.z, own, found.value, of_plants
    except KeyboardInterrupt:
        reason = StopReason.interrupted
    return _End(z, search.sampled(runs), search.worth_of_all_samples(runs, value), tried, classical, reason)


def _refuse(what: str, directions: Sequence[Mapping[str, float]], help_: str) -> None:
    raise ValueError(
        f"region: expected runs that determine all parameters, as singular = 'error' requires; {what} "
        f"{combinations(directions)}, in prior std: {help_}"
    )


def _kept(keep: object, region: RunRegion, n_runs: int) -> Runs:
    """The runs that are kept, fewer than those of the design."""
    kept = getattr(keep, "runs", keep)
    if not isinstance(kept, Runs):
        raise TypeError(f"keep: expected Runs or a RunDesign, given {type(keep).__name__}")
    if not 0 < len(kept) < n_runs:
        raise ValueError(f"keep: expected fewer runs than n_runs, {n_runs}, and at least one; given {len(kept)}")
    if region.shared:
        raise ValueError(f"keep: expected a region without shared, as kept runs stay as they are, given {listed(region.shared)}")
    return kept


def _information_of_kept(moved: DesignProblem, kept: Runs, threads: int) -> Array:
    """F (p, p) of runs that are kept, in a scenario."""
    try:
        information = information_of(moved, kept, threads)
    except ValueError as error:
        raise ValueError(f"keep: expected runs that reach their ends, given others: {error}") from error
    return _matrix(moved, information, threads)


def _matrix(problem: DesignProblem, information: PointInformation | None, threads: int) -> Array:
    """F (p, p) of points and runs, if there are any."""
    if information is None:
        return np.zeros((problem.n_unknowns, problem.n_unknowns))
    if information.assumed is not None:  # points have D of their own
        white = output_covariance(problem, information, threads).prepare(information).sensitivity.reshape(-1, problem.n_unknowns)
        return np.asarray(white.T @ white)
    rows, measured = information.sensitivity, information.measured
    rows = rows if measured is None else np.where(measured[:, :, None], rows, 0.0)
    return np.asarray(information_matrices(problem, rows[None])[0])
