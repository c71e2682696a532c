"""How long a work may take, and how much of it is done at once: everything that a search does looks at one clock.

What a candidate costs is not known before some were computed: a trajectory takes a microsecond or a second. So work is done in
blocks whose size follows from what the last ones took; small ones cost more for each trajectory, as lanes of packs stay idle.
Without a limit, and where nobody follows the progress, a block is everything.
No result depends on the size of blocks, but for what the limit leaves no time for.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

BLOCK_SHARE = 0.04
"""Largest share of the limit that a block takes, as far as the last ones show."""

BLOCK_SECONDS = 0.8
"""Largest number of seconds that it takes."""

GROWTH = 4.0
"""Largest factor from the size of one block to that of the next."""

MOST_RESERVED = 0.3
"""Largest share of the limit that is kept for what follows a search."""

LANES = 32
"""Number of trajectories that are computed side by side: a block has no fewer."""

BEAT = 0.8
"""Seconds after which a work that says nothing reports that it goes on."""


class OutOfTime(Exception):
    """Raised between two blocks of a work when its time is up; the search returns what it has then."""


class Clock:
    """Seconds since a work began, a limit for its present part, and the size of its blocks.

    Parameters
    ----------
    limit : float or None
        Seconds for everything.

    Attributes
    ----------
    share : float
        Share of the limit after which the present part of the search has to end.
    reserve : float
        Seconds that what follows the search will take.
    paused : bool
        Whether the present part may take what it needs: without it there is nothing to return.
    beat : callable or None
        Called between blocks where nothing was reported for `BEAT` seconds.
    """

    def __init__(self, limit: float | None = None) -> None:
        self._began = self._reported = self._now()
        self._limit, self.share, self.reserve, self.paused = limit, 1.0, 0.0, False
        self._until, self._costs = float("inf"), dict[str, float]()
        self.beat: Callable[[], None] | None = None

    @property
    def seconds(self) -> float:
        return self._now() - self._began

    @property
    def left(self) -> float:
        """Seconds until the time of everything is up, those that are reserved among them."""
        return float("inf") if self._limit is None else self._limit - self.seconds

    @property
    def limited(self) -> bool:
        """Whether there is a limit."""
        return self._limit is not None

    @property
    def measures(self) -> bool:
        """Whether work is done in blocks: where there is a limit, or somebody follows the progress."""
        return self.limited or self.beat is not None

    def late(self, ahead: float = 0.0) -> bool:
        """Whether the time of the present part is up, or will be after some more seconds."""
        if self._limit is None or self.paused:
            return False
        return self.seconds + ahead >= min(self.share * self._end, self._until)

    def over(self) -> bool:
        """Whether the time of everything is up."""
        return self._limit is not None and self.seconds >= self._limit

    def check(self, ahead: float = 0.0) -> None:
        """Report that the work goes on, where that is due, and raise `OutOfTime` where it is late, or will be."""
        self.report()
        self.check_in_thread(ahead)

    def check_in_thread(self, ahead: float = 0.0) -> None:
        """Raise `OutOfTime` where it is late, or will be, and report nothing: the user's function is not for several threads."""
        if self.late(ahead):
            raise OutOfTime

    def report(self) -> None:
        """Report that the work goes on, where nothing was reported for a while."""
        if self.beat is not None and self._now() - self._reported >= BEAT:
            self.reported()
            self.beat()

    def reported(self) -> None:
        """Something was reported now."""
        self._reported = self._now()

    @contextmanager
    def part(self, share: float) -> Iterator[None]:
        """Give what is done inside a share of the time that is left; where that is up, it ends, and what follows goes on."""
        before = self._until
        if self._limit is not None:
            self._until = min(before, self.seconds + share * max(0.0, self._end - self.seconds))
        try:
            yield
        except OutOfTime:
            self._until = before
            if self.late():
                raise
        finally:
            self._until = before

    @contextmanager
    def pause(self) -> Iterator[None]:
        """Let what is done inside take what it needs."""
        before, self.paused = self.paused, True
        try:
            yield
        finally:
            self.paused = before

    def blocks(self, kind: str, count: int, lanes: int = 1) -> Iterator[slice]:
        """Slices of `count` items, one after the other; what is done with each is measured as a cost of its kind.

        Raises
        ------
        OutOfTime
            Before a block, where it is late.
        """
        if not self.measures:
            yield slice(0, count)
            return
        first, size = 0, 0
        while True:
            size = self.size(kind, lanes, size)
            self.check(self.cost(kind, min(size, count - first) * lanes))
            some = slice(first, min(first + size, count))
            began = self._now()
            yield some
            self.measured(kind, (some.stop - first) * lanes, self._now() - began)
            first = some.stop
            if first >= count:
                return

    def measured(self, kind: str, lanes: int, seconds: float) -> None:
        """Remember what so many trajectories took."""
        if lanes:
            cost = seconds / max(lanes, LANES // 2)
            self._costs[kind] = 0.5 * (self._costs.get(kind, cost) + cost)

    def cost(self, kind: str, lanes: int) -> float:
        """Seconds that so many trajectories of a kind will take, by what the last ones took; 0 where there were none."""
        return max(lanes, LANES // 2) * self._costs.get(kind, 0.0)

    def costly(self, kind: str, lanes: int) -> bool:
        """Whether they would take more of the limit than a block may."""
        return self._limit is not None and self.cost(kind, lanes) > BLOCK_SHARE * self._limit

    def affordable(self, kind: str, share: float) -> float:
        """Number of trajectories that a share of the limit suffices for, by what the last ones took."""
        cost = self._costs.get(kind, 0.0)
        return float("inf") if self._limit is None or cost <= 0.0 else share * self._limit / cost

    def size(self, kind: str, lanes: int, before: int = 0, least: int = LANES) -> int:
        """Number of items of the next block, where that `before` had so many; with the `least` number of trajectories."""
        least = max(1, least // lanes)
        cost = self._costs.get(kind, 0.0) * lanes
        if cost <= 0.0:
            return least
        seconds = BLOCK_SECONDS if self._limit is None else min(BLOCK_SECONDS, BLOCK_SHARE * self._limit)
        most = seconds / cost
        return max(least, int(min(most, GROWTH * before) if before else most))

    @staticmethod
    def _now() -> float:
        return time.perf_counter()

    @property
    def _end(self) -> float:
        assert self._limit is not None
        return self._limit - min(self.reserve, MOST_RESERVED * self._limit)
