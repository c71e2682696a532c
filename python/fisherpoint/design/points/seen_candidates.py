"""What no design of the candidates that a search has evaluated can exceed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...information.output_covariance import criterion
from ...information.point_information import PointInformation, with_covariance
from ...information.problem import DesignProblem
from ...points.status import Status
from ..efficiency import Bound
from ..optimality.candidate_rows import CandidateRows, Places
from ..optimality.criteria import Determinant
from ..optimality.estimable import estimable
from ..optimality.weights import Weights, optimal_weights
from ..over_prior import Scenarios
from .over_bound import over_bound
from .point_ascent import scenario_rows, whitened_rows

MOST_NUMBERS = 10_000_000
"""Numbers of sensitivities that are kept, of 8 bytes each, of all scenarios; candidates after these are not."""

TOLERANCE = 5e-4
"""By which share the sensitivity function may exceed its level over the candidates."""


LOOKS = 6
"""How often as many of the best candidates as are wanted are tried on the nodes, at most."""


class _Best(NamedTuple):
    everything: PointInformation
    candidates: CandidateRows
    found: Weights


class SeenCandidates:
    """What was valid at the prior mean."""

    def __init__(self, problem: DesignProblem, threads: int) -> None:
        self._problem, self._threads = problem, threads
        self._seen: list[PointInformation] = []
        self._numbers = 0

    def add(self, information: PointInformation) -> None:
        """Keep these, as long as there is room."""
        if len(information) and self._numbers < MOST_NUMBERS:
            self._seen.append(information)
            self._numbers += information.sensitivity.size * len(information.everywhere)

    def include(self, other: SeenCandidates) -> None:
        """Keep those of another search too."""
        for information in other._seen:
            self.add(information)

    def bound(self, design: PointInformation, previous: PointInformation | None) -> Bound | None:
        """What bounds designs of as many points, beside the previous ones; None where no candidates determine all parameters.

        Maximised is log det of M = sum_i w_i F_i over weights that sum to 1, which every design of these candidates is a case of;
        the equivalence theorem bounds the maximum (Kiefer and Wolfowitz 1960). Candidates that no design may have, as plants of the
        prior cannot run them, are left out where they would have a weight.
        """
        best = self._best_weights(design, previous)
        if best is None:
            return None
        everything, candidates, found = best
        sign, log_det = np.linalg.slogdet(candidates.information(found.chosen, found.weights))
        if not sign > 0 or not found.efficiency > 0:
            return None
        p, count = candidates.rows.shape[2], len(design)
        total = count + (0 if previous is None else len(previous))
        return Bound(float(log_det + p * np.log(2 * count / total) - p * np.log(found.efficiency)), len(everything) - count)

    def bound_over(self, design: PointInformation, previous: PointInformation | None, over: Scenarios) -> Bound | None:
        """The same for a criterion over the prior."""
        everything, count = PointInformation.join([design, *self._seen]), len(design)
        noise = criterion(self._problem, everything, self._threads, "noise")
        rows = scenario_rows(noise, everything)
        p, total = rows.shape[3], count + (0 if previous is None else len(previous))
        known = np.zeros((len(rows), p, p))
        for s, there in enumerate(over.previous):
            if there is not None:
                flat = whitened_rows(noise, there).reshape(-1, p)
                known[s] = flat.T @ flat / count

        def runs_everywhere(places: Places) -> NDArray[np.bool_]:
            _, status = with_covariance(self._problem, everything[places], self._threads)
            return np.asarray(status == Status.ok)

        value = over_bound(rows, known, over.average, count, runs_everywhere)
        return None if value is None else Bound(float(value + p * np.log(2 * count / total)), len(everything) - count)

    def best(self, design: PointInformation, previous: PointInformation | None, most: int) -> PointInformation | None:
        """Those with the largest sensitivity under the best weights; None where they do not determine all parameters.

        All are valid on the nodes of the rule; most of the largest are not, so that there may be fewer than `most`.
        """
        best = self._best_weights(design, previous)
        if best is None:
            return None
        order = np.argsort(-best.candidates.along(best.found.half), kind="stable")
        taken, have = [], 0
        for first in range(0, min(len(order), LOOKS * most), most):
            some = order[first : first + most]
            _, status = with_covariance(self._problem, best.everything[some], self._threads)
            taken.append(some[status == Status.ok])
            have += len(taken[-1])
            if have >= most:
                break
        return best.everything[np.sort(np.concatenate(taken)[:most])]

    def _best_weights(self, design: PointInformation, previous: PointInformation | None) -> _Best | None:
        """The best weights of these candidates and the design's points, beside the previous ones."""
        everything = PointInformation.join([design, *self._seen])
        noise = criterion(self._problem, everything, self._threads, "noise")
        rows = whitened_rows(noise, everything)
        p, count, known = rows.shape[2], len(design), None
        if previous is not None:
            flat = whitened_rows(noise, previous).reshape(-1, p)
            known = flat.T @ flat / count
        candidates = CandidateRows(rows, known)
        space = estimable(candidates.triangle())
        if space.rank < p:
            return None
        valid = np.arange(len(rows)) < count

        def runs_everywhere(places: Places) -> NDArray[np.bool_]:
            unknown = places[~valid[places]]
            _, status = with_covariance(self._problem, everything[unknown], self._threads)
            valid[unknown] = status == Status.ok
            return valid[places]

        found = optimal_weights(
            candidates,
            Determinant("D", np.eye(p), True),
            tolerance=TOLERANCE,
            space=space,
            first=np.arange(count),
            allowed=runs_everywhere,
        )
        return _Best(everything, candidates, found)
