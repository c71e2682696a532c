"""The best exact design among candidates: whole numbers of measurements, with a proof that there are no better ones."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from ...basics.checks import as_positive, check_positive_int, check_type
from ...basics.messages import with_counts
from ...basics.options import with_options
from ...basics.values import FrozenMapping
from ...information.combinations import combinations
from ...information.problem import DesignProblem
from ...points.experiments import Experiments
from ...points.settings import resolve_threads
from ...show.progress import Progress, check_progress, following
from ..candidates.candidate_rows import CandidateRows
from ..candidates.point_rows import PointRows, check_additive
from ..goal.estimability import NOT_ESTIMABLE, determined, not_estimable
from ..goal.estimable_space import estimable
from ..goal.goal import Goal, goal_of
from ..goal.goal_criterion import criterion_of, known_beforehand
from ..weights.weights import optimal_weights
from .exact_design import ExactDesign
from .exact_search import ExactSearch, Limits
from .tuning import ExactTuning

MOST_EXPERIMENTS, MOST_NODES = 10_000, 10**9


@with_options
def exact_design(
    problem: DesignProblem,
    candidates: Experiments,
    n_experiments: int,
    *,
    goal: str | Goal = "D",
    gap: float = 1e-6,
    max_nodes: int = 100_000,
    time_limit: float | None = None,
    seed: int = 0,
    threads: int | None = None,
    progress: bool | Callable[[Progress], None] | None = None,
) -> ExactDesign:
    """Find how often each of given candidates is to be measured, and prove how near to the best design that is.

    Maximised is the criterion of sum_i n_i F_i over whole numbers n_i >= 0 that sum to `n_experiments`. The search begins with
    rounded weights and exchanges of points; then branch and bound excludes all other designs, where that takes no more than the
    limits allow.

    Parameters
    ----------
    problem : DesignProblem
        With output covariance "noise", whose information adds up over points.
    candidates : Experiments
        What may be measured, each any number of times.
    n_experiments : int
        Measurements, 10,000 at most.
    goal : str or Goal
        The name of a criterion, or all that the design is to be good for at the prior mean. "ME" has no bound of this kind.
    gap : float
        The share of measurements that an unknown better design may save: the search ends where the efficiency is proven to be
        at least 1 - gap; at least 1e-9.
    max_nodes : int
        Boxes of counts that are looked at.
    time_limit : float, optional
        Stop after so many seconds.
    seed : int
        Of the designs from which exchanges begin.
    threads : int, optional
        Default: every core.
    progress : bool or callable, optional
        True shows a bar, on the terminal and in notebooks; needs rich. A function is called with a `Progress` after the exchanges,
        and once in 50 nodes of branch and bound; its value is the proven efficiency.

    Returns
    -------
    ExactDesign
        Ctrl-C during the search returns the best design so far with what is proven of it, and stop_reason "interrupted".

    Raises
    ------
    TypeError, ValueError
        For misuse, an output covariance that is not additive, what the candidates cannot determine, with the combinations of
        parameters that are left open, and too few measurements to determine the criterion.
    """
    started = time.perf_counter()
    check_type(problem, DesignProblem, "problem")
    check_additive(problem)
    check_type(candidates, Experiments, "candidates")
    n = check_positive_int(n_experiments, "n_experiments", 1, MOST_EXPERIMENTS)
    goal = goal_of(goal, "exact_design")
    criterion = criterion_of(problem, goal, threads)
    gap = as_positive(gap, "gap")
    if not 1e-9 <= gap <= 0.5:
        raise ValueError(f"gap: expected a share between 1e-9 and 0.5, given {gap:g}")
    max_nodes = check_positive_int(max_nodes, "max_nodes", 1, MOST_NODES)
    time_limit = None if time_limit is None else as_positive(time_limit, "time_limit")
    seed, threads = check_positive_int(seed, "seed", 0), resolve_threads(threads)
    check_progress(progress)
    known = known_beforehand(problem, goal)

    source = PointRows(problem, threads)
    rows, places = source.valid(candidates) if len(candidates) else (np.empty((0, 1, 1)), np.empty(0, dtype=np.intp))
    if not len(rows):
        refused_text = with_counts(source.rejected)
        raise ValueError(f"candidates: expected valid points, given none: {refused_text or 'no points at all'}")
    pool = CandidateRows(rows, known / n if known.any() else None)
    space = estimable(pool.triangle())
    null = not_estimable(problem, space)
    refused = goal.requires_all and null
    if refused or not determined(problem, space) or criterion.outside(space) > NOT_ESTIMABLE:
        what = "all parameters, as singular = 'error' requires" if refused else f"criterion {goal.criterion!r}"
        raise ValueError(
            f"candidates: expected some that determine {what}, given none with information on {combinations(null)}, in prior std"
        )
    tuning = ExactTuning()
    weights = optimal_weights(pool, criterion, tolerance=tuning.weights_tolerance, seed=seed, space=space)
    limits = Limits(-float(np.log1p(-gap)), max_nodes, time_limit, started)
    search = ExactSearch(pool, criterion.within(space), weights, n, limits, np.random.default_rng(seed), tuning)
    with following(progress, "nodes", "exchanging points") as report:
        found = search.run(report)
    if not found.efficiency > 0:
        raise ValueError(
            f"n_experiments: expected enough to determine criterion {goal.criterion!r}, given {n}: the candidates determine "
            f"{determined(problem, space)} combinations of parameters, and no design of so many measurements was found that "
            "determines it"
        )
    chosen = np.flatnonzero(found.counts)
    counts = found.counts[chosen]
    information = pool.information(chosen, counts.astype(float))
    inside = space.span.T @ information @ space.span if len(null) else information
    inner = criterion.within(space.orthonormal) if len(null) else criterion
    return ExactDesign(
        problem=problem,
        goal=goal,
        points=candidates[places[np.repeat(chosen, counts)]],
        chosen=places[chosen],
        counts=counts,
        information=information,
        value=inner.value(inside),
        efficiency=found.efficiency,
        of_weights=float(np.exp(min(search.value - weights.log_bound - np.log(n), 0.0))),
        gap=gap,
        stop_reason=found.stop_reason,
        nodes=found.nodes,
        n_candidates=len(rows),
        n_left=found.left,
        null_directions=null,
        left_out=FrozenMapping(dict(+source.rejected)),
        seconds=time.perf_counter() - started,
    )
