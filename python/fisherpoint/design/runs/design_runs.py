"""`fp.design_runs`: which runs to make."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np

from ...basics.checks import check_type
from ...basics.values import Array, FrozenMapping
from ...engine.levels import kernels
from ...information.evaluation import evaluate_design
from ...information.feasibility import feasibility
from ...information.point_information import PointInformation
from ...information.previous import Previous, previous_information
from ...information.problem import DesignProblem
from ...information.run_information import checked_problem, information_matrices
from ...points.run_region import RunRegion
from ...points.settings import resolve_threads
from ...show.progress import check_progress, following
from ..average import Average
from ..found import DRAWS, UNSEEN
from ..over_prior import OverPrior, moved_problems
from ..scenario_values import scenario_values
from ..settings import RunSettings
from ..told import runs_step
from .run_design import RunDesign
from .run_references import ClassicalRuns, classical_runs
from .run_search import RunProgress, RunSearch


def design_runs(
    problem: DesignProblem,
    n_runs: int = 1,
    *,
    n_starts: int = 8,
    n_candidates: int = 500,
    confidence: float | None = 0.99,
    seed: int = 0,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: bool | Callable[[RunProgress], None] | None = None,
    previous: Previous | None = None,
    over: OverPrior | None = None,
) -> RunDesign:
    """Find the runs with the largest det F that enough of the prior's plants can run.

    Random runs with the usual profiles of inputs are exchanged for each other, then all free numbers of all runs are improved
    together by a Gauss-Newton ascent, and by single changes (docs/explanation/runs.md).

    Parameters
    ----------
    problem : DesignProblem
        With a `RunRegion` and the sensor noise.
    n_runs : int
        L.
    n_starts : int
        How often the search begins anew; the problem has many local maxima.
    n_candidates : int
        Random runs to begin with.
    confidence : float or None
        Share of the plants that the prior allows which must reach the ends of all runs. None asks it of the prior mean alone.
    seed : int
        The same seed gives the same design, for any number of threads, unless a time limit ends the search.
    threads : int, optional
        Default: every core.
    time_limit : float, optional
        Stop after about so many seconds.
    progress : bool or callable, optional
        True shows a bar, on the terminal and in notebooks; needs rich. A function is called with a `RunProgress` after each start.
    previous : Measurements, Experiments, Runs, a design, or a sequence of these, optional
        What is already measured, or planned: its information counts beside that of the runs.
    over : OverPrior, optional
        A criterion over the prior in the place of log det F at its mean; the time is that of one scenario times their number. Runs
        must reach their ends in every scenario.

    Returns
    -------
    RunDesign
        On Ctrl-C the best runs so far, once a first start has been followed.

    Raises
    ------
    TypeError, ValueError
        For misuse, and where hardly any run of the region reaches its end; the reasons are listed.
    """
    check_type(problem, DesignProblem, "problem")
    if not isinstance(problem.region, RunRegion):
        given = "None" if problem.region is None else type(problem.region).__name__
        raise ValueError(f"region: expected a RunRegion for runs, given {given}")
    checked_problem(problem)
    settings = RunSettings(
        n_runs=n_runs,
        n_starts=n_starts,
        n_candidates=n_candidates,
        seed=seed,
        confidence=confidence,
        time_limit=time_limit,
        over=over,
    )
    check_progress(progress)
    threads = resolve_threads(threads)
    problems, average = ((problem,), Average.of_all(1)) if settings.over is None else moved_problems(problem, settings.over)
    theta = np.array([moved.theta for moved in problems])
    known, left_out = previous_information(problem, previous, threads)
    if left_out:
        reasons = ", ".join(f"{reason} {count}" for reason, count in left_out.items())
        warnings.warn(f"previous: expected what is valid at the prior mean, left out {reasons}", stacklevel=2)
    there = np.array([_known_there(moved, problem, known, previous, threads) for moved in problems])
    with following(progress, "start", runs_step, "drawing the first runs") as told:
        search = RunSearch(
            problem,
            problem.region,
            settings.n_runs,
            theta,
            average,
            there,
            confidence=settings.confidence,
            n_starts=settings.n_starts,
            n_candidates=settings.n_candidates,
            seed=settings.seed,
            threads=threads,
            time_limit=settings.time_limit,
        )
        stop_reason = search.run(told)
        runs, seconds = search.runs(), search.seconds
        classical: dict[str, ClassicalRuns] = {}
        if stop_reason != "interrupted" and not search.pool.singular and problem.model.kernels is kernels:
            try:
                samples = problem.region.samples
                classical = classical_runs(search.objective, search.guard, settings.n_runs, samples, settings.seed)
            except KeyboardInterrupt:
                stop_reason = "interrupted"
    scenarios = None
    if settings.over is not None:
        of_each = [evaluate_design(moved, runs, threads=threads, previous=previous) for moved in problems]
        scenarios = scenario_values(problems, average, of_each)
    return RunDesign(
        problem=problem,
        settings=settings,
        runs=runs,
        evaluation=evaluate_design(problem, runs, threads=threads, previous=previous),
        log_det=-np.inf if search.pool.singular else search.best.value,
        scenarios=scenarios,
        ends=tuple(-np.inf if search.pool.singular else end.value for end in search.ends),
        again=search.again,
        feasibility=feasibility(problem, runs, draws=DRAWS, seed=settings.seed + UNSEEN, threads=threads),
        stop_reason=stop_reason,
        drawn=search.pool.drawn,
        rejected=FrozenMapping(dict(search.pool.rejected)),
        seconds=seconds,
        classical=FrozenMapping({name: one.log_det for name, one in classical.items()}),
        classical_shares=FrozenMapping({name: one.share for name, one in classical.items()}),
    )


def _known_there(
    moved: DesignProblem, problem: DesignProblem, known: PointInformation | None, previous: Previous | None, threads: int
) -> Array:
    """F (p, p) of what is already measured, or planned, in a scenario."""
    if known is not None and moved is not problem:
        known, _ = previous_information(moved, previous, threads)
    if known is None:
        return np.zeros((len(problem.estimated), len(problem.estimated)))
    measured = known.sensitivity if known.measured is None else np.where(known.measured[:, :, None], known.sensitivity, 0.0)
    return np.asarray(information_matrices(moved, measured[None])[0])
