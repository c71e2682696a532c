"""Archive of the candidates that a search has evaluated; it bounds all designs of these."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ...basics.work_clock import Clock
from ...information.output_covariance import needs_covariances, output_covariance
from ...information.point_information import PointInformation
from ...information.problem import DesignProblem
from ...information.validity import Validity
from ...points.experiments import Experiments
from ..candidates.candidate_rows import CandidateRows, Places
from ..goal.criteria import Criterion
from ..goal.eigenvalue_criteria import ConditionNumber
from ..goal.estimability import NOT_ESTIMABLE, determined
from ..goal.estimable_space import estimable
from ..goal.goal import Goal
from ..goal.goal_criterion import criterion_of
from ..goal.over_prior import Scenarios
from ..results.efficiency import Bound
from ..weights.weights import Weights, optimal_weights
from .bound_over_prior import over_bound
from .point_ascent import scenario_rows, whitened_rows
from .tuning import ArchiveTuning


class _JoinedParts:
    """The candidates of many parts as those of one, for access to a few; `join` would copy them all."""

    def __init__(self, parts: Sequence[PointInformation]) -> None:
        self._parts, self._ends = parts, np.cumsum([len(part) for part in parts])

    def __len__(self) -> int:
        return int(self._ends[-1])

    @cached_property
    def points(self) -> Experiments:
        """All of them: what is known of them is much more."""
        return Experiments.join([part.experiments for part in self._parts])

    def __getitem__(self, places: Places) -> PointInformation:
        of = np.searchsorted(self._ends, places, side="right")
        order = np.argsort(of, kind="stable")
        some = [
            self._parts[part][places[of == part] - self._ends[part] + len(self._parts[part])] for part in np.unique(of).tolist()
        ]
        return PointInformation.join(some or [self._parts[0][:0]])[np.argsort(order)]


class _Best(NamedTuple):
    everything: _JoinedParts
    candidates: CandidateRows
    found: Weights


class CandidateArchive:
    """Candidates that were valid at the prior mean; `criteria` are maximised in the scenarios, log det F where none are given.

    `of_prior` (p, p) is information that counts beside whatever design, as the previous points do, but is no measurement. `clock`
    and `expected` are as of `Validity`.
    """

    def __init__(
        self,
        problem: DesignProblem,
        threads: int,
        criteria: Sequence[Criterion] | None = None,
        of_prior: Array | float = 0.0,
        tuning: ArchiveTuning = ArchiveTuning(),
        clock: Clock | None = None,
        expected: int = 1,
    ) -> None:
        self.tuning, self._clock = tuning, Clock() if clock is None else clock
        self._problem, self._threads, self._of_prior = problem, threads, of_prior
        self.criteria = (criterion_of(problem, Goal()),) if criteria is None else tuple(criteria)
        self._seen: list[PointInformation] = []
        self._numbers = 0
        covariances = needs_covariances(str(problem.output_covariance))
        self.validity = Validity(problem, threads, covariances, clock, expected)

    def add(self, information: PointInformation) -> None:
        """Keep these, as long as there is room."""
        if len(information) and self._numbers < self.tuning.most_numbers:
            self._seen.append(_without_covariances(information))
            self._numbers += information.sensitivity.size * len(information.everywhere)

    def include(self, other: CandidateArchive) -> None:
        """Keep those of another search too."""
        self.validity.include(other.validity)
        for information in other._seen:
            self.add(information)

    def bound(self, design: PointInformation, previous: PointInformation | None) -> Bound | None:
        """The bound of designs of as many points, beside the previous ones; None where no candidates determine the criterion.

        The criterion of M = sum_i w_i F_i is maximised over weights that sum to 1, and every design of these candidates is a case
        of that; the equivalence theorem bounds the maximum (Kiefer and Wolfowitz 1960, Pukelsheim 1993). Candidates that plants
        of the prior cannot run are left out where they would have a weight. "ME" has no bound.
        """
        best = self._best_weights(design, previous)
        if best is None:
            return None
        everything, candidates, found = best
        value = self.criteria[0].objective(candidates.information(found.chosen, found.weights))
        if not np.isfinite(value) or not found.efficiency > 0:
            return None
        level, count = self.criteria[0].level, len(design)
        total = count + (0 if previous is None else len(previous))
        return Bound(float(value + level * np.log(2 * count / total) - level * np.log(found.efficiency)), len(everything) - count)

    def bound_over(self, design: PointInformation, previous: PointInformation | None, over: Scenarios) -> Bound | None:
        """The bound for a criterion over the prior, beside the previous points; None where none is known."""
        if isinstance(self.criteria[0], ConditionNumber):
            return None
        parts, count = [design, *self._seen], len(design)
        everything, noise = _JoinedParts(parts), output_covariance(self._problem, design, self._threads, "noise")
        rows = np.concatenate([scenario_rows(noise, part) for part in parts], axis=1)
        p, total = rows.shape[3], count + (0 if previous is None else len(previous))
        known = np.zeros((len(rows), p, p)) + self._of_prior / count
        for s, there in enumerate(over.previous):
            if there is not None:
                flat = whitened_rows(noise, there).reshape(-1, p)
                known[s] += flat.T @ flat / count

        value = over_bound(
            rows, known, over.average, count, self._runnable(everything, count), self.criteria, self._clock.check, self.tuning
        )
        level = self.criteria[0].level
        return None if value is None else Bound(float(value + level * np.log(2 * count / total)), len(everything) - count)

    def _runnable(self, everything: _JoinedParts, count: int) -> Callable[[Places], NDArray[np.bool_]]:
        """Which candidates the plants of the prior can run; the first, which are the design's points, were tried before."""
        valid = np.arange(len(everything)) < count

        def runs_everywhere(places: Places) -> NDArray[np.bool_]:
            unknown = places[~valid[places]]
            valid[unknown] = self.validity.of(everything.points[unknown])
            return valid[places]

        return runs_everywhere

    def best(self, design: PointInformation, previous: PointInformation | None, most: int) -> PointInformation | None:
        """Those with the largest sensitivity under the best weights; None where they do not determine all parameters.

        All are valid on the nodes of the rule; most of the largest are not, so that there may be fewer than `most`.
        """
        best = self._best_weights(design, previous)
        if best is None:
            return None
        order = np.argsort(-best.candidates.along(best.found.half), kind="stable")
        taken, have = [], 0
        for first in range(0, min(len(order), self.tuning.most_batches * most), most):
            some = order[first : first + most]
            taken.append(some[self.validity.of(best.everything.points[some])])
            have += len(taken[-1])
            if have >= most:
                break
        return best.everything[np.sort(np.concatenate(taken)[:most])]

    def _best_weights(self, design: PointInformation, previous: PointInformation | None) -> _Best | None:
        """The best weights of these candidates and the design's points, beside the previous ones."""
        parts = [design, *self._seen]
        everything, noise = _JoinedParts(parts), output_covariance(self._problem, design, self._threads, "noise")
        own = whitened_rows(noise, design)
        rows = np.empty((len(everything), *own.shape[1:]))  # filled part by part: they are most of the memory
        rows[: len(design)], first = own, len(design)
        for part in self._seen:
            rows[first : first + len(part)] = whitened_rows(noise, part)
            first += len(part)
        p, count, known = rows.shape[2], len(design), None
        if previous is not None:
            flat = whitened_rows(noise, previous).reshape(-1, p)
            known = flat.T @ flat / count
        if np.any(self._of_prior):
            known = np.asarray(self._of_prior / count) if known is None else known + self._of_prior / count
        candidates = CandidateRows(rows, known)
        space, criterion = estimable(candidates.triangle()), self.criteria[0]
        lost = determined(self._problem, space) != criterion.level if criterion.of_all else criterion.outside(space) > NOT_ESTIMABLE
        if lost or isinstance(criterion, ConditionNumber):
            return None
        found = optimal_weights(
            candidates,
            criterion,
            tolerance=self.tuning.tolerance,
            space=space,
            first=np.arange(count),
            allowed=self._runnable(everything, count),
            between_steps=self._clock.check,
        )
        return _Best(everything, candidates, found)


def _without_covariances(information: PointInformation) -> PointInformation:
    """Information with zeros for the predictive covariances, which candidates do not have, so that they take no memory."""
    zero = np.broadcast_to(0.0, information.covariance.shape)
    return replace(information, covariance=zero, elsewhere=tuple(map(_without_covariances, information.elsewhere)))
