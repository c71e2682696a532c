"""One run of Algorithm 1: the best design so far, and the moves that improve it.

Random candidates alone come close to an optimum only slowly, above all where it lies on bounds of the region, as it mostly does.
So some iterations end by drawing candidates near every point of the design; a point gives way to the best of its own where Phi
rises.

Where D needs the predictive covariance of every candidate, that is what takes the time. Screening orders the candidates by Phi with
their linearized covariances, which come with the sensitivities, and gives the rule only the best few.
"""

from __future__ import annotations

import numpy as np

from ...basics.messages import listed
from ...basics.values import Array, IntArray
from ...engine import _core
from ...information.output_covariance import needs_covariances
from ...information.point_information import PointInformation
from .point_search import Incumbent, PointSearch


class ExchangeSearch(PointSearch):
    """The state of one run of Algorithm 1."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.problem.assumed is not None and self.problem.assumed.open:
            local = listed(self.problem.assumed.nuisance_names[j] for j in self.problem.assumed.open)
            raise ValueError(f"method: expected 'auto' beside {local}, local to a plant and without a spread; given 'paper'")
        self.needs_covariances = needs_covariances(str(self.problem.output_covariance))

    def _advance(self, iteration: int) -> bool:
        exchanged = self._iterate()
        if iteration % self.tuning.paper.move_every == 0:
            exchanged |= self._move()
        return exchanged

    def _iterate(self) -> bool:
        """Lines 6 to 14: draw candidates until one improves Phi, let the best enter and the least useful point leave."""
        ridge = self._ridge
        accumulator = self._accumulate(self.best.prepared)
        phi = self._phi(accumulator, ridge)
        best_phi, entering = -np.inf, None
        for _ in range(1 + self.settings.method.max_redraws):
            candidates, confirmed = self._candidates(accumulator, ridge)
            phis = self._phis_with(accumulator, candidates, ridge)
            for m in np.argsort(-phis, kind="stable"):
                if not phis[m] > best_phi:
                    break
                exchanged = self._without_least(accumulator, candidates[m : m + 1], ridge)
                # A candidate that would leave at once need not be tried on the nodes.
                if exchanged is None or confirmed or len(self.source.confirm(candidates[m : m + 1])):
                    best_phi, entering = phis[m], exchanged
                    break
            if best_phi > phi:
                break
        if entering is None:
            return False
        prepared = self.d.prepare(entering)
        log_det = self._log_det(prepared, 0.0)
        if not (log_det if ridge == 0.0 else self._log_det(prepared, ridge)) > phi:  # the same to rounding
            return False
        self.best = Incumbent(entering, prepared, log_det)
        return True

    def _move(self) -> bool:
        """Draw candidates near the points, and replace each point by its best candidate where that raises Phi."""
        settings, start = self.settings, self.best.information
        if not settings.method.local or not np.isfinite(self.best.log_det):
            return False
        each = max(1, round(self.tuning.paper.move_every * settings.method.local * settings.n_candidates / len(start)))
        candidates, near = self.source.draw_near(start.experiments, each)
        chosen, places = self._nearby(candidates, near)
        moved = False
        for m, k in enumerate(places):
            rows = np.arange(len(start))
            rows[k] = len(start)
            information = PointInformation.join([self.best.information, chosen[m : m + 1]])[rows]
            prepared = self.d.prepare(information)
            log_det = self._log_det(prepared, 0.0)
            if log_det > self.best.log_det + self.tuning.paper.move_least_gain:
                self.best, moved = Incumbent(information, prepared, log_det), True
        return moved

    def _nearby(self, candidates: PointInformation, near: IntArray) -> tuple[PointInformation, IntArray]:
        """For each point the best candidate near it, where it alone would raise Phi and is valid on all nodes; and which points."""
        accumulator, best = self._accumulate(self.best.prepared), self.best.prepared
        if self.needs_covariances:
            candidates, finite = self.source.linearized(candidates)
            candidates, near = candidates[finite], near[finite]
        chosen = []
        for k in range(len(best)):
            own = np.flatnonzero(near == k)
            if len(own):
                sensitivity, covariance = best.sensitivity[k : k + 1], best.covariance[k : k + 1]
                accumulator.remove(sensitivity, covariance)
                phis = self._phis_with(accumulator, candidates[own], 0.0)
                accumulator.add(sensitivity, covariance)
                if phis.max() > self.best.log_det + self.tuning.paper.move_least_gain:
                    chosen.append(own[np.argmax(phis)])
        if not chosen:
            return candidates[:0], near[:0]
        information, valid = self.source.confirmed(candidates[chosen])
        return information[valid], near[chosen][valid]

    def _candidates(self, accumulator: _core.FisherAccumulator, ridge: float) -> tuple[PointInformation, bool]:
        """Candidates for one draw, and whether they are valid on all nodes and carry the rule's covariances."""
        if not self.needs_covariances:
            return self.source.draw(self.settings.n_candidates), False
        if not self.settings.method.screen:
            return self.source.draw_confirmed(self.settings.n_candidates), True
        candidates, finite = self.source.linearized(self.source.draw(self.settings.n_candidates))
        candidates = candidates[finite]
        phis = self._phis_with(accumulator, candidates, ridge)
        return self.source.confirm(candidates[np.argsort(-phis, kind="stable")[: self.tuning.paper.shortlist]]), True

    def _phis_with(self, accumulator: _core.FisherAccumulator, candidates: PointInformation, ridge: float) -> Array:
        """log det F with each candidate beside the design, (K,)."""
        prepared = self.d.prepare(candidates)
        phis: Array = accumulator.log_det_with(
            prepared.sensitivity, prepared.covariance, self.d.given, self.d.pooled, ridge, self.problem.n_nuisance
        )
        return phis

    def _without_least(
        self, accumulator: _core.FisherAccumulator, candidate: PointInformation, ridge: float
    ) -> PointInformation | None:
        """The design where the candidate replaces the point that is missed least; None where that is the candidate."""
        added = self.d.prepare(candidate)
        sensitivity = np.concatenate([self.best.prepared.sensitivity, added.sensitivity])
        covariance = np.concatenate([self.best.prepared.covariance, added.covariance])
        accumulator.add(added.sensitivity, added.covariance)
        d = self.d
        phis = accumulator.log_det_without(sensitivity, covariance, d.given, d.pooled, ridge, self.problem.n_nuisance)
        accumulator.remove(added.sensitivity, added.covariance)
        leaving = int(np.argmax(phis))
        last = len(phis) - 1
        if leaving == last or not phis[leaving] > phis[last]:
            return None
        rows = np.arange(last)
        rows[leaving] = last
        return PointInformation.join([self.best.information, candidate])[rows]
