"""`fp.design_runs`: which runs to make."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from ...basics.checks import as_floats, check_type
from ...basics.values import Array, FrozenMapping
from ...engine.levels import kernels
from ...information.evaluation import evaluate_design
from ...information.feasibility import feasibility
from ...information.previous import Previous, previous_information
from ...information.problem import DesignProblem
from ...information.run_information import checked_problem, information_matrices
from ...points.run_region import RunRegion
from ...points.settings import resolve_threads
from ..found import DRAWS, UNSEEN
from ..settings import RunSettings
from .run_design import RunDesign
from .run_references import classical_log_dets
from .run_search import RunProgress, RunSearch


def design_runs(
    problem: DesignProblem,
    n_runs: int = 1,
    *,
    n_starts: int = 8,
    n_candidates: int = 500,
    confidence: float | None = 0.99,
    plants: ArrayLike | None = None,
    seed: int = 0,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Callable[[RunProgress], None] | None = None,
    previous: Previous | None = None,
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
    plants : array_like, (R, p), optional
        Parameters of the model over which log det F is averaged, each a plant. Default: the prior mean alone.
    seed : int
        The same seed gives the same design, for any number of threads, unless a time limit ends the search.
    threads : int, optional
        Default: every core.
    time_limit : float, optional
        Stop after about so many seconds.
    progress : callable, optional
        Called with a `RunProgress` after each start.
    previous : Measurements, Experiments, Runs, a design, or a sequence of these, optional
        What is already measured, or planned: its information counts beside that of the runs.

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
    )
    if progress is not None and not callable(progress):
        raise TypeError(f"progress: expected a function, given {type(progress).__name__}")
    threads = resolve_threads(threads)
    theta = _plants(problem, plants)
    known, left_out = previous_information(problem, previous, threads)
    if left_out:
        reasons = ", ".join(f"{reason} {count}" for reason, count in left_out.items())
        warnings.warn(f"previous: expected what is valid at the prior mean, left out {reasons}", stacklevel=2)
    p = len(problem.estimated)
    there = np.zeros((p, p))
    if known is not None:
        measured = known.sensitivity if known.measured is None else np.where(known.measured[:, :, None], known.sensitivity, 0.0)
        there = information_matrices(problem, measured[None])[0]
    search = RunSearch(
        problem,
        problem.region,
        settings.n_runs,
        theta,
        np.tile(there, (len(theta), 1, 1)),
        confidence=settings.confidence,
        n_starts=settings.n_starts,
        n_candidates=settings.n_candidates,
        seed=settings.seed,
        threads=threads,
        time_limit=settings.time_limit,
    )
    stop_reason = search.run(progress)
    runs, seconds = search.runs(), search.seconds
    classical: dict[str, float] = {}
    if stop_reason != "interrupted" and not search.pool.singular and problem.model.kernels is kernels:
        try:
            classical = classical_log_dets(search.objective, settings.n_runs, problem.region.samples, settings.seed)
        except KeyboardInterrupt:
            stop_reason = "interrupted"
    return RunDesign(
        problem=problem,
        settings=settings,
        runs=runs,
        evaluation=evaluate_design(problem, runs, threads=threads, previous=previous),
        log_det=-np.inf if search.pool.singular else search.best.value,
        plants=theta,
        ends=tuple(-np.inf if search.pool.singular else end.value for end in search.ends),
        again=search.again,
        feasibility=feasibility(problem, runs, draws=DRAWS, seed=settings.seed + UNSEEN, threads=threads),
        stop_reason=stop_reason,
        drawn=search.pool.drawn,
        rejected=FrozenMapping(dict(search.pool.rejected)),
        seconds=seconds,
        classical=FrozenMapping(classical),
    )


def _plants(problem: DesignProblem, given: ArrayLike | None) -> Array:
    if given is None:
        return problem.theta[None]
    theta = as_floats(given, "plants")
    if theta.ndim != 2 or not len(theta) or theta.shape[1] != len(problem.theta):
        raise ValueError(f"plants: expected shape (R, {len(problem.theta)}), given {theta.shape}")
    return problem.model.theta(theta)
