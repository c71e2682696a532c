"""The best weights of experiment points, among candidates or in a region, with the equivalence theorem's certificate."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..basics.checks import as_positive, check_choice, check_flag, check_positive_int, check_type
from ..basics.quantity import names_of
from ..basics.values import FrozenMapping
from ..engine.levels import kernels
from ..information.combinations import combination
from ..information.evaluation import null_direction
from ..information.problem import DesignProblem
from ..points.experiments import Experiments
from ..points.region import ExperimentRegion
from ..points.settings import resolve_threads
from ..show.progress import Step, check_progress, following
from .optimality.approximate_design import ApproximateDesign
from .optimality.approximate_design import prior_information as information_of_prior
from .optimality.asked import CRITERIA
from .optimality.asked import criterion as criterion_of
from .optimality.candidate_rows import CandidateRows
from .optimality.continuous import Refinement, refined
from .optimality.estimable import estimable
from .optimality.point_rows import PointRows, check_additive
from .optimality.weights import optimal_weights
from .points.auto_search import AutoSearch
from .settings import ExchangeSettings

MOST_CANDIDATES = 10**6

MORE_POINTS, SEARCH, SEARCHED = 3, 600, 2000
"""Points beyond the parameters of a design that is searched for first, its iterations, and how many of its candidates are taken."""

SAMPLE = 2000
"""Candidates that a design keeps for its pictures."""


class ApproximateProgress(NamedTuple):
    """What `approximate` is doing: "searching" for candidates, or "weighing" them; how many it has tried or weighs, and seconds."""

    doing: str
    candidates: int
    seconds: float


def approximate(
    problem: DesignProblem,
    candidates: Experiments | None = None,
    *,
    criterion: str = "D",
    of: str | Sequence[str] | None = None,
    conditions: Experiments | None = None,
    scale: Mapping[str, float] | None = None,
    prior_information: bool = False,
    n_experiments: int | None = None,
    n_candidates: int = 5000,
    starts: int = 1000,
    tolerance: float = 1e-6,
    seed: int = 0,
    threads: int | None = None,
    progress: bool | Callable[[ApproximateProgress], None] | None = None,
) -> ApproximateDesign:
    """Find weights of points, and prove how near to the best weights they are.

    Maximised is the criterion of M = sum_i w_i F_i over weights that sum to 1, which is a concave problem (Kiefer and Wolfowitz
    1960; Pukelsheim 1993). Among given candidates its solution is the best that there is, to the tolerance. Without candidates,
    points are also moved in the region, until no ascent of the sensitivity function from many starts exceeds its level by more
    than a thousandth. That is a search: it proves nothing about places that no ascent came to.

    Parameters
    ----------
    problem : DesignProblem
        With output covariance "noise", whose information adds up over points.
    candidates : Experiments, optional
        What may get a weight. Default: the region.
    criterion : {"D", "A", "E", "c", "Ds", "I"}
        See :func:`fisherpoint.criterion`, which says what `of`, `conditions` and `scale` are. "ME" has no bound of this kind.
    of, conditions, scale
        What the criterion needs.
    prior_information : bool
        Whether the inverse of the prior's covariance is added to the information of `n_experiments` measurements.
    n_experiments : int, optional
        For `prior_information`, of which the share depends on how much is measured.
    n_candidates : int
        Candidates that are drawn in the region first; those that are no points are left out.
    starts : int
        Places from which local ascents must find nothing.
    tolerance : float
        By which share the sensitivity function may exceed its level over the candidates; at least 1e-9.
    seed : int
    threads : int, optional
        Default: every core.
    progress : bool or callable, optional
        True shows a bar, on the terminal and in notebooks; needs rich. A function is called with an `ApproximateProgress` each time
        that something is done.

    Returns
    -------
    ApproximateDesign

    Raises
    ------
    TypeError, ValueError
        For misuse, an output covariance that is not additive, and what the candidates cannot determine, with the combinations of
        parameters that are left open.
    """
    started = time.perf_counter()
    check_type(problem, DesignProblem, "problem")
    check_additive(problem)
    if check_choice(criterion, CRITERIA, "criterion") == "ME":
        raise ValueError("criterion: expected one with a concave form, given 'ME': no bound holds for the condition number")
    asked = criterion_of(problem, criterion, of=of, conditions=conditions, scale=scale, threads=threads)
    starts = check_positive_int(starts, "starts", 1, MOST_CANDIDATES)
    n_candidates = check_positive_int(n_candidates, "n_candidates", 1, MOST_CANDIDATES)
    seed, threads = check_positive_int(seed, "seed", 0), resolve_threads(threads)
    tolerance = as_positive(tolerance, "tolerance")
    if not 1e-9 <= tolerance <= 0.1:
        raise ValueError(f"tolerance: expected a share between 1e-9 and 0.1, given {tolerance:g}")
    n_experiments = _experiments(check_flag(prior_information, "prior_information"), n_experiments)
    if candidates is not None:
        check_type(candidates, Experiments, "candidates")
    constant = None if n_experiments is None else information_of_prior(problem) / n_experiments
    check_progress(progress)

    with following(progress, "approximate", _step, counted=False) as hears:

        def tell(doing: str, candidates: int) -> None:
            if hears is not None:
                hears(ApproximateProgress(doing, candidates, time.perf_counter() - started))

        source = PointRows(problem, threads)
        rng = np.random.default_rng(seed)
        given = candidates
        if given is None:
            _check_region(problem)
            searches = criterion != "c" and problem.model.kernels is kernels
            searched = _searched(problem, seed, threads, tell) if searches else None
            given = _drawn(problem, n_candidates, rng)
            given = given if searched is None else Experiments.join([given, searched])
        rows, places = source.valid(given)
        if not len(rows):
            told = ", ".join(f"{reason} {count}" for reason, count in source.rejected.items())
            raise ValueError(f"candidates: expected valid points, given none: {told or 'no points at all'}")
        points, pool = given[places], CandidateRows(rows, constant)
        space = estimable(pool.triangle())
        names = problem.estimated
        null = tuple(null_direction(v, space.length, names) for v in space.null)
        if not space.rank or asked.outside(space) > 1e-6:
            told = "; ".join(combination(one) for one in null)
            raise ValueError(f"candidates: expected some that determine what is asked, given none that tell about {told}")
        left_out = FrozenMapping(dict(+source.rejected))
        tell("weighing", len(pool))
        weights = optimal_weights(pool, asked, tolerance=tolerance, seed=seed, space=space)
        found = Refinement(points[weights.chosen], rows[weights.chosen], weights, len(rows), 0)
        if candidates is None:

            def others(k: int) -> Experiments | None:
                return _searched(problem, seed + 1 + k, threads, tell) if searches else None

            found = refined(source, points, pool, asked, weights, starts, tolerance, rng, others, tell)
    weights = found.weights
    information = CandidateRows(found.rows, constant).information(np.arange(len(found.rows)), weights.weights)
    inside = space.span.T @ information @ space.span if len(space.null) else information
    told_by = asked if not len(space.null) else asked.within(space.orthonormal)
    return ApproximateDesign(
        problem=problem,
        criterion_name=criterion,
        of=of if of is None or isinstance(of, str) else tuple(of),
        conditions=conditions,
        scale=None if scale is None else FrozenMapping(dict(scale)),
        n_experiments=n_experiments,
        points=found.points,
        weights=weights.weights,
        information=information,
        value=told_by.value(inside),
        efficiency=weights.efficiency,
        largest=weights.largest,
        level=asked.within(space).level,
        half=weights.half,
        estimable=space,
        null_directions=null,
        n_candidates=found.n_candidates,
        starts=found.starts,
        sample=points[np.linspace(0, len(points) - 1, min(SAMPLE, len(points))).astype(int)],
        left_out=left_out,
        deleted=weights.deleted,
        seconds=time.perf_counter() - started,
    )


def _experiments(added: bool, n_experiments: int | None) -> int | None:
    if not added:
        if n_experiments is not None:
            raise ValueError("n_experiments: expected none without prior_information, on which weights do not depend; given one")
        return None
    if n_experiments is None:
        raise ValueError("n_experiments: expected how many experiments the prior's information is added to, given none")
    return check_positive_int(n_experiments, "n_experiments")


def _check_region(problem: DesignProblem) -> None:
    region = problem.region
    if not isinstance(region, ExperimentRegion):
        given = "None" if region is None else "one of runs"
        raise ValueError(f"region: expected an ExperimentRegion where no candidates are given, given {given}")


def _step(now: ApproximateProgress) -> Step:
    return Step(state=f"{now.doing}, {now.candidates} candidates")


def _searched(problem: DesignProblem, seed: int, threads: int, tell: Callable[[str, int], None]) -> Experiments | None:
    """The best candidates of a search for an exact design: it looks on every scale near good points, where peaks may be narrow.

    For "c", whose optima are often singular, they say little; many close ones only hold up its weights.
    """
    settings = ExchangeSettings(
        n_experiments=len(problem.estimated) + MORE_POINTS,
        n_candidates=50,
        max_iterations=SEARCH,
        seed=seed,
        patience=None,
        time_limit=None,
        max_redraws=0,
        references=True,
    )
    search = AutoSearch(problem, settings, threads)
    if search.run(lambda now: tell("searching", now.drawn)) == "interrupted":
        raise KeyboardInterrupt
    found = search.seen.best(search.best.information, None, SEARCHED)
    return None if found is None else found.experiments


def _drawn(problem: DesignProblem, count: int, rng: np.random.Generator) -> Experiments:
    """Points of the region, of every second some coordinates on its bounds, where optima often lie."""
    region, model = problem.region, problem.model
    assert isinstance(region, ExperimentRegion)
    table = region.draw(model, count, seed=rng, decades=True).table[:, : len(model.axes)].copy()
    lower, upper = np.array([region.bounds[name] for name in names_of(model.axes)]).T
    on_bounds = rng.random(table.shape) < 0.5
    on_bounds[::2] = False
    table = np.where(on_bounds, np.where(rng.random(table.shape) < 0.5, lower, upper), table)
    return Experiments.of_table(model, table)
