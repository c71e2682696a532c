"""Designs the experiments of several plants together, plant after plant."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Any

import numpy as np

from ...basics.checks import check_type
from ...basics.options import with_options
from ...basics.stop_reason import StopReason
from ...basics.values import FrozenMapping
from ...data.measurements import Measurements
from ...information.candidates import CandidateSource
from ...information.evaluation import Evaluation
from ...information.problem import DesignProblem
from ...points.points_or_runs import Points
from ...show.progress import Progress, check_progress, following
from ..goal.criteria import Criterion
from ..goal.goal import Goal, goal_of
from ..goal.goal_criterion import criterion
from ..points.exchange import exchange
from ..results.found_design import FoundDesign
from ..results.found_runs import FoundRuns
from ..results.settings import ExchangeMethod
from ..runs.design_runs import design_runs
from .fleet_design import FleetDesign, evaluated, label_of, labelled
from .fleet_settings import FleetSettings, plant_names


@with_options
def design_fleet(
    problem: DesignProblem,
    plants: int | Sequence[str],
    size: int,
    *,
    alike: bool = False,
    goal: str | Goal = "D",
    starts: int = 2,
    rounds: int = 3,
    max_iterations: int = 5,
    n_candidates: int | None = None,
    seed: int = 0,
    threads: int | None = None,
    progress: bool | Callable[[Progress], None] | None = None,
) -> FleetDesign:
    """Design points, or runs, for each plant of a fleet: the best for the parameters that all of them share.

    Each plant has values of its own of what is local to it, ``local={"k_valve": "plant"}``; they are estimated too. The information
    of the plants about what they share adds up once these are eliminated, so that a plant need not determine all by itself. The
    plants are designed one after the other beside what the others will say, in several rounds.

    Parameters
    ----------
    problem : DesignProblem
        With a region, the sensor noise, and a parameter that is local to a plant, or to something else with labels.
    plants : int or sequence of str
        Their number, or their labels.
    size : int
        Number of points, or runs, of each plant.
    alike : bool
        One design for all of them instead of one for each: the best of a single plant, which must determine all parameters.
    goal : str or Goal
        As in `exchange`.
    starts : int
        From how many random points of the other plants it begins; the best design counts.
    rounds : int
        How often each plant is designed.
    max_iterations : int
        Of each search of a plant's points, as in `exchange`.
    n_candidates : int, optional
        As in `exchange`, or `design_runs`. Default: that of these.
    seed : int
    threads : int, optional
    progress : bool or callable, optional
        True shows a bar, on the terminal and in notebooks; needs rich. A function is called with a `Progress` after each plant.

    Returns
    -------
    FleetDesign
        Ctrl-C returns the best designs so far; plants that had none have random points.

    Raises
    ------
    TypeError, ValueError
        For misuse, and a problem without a parameter that is local to plants.
    """
    check_type(problem, DesignProblem, "problem")
    check_progress(progress)
    label, names = label_of(problem), plant_names(plants)
    settings = FleetSettings(
        size=size,
        goal=goal_of(goal),
        alike=alike,
        starts=starts,
        rounds=rounds,
        max_iterations=max_iterations,
        n_candidates=n_candidates,
        seed=seed,
    )
    alike, seed = settings.alike, settings.seed
    objective, started, stop_reason = criterion(problem, settings.goal), perf_counter(), StopReason.completed
    best: tuple[float, dict[str, Points]] | None = None
    steps = [(start, name) for start in range(settings.starts) for name in (names[:1] if alike else names * settings.rounds)]
    points, value = dict[str, Points](), -np.inf
    with following(progress, "designing plants") as report:
        for step, (start, name) in enumerate(steps):
            first = step == 0 or steps[step - 1][0] != start
            if first:
                points, value = _drawn(problem, names, settings.size, seed + step, threads), -np.inf
            others = {} if alike else {other: one for other, one in points.items() if other != name}
            previous = labelled(others, label, len(problem.model.outputs)) if others else None
            found = _designed(problem, settings, previous, seed + step, threads)
            trial = dict.fromkeys(names, found.points) if alike else {**points, name: found.points}
            after = _value(objective, evaluated(problem, label, trial, threads))
            if first or after > value:
                points, value = trial, after
            if best is None or value > best[0]:
                best = value, points
            if report is not None:
                shown = best[0] if np.isfinite(best[0]) else None
                report(Progress(step + 1, len(steps), shown, f"{label} {name}", perf_counter() - started))
            if found.stop_reason == StopReason.interrupted:
                stop_reason = StopReason.interrupted
                break
    points = points if best is None else best[1]
    evaluation = evaluated(problem, label, points, threads)
    return FleetDesign(problem, label, FrozenMapping(points), evaluation, settings, stop_reason)


def _drawn(problem: DesignProblem, names: Sequence[str], size: int, seed: int, threads: int | None) -> dict[str, Points]:
    """Random points of each plant, or runs, beside which the first one is designed."""
    if problem.region is not None and problem.region.kind == "run":
        one = design_runs(problem, size, n_starts=1, n_candidates=size, seed=seed, threads=threads).points
        return dict.fromkeys(names, one)
    source = CandidateSource(problem, np.random.default_rng(seed), threads)
    return {name: source.draw_confirmed(size).points for name in names}


def _designed(
    problem: DesignProblem, settings: FleetSettings, previous: Measurements | None, seed: int, threads: int | None
) -> FoundDesign | FoundRuns:
    given: dict[str, Any] = {"goal": settings.goal, "previous": previous, "seed": seed, "threads": threads}
    if settings.n_candidates is not None:
        given["n_candidates"] = settings.n_candidates
    if problem.region is not None and problem.region.kind == "run":
        return design_runs(problem, settings.size, n_starts=1, **given)
    most = None if settings.alike else settings.max_iterations
    return exchange(problem, settings.size, method=ExchangeMethod(references=False), max_iterations=most, **given)


def _value(objective: Criterion, evaluation: Evaluation) -> float:
    return objective.objective(evaluation.information) if evaluation.covariance is not None else -np.inf
