"""Designs of several sizes, each searched for from the last one and among the candidates of all searches so far."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ...information.point_information import PointInformation
from ...information.problem import DesignProblem
from ..goal.over_prior import Scenarios
from ..results.settings import ExchangeSettings, searched_by
from .auto_search import AutoSearch
from .candidate_archive import CandidateArchive
from .exchange_search import ExchangeSearch
from .point_search import PointSearch


@dataclass
class FollowingSearch(AutoSearch):
    """A search from a given design, over candidates that other searches have evaluated."""

    start: PointInformation | None = None
    candidates: PointInformation | None = None
    last: PointSearch | None = None

    def _first(self) -> PointInformation:
        assert self.start is not None
        return self.start

    def _all_rounds(self) -> Iterator[None]:
        assert self.candidates is not None
        pool, gain = self._pool(self.candidates), np.inf
        if self.last is not None:
            self.space = self.last.space
        # What candidates can determine does not depend on the size; the best of them, which are few, may determine less.
        self._restrict_to_estimable(pool, None if self.last is None else self.last.spaces)
        design = self.best.information
        while gain > self.tuning.cycle_least_gain * self._level:
            before = self._value(design)
            design = self._kept(self._ascended(self._kept(self._exchanged(design, pool))))
            for _ in range(self.tuning.sweep_rounds):
                yield
                design = self._round(design)
            gain = self._value(design) - before


def sized_searches(
    problem: DesignProblem,
    settings: ExchangeSettings,
    sizes: list[int],
    threads: int,
    previous: PointInformation | None,
    seen: CandidateArchive,
    scenarios: Scenarios | None = None,
) -> Iterator[PointSearch]:
    """Searches of ascending sizes, each to be run, and its candidates included in `seen`, before the next is made."""
    last = candidates = None
    search: PointSearch
    for size in sizes:
        own = replace(settings, n_experiments=size)
        if searched_by(settings.method.name, problem) == "paper":
            search = ExchangeSearch(problem, own, threads, previous)
        elif last is None:
            search = AutoSearch(problem, own, threads, previous, scenarios=scenarios)
        else:
            design = last.best.information
            if candidates is None:
                candidates = seen.best(design, previous, last.tuning.sweep_candidates)
            known = [design] if candidates is None else [candidates, design]
            more = np.arange(size) % len(design)  # repeated points give way to others where these have more information
            search = FollowingSearch(
                problem,
                own,
                threads,
                previous,
                scenarios=scenarios,
                start=design[more],
                candidates=PointInformation.join(known),
                last=last,
            )
        yield search
        last = search
