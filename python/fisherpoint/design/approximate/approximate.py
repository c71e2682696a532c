"""The best weights of experiment points, among candidates or in a region, with the equivalence theorem's certificate."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from ...basics.checks import as_positive, check_positive_int, check_type
from ...basics.messages import with_counts
from ...basics.options import with_options
from ...basics.stop_reason import StopReason
from ...basics.values import FrozenMapping
from ...engine.workers import Distributor, Workers, distributed_over
from ...information.combinations import combinations
from ...information.problem import DesignProblem
from ...points.experiments import Experiments
from ...points.settings import check_threads
from ...show.progress import Progress, check_progress, following
from ..candidates.candidate_rows import CandidateRows
from ..candidates.point_rows import PointRows, check_additive
from ..goal.averaged_criterion import MOST_OF_ALL, Averaged, EstimableOver, parted
from ..goal.estimability import NOT_ESTIMABLE, determined, not_estimable
from ..goal.estimable_space import estimable
from ..goal.goal import Goal, goal_of
from ..goal.goal_criterion import criterion_of, known_beforehand
from ..goal.over_prior import OverPrior, Scenarios, moved_problems
from ..points.auto_search import AutoSearch
from ..points.random_climbs import Climbs
from ..results.settings import MOST, ExchangeSettings
from ..weights.weights import optimal_weights
from .approximate_design import ApproximateDesign
from .blocks import Blocks, drawn
from .continuous import Refinement, refined
from .tuning import BlockTuning, RegionTuning

MOST_CANDIDATES = 10**9

SAMPLE = 2000
"""Candidates that a design keeps for its pictures."""


@with_options
def approximate_design(
    problem: DesignProblem,
    candidates: Experiments | None = None,
    *,
    goal: str | Goal = "D",
    n_experiments: int | None = None,
    n_candidates: int = 5000,
    starts: int = 1000,
    tolerance: float = 1e-6,
    seed: int = 0,
    threads: int | None = None,
    workers: Workers | None = None,
    progress: bool | Callable[[Progress], None] | None = None,
) -> ApproximateDesign:
    """Find weights of points, and prove how near to the best weights they are.

    Maximised is the criterion of M = sum_i w_i F_i over weights that sum to 1, which is a concave problem (Kiefer and Wolfowitz
    1960; Pukelsheim 1993). Among given candidates its solution is the best that there is, to the tolerance. Without candidates,
    points are also moved in the region, until neither random climbs nor ascents of the sensitivity function from many starts
    exceed its level by more than a thousandth. That is a search: it proves nothing about places to which neither came.

    Parameters
    ----------
    problem : DesignProblem
        With output covariance "noise", whose information adds up over points.
    candidates : Experiments, optional
        What may get a weight. Default: the region.
    goal : str or Goal
        The name of a criterion, or all that the weights are to be good for. "ME" has no bound of this kind, nor has "E" `over` the
        prior; over it, log det F is averaged, or log phi of "Ds", "A", "c" and "I".
    n_experiments : int, optional
        For `prior_information`, and where constants are uncertain: what is known beforehand counts once beside so many.
    n_candidates : int
        Candidates that are drawn in the region first; those that are no points are left out. More than 65 536 are drawn, evaluated
        and thinned in blocks, again until none of them would have a weight: memory does not bound their number.
    starts : int
        Places from which local ascents must find nothing.
    tolerance : float
        By which share the sensitivity function may exceed its level over the candidates; at least 1e-9.
    seed : int
    threads : int, optional
        Default: every core.
    workers : int, Executor or Dask client, optional
        Who searches for candidates, and looks at blocks of them (docs/how_to/workers.md). The weights are the same. Default: this
        process.
    progress : bool or callable, optional
        True shows a bar, on the terminal and in notebooks; needs rich. A function is called with a `Progress` each time that
        something is done, with how many candidates are tried or weighed.

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
    goal = goal_of(goal, "approximate_design")
    criterion = criterion_of(problem, goal, threads)
    starts = check_positive_int(starts, "starts", 1, MOST["starts"])
    n_candidates = check_positive_int(n_candidates, "n_candidates", 1, MOST_CANDIDATES)
    seed, threads = check_positive_int(seed, "seed", 0), check_threads(threads)
    tolerance = as_positive(tolerance, "tolerance")
    if not 1e-9 <= tolerance <= 0.1:
        raise ValueError(f"tolerance: expected a share between 1e-9 and 0.1, given {tolerance:g}")
    known = known_beforehand(problem, goal)
    n_experiments = _experiments(bool(known.any()), n_experiments)
    if candidates is not None:
        check_type(candidates, Experiments, "candidates")
    scenarios = None if goal.over is None else _scenarios(problem, goal.over)
    constant = None if n_experiments is None else known / n_experiments
    check_progress(progress)

    if scenarios is not None:
        there = [criterion_of(one, goal, threads) for one in scenarios.problems]
        criterion = Averaged(there, scenarios.average, [problem.n_unknowns] * len(there))
    with following(progress, "approximate", counted=False) as callback, distributed_over(workers, threads) as distributor:

        def report(doing: str, candidates: int) -> None:
            if callback is not None:
                message = f"{doing}, {candidates} candidates"
                callback(Progress(candidates, None, None, message, time.perf_counter() - started))

        elsewhere = () if scenarios is None else scenarios.problems
        source = PointRows(problem, threads, elsewhere)
        rng = np.random.default_rng(seed)
        given, fast = candidates, problem.model.in_core  # of slow models few points are tried
        if given is None:
            given = drawn(problem, min(n_candidates, BlockTuning().candidates), rng)
            if fast and goal.criterion != "c":
                given = Experiments.join([given, *_searched(problem, seed, distributor, scenarios, report)])
        rows, places = source.valid(given)
        if not len(rows):
            refused_text = with_counts(source.rejected)
            raise ValueError(f"candidates: expected valid points, given none: {refused_text or 'no points at all'}")
        points, pool = given[places], CandidateRows(rows, constant)
        spaces = [estimable(part.triangle()) for part in pool.parts]
        space, least = spaces[0] if scenarios is None else EstimableOver.of(spaces), min(spaces, key=lambda one: one.rank)
        null = not_estimable(problem, least)
        refused = goal.requires_all and null
        if not refused and len({one.rank for one in spaces}) > 1:
            open_text = combinations(null)
            raise ValueError(
                f"over: expected scenarios with information on the same, given some without information on {open_text}"
            )
        if refused or not determined(problem, least) or criterion.outside(space) > NOT_ESTIMABLE:
            open_text = combinations(null)
            what = "all parameters, as singular = 'error' requires" if refused else f"criterion {goal.criterion!r}"
            raise ValueError(
                f"candidates: expected some that determine {what}, given none with information on {open_text}, in prior std"
            )
        left_out = +source.rejected
        report("weighing", len(pool))
        weights = optimal_weights(pool, criterion, tolerance=tolerance, seed=seed, space=space)
        found, tried = Refinement(points[weights.chosen], rows[weights.chosen], weights, len(rows), 0), 0
        if candidates is None:
            climb = Climbs(problem, rng, threads, elsewhere).run if fast else None
            blocks = Blocks(source, elsewhere, seed, n_candidates, constant, distributor, report)
            for _ in range(blocks.tuning.most_looks):
                points, pool, weights = blocks.solved(points, pool, weights, criterion, space, tolerance)
                found = refined(source, points, pool, criterion, weights, starts, tolerance, rng, climb, report)
                above = max(tolerance, found.weights.largest - 1.0)  # other points leave room for other candidates
                more, larger = blocks.joined(points, pool, found.weights, above) if blocks else (points, pool)
                if larger is pool:
                    break
                points, pool = more, larger
                weights = optimal_weights(pool, criterion, tolerance=tolerance, seed=seed, space=space)
            left_out, tried = left_out + blocks.rejected, blocks.tried
    weights = found.weights
    tolerance, early = (
        (max(tolerance, RegionTuning().above), StopReason.max_iterations) if found.starts else (tolerance, StopReason.rounding)
    )
    information = CandidateRows(found.rows, constant).information(np.arange(len(found.rows)), weights.weights)
    inside = space.span.T @ information @ space.span if len(space.null) else information
    inner = criterion if not len(space.null) else criterion.within(space.orthonormal)
    return ApproximateDesign(
        problem=problem,
        goal=goal,
        n_experiments=n_experiments,
        points=found.points,
        weights=weights.weights,
        information=information if scenarios is None else parted(information, len(spaces)),
        value=inner.value(inside),
        efficiency=weights.efficiency,
        largest=weights.largest,
        level=criterion.within(space).level,
        half=weights.half,
        estimable=space,
        null_directions=null,
        n_candidates=found.n_candidates + tried,
        starts=found.starts,
        sample=points[np.linspace(0, len(points) - 1, min(SAMPLE, len(points))).astype(int)],
        left_out=FrozenMapping(dict(left_out)),
        deleted=weights.deleted,
        stop_reason=StopReason.converged if weights.largest <= 1 + tolerance else early,
        seconds=time.perf_counter() - started,
    )


