"""Several whole searches from seeds of their own, here or by workers: the best of them, and how many came to one as good."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from ...basics.stop_reason import StopReason
from ...basics.work_clock import Clock
from ...engine.workers import Distributor
from ...show.progress import Progress
from ..results.settings import ExchangeSettings, seeds_of
from .candidate_archive import CandidateArchive
from .point_search import PointSearch

Report = Callable[[Progress], None]
Make = Callable[..., PointSearch]
"""From settings and a number of threads, and a clock, to a search."""


@dataclass(frozen=True, eq=False)
class _WholeSearch:
    """A search, from its seed to its end, and why it ended."""

    make: Make
    settings: ExchangeSettings
    threads: int
    report: Report | None = None

    def __call__(self, seed: int) -> tuple[PointSearch, StopReason]:
        clock, report = Clock(self.settings.method.time_limit), self.report
        if report is not None:
            clock.beat = lambda: report(Progress(0, self.settings.max_iterations, None, "drawing the first points", clock.seconds))
            if clock.limited:
                clock.beat()  # the first points may take seconds
        search = self.make(replace(self.settings, seed=seed), self.threads, clock=clock)
        ended = search.run(self.report)
        clock.beat = None
        return search, ended


def best_of_starts(
    make: Make, settings: ExchangeSettings, threads: int, distributor: Distributor, report: Report | None
) -> tuple[PointSearch, StopReason]:
    """The best of the method's starts, the first of equal ones, with the candidates of all of them; and why it ended.

    Parameters
    ----------
    make : callable
        It can be sent, where workers do the searches.
    settings : ExchangeSettings
    threads : int
        Of what follows the searches here.
    distributor : Distributor
    report : callable or None
        Is called after each iteration of a single start, else after each start.

    Raises
    ------
    KeyboardInterrupt
        Where workers have not ended the first start.
    """
    starts, limit = settings.method.starts, settings.method.time_limit
    whole = Clock(None if limit is None else starts * limit)
    if starts == 1:
        return _WholeSearch(make, settings, threads, report)(settings.seed)
    best: PointSearch | None = None
    reason, ends = StopReason.completed, list[float]()
    seen: CandidateArchive | None = None
    try:
        work = _WholeSearch(make, settings, distributor.threads)
        for search, ended in distributor.map(work, seeds_of(settings.seed, starts), "start {}".format, ahead=1):
            ends.append(search.best.log_det)
            if best is None or seen is None:
                best, seen, reason = search, search.seen, ended
            else:
                seen.include(search.seen)
                better, other = (search, best) if search.worth > best.worth else (best, search)
                better.source.include(other.source)
                best, reason = better, ended if better is search else reason
            if report is not None:
                message = f"best of {len(ends)} starts {best.best.log_det:.3f}"
                report(Progress(len(ends), starts, best.best.log_det, message, whole.seconds))
            if ended == StopReason.interrupted:
                raise KeyboardInterrupt
    except KeyboardInterrupt:
        if best is None:
            raise
        reason = StopReason.interrupted
    assert best is not None and seen is not None
    seen.criteria = best.seen.criteria
    best.seen, best.settings, best.threads = seen, settings, threads
    best.time, best.ends = whole, tuple(ends)
    return best, reason
