"""Searches for runs from many starts: these race in groups, each of which is a whole search from a seed of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...basics.stop_reason import StopReason
from ...basics.values import Array
from ...basics.work_clock import Clock
from ...engine.workers import Distributor
from ...information.problem import DesignProblem
from ...points.run_region import RunRegion
from ...points.runs import Runs
from ...show.progress import Progress
from ..goal.criteria import Criterion
from ..goal.scenario_average import Average
from ..results.settings import RunSettings, seeds_of
from .run_search import RunSearch

Report = Callable[[Progress], None]


@dataclass(frozen=True, eq=False)
class RunGroup:
    """A search from some of the starts, from its seed to its end, and why it ended; see `RunSearch` for what it begins with.

    A search that is sent has a clock of its own: that of this machine says nothing on another one.
    """

    problem: DesignProblem
    region: RunRegion
    settings: RunSettings
    plants: Array
    average: Average
    previous: Array
    criteria: Sequence[Criterion]
    kept: Runs | None
    threads: int
    check: Callable[[RunSearch], None]
    clock: Clock | None = None
    report: Report | None = None

    def __call__(self, group: tuple[int, int]) -> tuple[RunSearch, StopReason]:
        seed, n_starts = group
        search = RunSearch(
            self.problem,
            self.region,
            replace(self.settings, seed=seed, n_starts=n_starts),
            self.plants,
            self.average,
            self.previous,
            self.criteria,
            threads=self.threads,
            clock=Clock(self.settings.time_limit) if self.clock is None else self.clock,
            kept=self.kept,
        )
        self.check(search)
        return search, search.run(self.report)


def best_of_groups(
    work: RunGroup, distributor: Distributor, clock: Clock, threads: int, report: Report | None
) -> tuple[RunSearch, StopReason]:
    """The best search of all groups, the first of equal ones, with what the others came to; and why it ended.

    Raises
    ------
    KeyboardInterrupt
        Where workers have not ended the first group.
    """
    settings = work.settings
    count = -(-settings.n_starts // settings.RACING)
    sizes = [len(part) for part in np.array_split(np.arange(settings.n_starts), count)]
    work = replace(work, clock=clock, report=report) if distributor.here else replace(work, threads=distributor.threads)
    best: RunSearch | None = None
    reason, done = StopReason.completed, 0
    try:
        groups = zip(seeds_of(settings.seed, count), sizes, strict=True)
        for search, ended in distributor.map(work, groups, "group {} of the starts".format, ahead=1):
            if best is None:
                best, reason = search, ended
            else:
                better, other = (search, best) if search.worth > best.worth else (best, search)
                better.include(other)
                best, reason = better, ended if better is search else reason
            done += search.n_starts
            if report is not None and count > 1:
                report(Progress(done, settings.n_starts, best.best.value, f"best {best.best.value:.3f}", clock.seconds))
            if ended == StopReason.interrupted:
                raise KeyboardInterrupt
            if clock.over():
                reason = StopReason.time_limit
                break
    except KeyboardInterrupt:
        if best is None:
            raise
        reason = StopReason.interrupted
    assert best is not None
    best.go_on_here(settings.seed, clock, threads)
    return best, reason
