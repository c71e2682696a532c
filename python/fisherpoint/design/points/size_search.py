"""Designs of several sizes, each searched for from the last one and among the candidates of all searches so far."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ...information.point_information import PointInformation
from ...information.problem import DesignProblem
from ..goal.estimable_space import Estimable
from ..goal.over_prior import Scenarios
from ..results.settings import ExchangeSettings, searched_by
from .auto_search import AutoSearch
from .candidate_archive import CandidateArchive
from .exchange_search import ExchangeSearch
from .point_search import PointSearch
from .starts import Make


@dataclass
class FollowingSearch(AutoSearch):
    """A search from a given design, over candidates that other searches have evaluated; they determine the `known` spaces."""

    start: PointInformation | None = None
    candidates: PointInformation | None = None
    known: tuple[Estimable | None, tuple[Estimable, ...] | None] = (None, None)

    def _first(self) -> PointInformation:
        assert self.start is not None
        return self.start

    def _all_rounds(self) -> Iterator[None]:
        assert self.candidates is not None
        pool, gain = self._pool(self.candidates), np.inf
        self.space, spaces = self.known
        # What candidates can determine does not depend on the size; the best of them, which are few, may determine less.
        self._restrict_to_estimable(pool, spaces)
        design = self.best.information
        while gain > self.tuning.cycle_least_gain * self._level:
            before = self._value(design)
            design = self._kept(self._ascended(self._kept(self._exchanged(design, pool))))
            for _ in range(self.tuning.sweep_rounds):
                yield
                design = self._round(design)
            gain = self._value(design) - before


@dataclass
class SizedSearches:
    """What searches for designs of ascending sizes begin from: the last one, and the candidates of all, `seen`.

    The candidates of each are to be included in `seen` before the next is made.
    """

    problem: DesignProblem
    previous: PointInformation | None
    seen: CandidateArchive
    scenarios: Scenarios | None
    last: PointSearch | None = None
    candidates: PointInformation | None = None

    def make(self, settings: ExchangeSettings) -> Make:
        """What makes the searches of the next size."""
        last, size = self.last, settings.n_experiments
        if searched_by(settings.method.name, self.problem) == "paper":
            return partial(_made, ExchangeSearch, self.problem, self.previous)
        if last is None:
            return partial(_made, AutoSearch, self.problem, self.previous, scenarios=self.scenarios)
        design = last.best.information
        if self.candidates is None:
            self.candidates = self.seen.best(design, self.previous, last.tuning.sweep_candidates)
        known = [design] if self.candidates is None else [self.candidates, design]
        more = np.arange(size) % len(design)  # repeated points give way to others where these have more information
        return partial(
            _made,
            FollowingSearch,
            self.problem,
            self.previous,
            scenarios=self.scenarios,
            start=design[more],
            candidates=PointInformation.join(known),
            known=(last.space, last.spaces),
        )


def _made(
    kind: type[PointSearch],
    problem: DesignProblem,
    previous: PointInformation | None,
    settings: ExchangeSettings,
    threads: int,
    **options: Any,
) -> PointSearch:
    return kind(problem, settings, threads, previous, **options)
