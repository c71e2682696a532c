"""Upper bound of the designs of some candidates, for a criterion over the prior.

Over scenarios a criterion is one of a block-diagonal matrix (averaged_criterion.py), so that its best weights, and what bounds
those of any design, are found as at the prior mean. Where that matrix would be too large, or a criterion has kinks of its own,
scenarios are taken in groups. With any q_c of average.py within group c, of weight w_c, the q = w_c q_c are some of all
scenarios: so the average over all is at most the weighted mean of those in the groups, each of which its own best weights
bound.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ..candidates.candidate_rows import CandidateRows
from ..goal.averaged_criterion import MOST_OF_ALL, Averaged, EstimableOver
from ..goal.criteria import Criterion
from ..goal.estimable_space import Estimable, estimable
from ..goal.scenario_average import Average
from ..weights.weights import optimal_weights
from .tuning import ArchiveTuning

Places = NDArray[np.intp]


def over_bound(
    rows: Array,
    known: Array,
    average: Average,
    first: int,
    allowed: Callable[[Places], NDArray[np.bool_]],
    criteria: Sequence[Criterion],
    between_steps: Callable[[], None] = lambda: None,
    tuning: ArchiveTuning = ArchiveTuning(),
) -> float | None:
    """The bound of the objective at M_s + `known`; None where the candidates do not determine the criterion.

    Parameters
    ----------
    rows : ndarray, (S, K, n, p)
        Whitened rows of all candidates in each scenario.
    known : ndarray, (S, p, p)
        Information that is there whatever the weights are.
    average : Average
    first : int
        Candidates to begin with: the first so many, which may have weights.
    allowed : callable
        Takes candidates that would have a weight and returns which of them may; the others do not count.
    criteria : sequence of Criterion
        In each scenario.
    between_steps : callable, optional
        Called between steps; what it raises ends the search for the bound.
    tuning : ArchiveTuning
    """
    level, scenarios = criteria[0].level, len(rows)
    spaces = [estimable(CandidateRows(*one).triangle()) for one in zip(rows, known, strict=True)]
    if any(_lost(one, space, level) for one, space in zip(criteria, spaces, strict=True)):
        return None
    most = 1 if criteria[0].kinked else max(1, MOST_OF_ALL // rows.shape[3])
    groups = np.array_split(np.arange(scenarios), -(-scenarios // most))
    bounds, weights = [], np.array([average.weights[group].sum() for group in groups])
    for group in groups:
        criterion, candidates, space = _of_group(group, rows, known, average, criteria, spaces)
        begin = np.arange(first)
        found = optimal_weights(
            candidates,
            criterion,
            tolerance=tuning.tolerance_over_prior,
            space=space,
            first=begin,
            allowed=allowed,
            between_steps=between_steps,
        )
        value = criterion.objective(candidates.information(found.chosen, found.weights))
        if not np.isfinite(value) or not found.efficiency > 0:
            return None
        bounds.append(value - level * np.log(found.efficiency))
    share = average.share if len(groups) == scenarios else 1.0
    return float(Average(weights * len(weights) / weights.sum(), share).value(np.array(bounds)))


def _lost(criterion: Criterion, space: Estimable, level: int) -> bool:
    """Whether candidates do not determine a criterion, or more than it was restricted to."""
    return criterion.level != level or criterion.outside(space) > 1e-6 or criterion.within(space).level != level


def _of_group(
    group: Places,
    rows: Array,
    known: Array,
    average: Average,
    criteria: Sequence[Criterion],
    spaces: Sequence[Estimable],
) -> tuple[Criterion, CandidateRows, Estimable]:
    """The criterion over some of the scenarios, the candidates, and what these determine there."""
    if len(group) == 1:
        (s,) = group
        return criteria[s], CandidateRows(rows[s], known[s]), spaces[s]
    own = average.weights[group]
    of_group = Average(own * len(own) / own.sum(), average.share)
    criterion = Averaged([criteria[s] for s in group], of_group, [rows.shape[3]] * len(group))
    return criterion, CandidateRows(np.moveaxis(rows[group], 0, 1), known[group]), EstimableOver.of([spaces[s] for s in group])