def _scenarios(problem: DesignProblem, over: OverPrior) -> Scenarios:
    """The problem at each of the scenarios; too many are an error."""
    problems, average = moved_problems(problem, over)
    size, most = len(problems) * problem.n_unknowns, MOST_OF_ALL // problem.n_unknowns
    if size > MOST_OF_ALL:
        raise ValueError(f"over: expected at most {most} scenarios of {problem.n_unknowns} parameters, given {len(problems)}")
    return Scenarios(problems, average, (None,) * len(problems))


def _experiments(added: bool, n_experiments: int | None) -> int | None:
    if not added:
        if n_experiments is not None:
            raise ValueError(
                "n_experiments: expected none without prior_information or uncertain constants, on which weights do not depend; "
                "given one"
            )
        return None
    if n_experiments is None:
        raise ValueError(
            "n_experiments: expected how many experiments there will be, as what is known beforehand counts once beside them all, "
            "given none"
        )
    return check_positive_int(n_experiments, "n_experiments")


class _Searched(NamedTuple):
    """Candidates that a search has found, and log det F of its design."""

    candidates: list[Experiments]
    log_det: float


@dataclass(frozen=True, eq=False)
class _Search:
    """A search for an exact design, which begins from a seed; `report` is called with how many candidates it has drawn."""

    problem: DesignProblem
    settings: ExchangeSettings
    scenarios: Scenarios | None
    threads: int
    report: Callable[[int], None] | None

    def __call__(self, seed: int) -> _Searched:
        search, report = (
            AutoSearch(self.problem, replace(self.settings, seed=seed), self.threads, scenarios=self.scenarios),
            self.report,
        )
        if search.run(None if report is None else lambda _: report(search.source.drawn)) == StopReason.interrupted:
            raise KeyboardInterrupt
        found = []
        seen = search.seen.best(search.best.information, None, RegionTuning().search_candidates)
        if seen is not None:
            found.append(seen.experiments)
        if seen is None or self.scenarios is not None:  # the candidates are those of the mean, the design is for all scenarios
            found.append(search.best.information.experiments)
        return _Searched(found, search.best.log_det)


def _searched(
    problem: DesignProblem, seed: int, distributor: Distributor, scenarios: Scenarios | None, report: Callable[[str, int], None]
) -> list[Experiments]:
    """The best candidates of searches for exact designs: they look on every scale near good points, where peaks may be narrow.

    For "c", whose optima are often singular, they say little; many close ones only hold up its weights.
    """
    p, found, best, tuning = len(problem.estimated), list[Experiments](), -np.inf, RegionTuning()
    settings = ExchangeSettings(n_experiments=p + tuning.points_beyond_parameters, max_iterations=tuning.search_iterations)
    work = _Search(problem, settings, scenarios, distributor.threads, partial(report, "searching") if distributor.here else None)
    seeds = range(seed, seed + tuning.searches)
    for searched in distributor.map(work, seeds, "search {}".format, ahead=1):
        found += searched.candidates
        before, best = best, max(best, searched.log_det)
        if abs(searched.log_det - before) < tuning.agreement_per_parameter * p:
            break
        report("searching", sum(map(len, found)))
    return found
