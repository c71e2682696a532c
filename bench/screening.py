"""How often screening chooses the candidate that the rule chooses among all: iterations of a search on the default cylinder."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fisherpoint.design.points.exchange_search import ExchangeSearch
from fisherpoint.design.results.settings import ExchangeMethod, ExchangeSettings
from fisherpoint.engine import _core
from fisherpoint.information.point_information import PointInformation, with_linearized_covariance
from fisherpoint.points.settings import resolve_threads

from .designs import default_problem


@dataclass(frozen=True)
class ScreeningFigures:
    """Draws of 50 candidates of which the best under the rule was on the list of the few that screening would leave."""

    output_covariance: str
    draws: int
    same: int

    @property
    def share(self) -> float:
        return self.same / self.draws


class _Watched(ExchangeSearch):
    """A search without screening that looks what screening would have left of each draw."""

    draws = same = 0

    def _candidates(self, accumulator: _core.FisherAccumulator, ridge: float) -> tuple[PointInformation, bool]:
        candidates, confirmed = super()._candidates(accumulator, ridge)
        linearized = self._phis_with(accumulator, with_linearized_covariance(self.problem, candidates)[0], ridge)
        best = int(np.argmax(self._phis_with(accumulator, candidates, ridge)))
        self.draws += 1
        self.same += best in np.argsort(-linearized, kind="stable")[: self.tuning.paper.shortlist]
        return candidates, confirmed


def measure(quick: bool) -> list[ScreeningFigures]:
    """Watch searches under the two output covariances that need the covariance of every candidate."""
    figures = []
    for kind in ("pooled", "pointwise"):
        settings = ExchangeSettings(
            n_experiments=12,
            n_candidates=50,
            max_iterations=40 if quick else 200,
            seed=0,
            method=ExchangeMethod(references=False, screen=False),
        )
        search = _Watched(default_problem(kind), settings, resolve_threads(None))
        search.run(None)
        figures.append(ScreeningFigures(kind, search.draws, int(search.same)))
    return figures
