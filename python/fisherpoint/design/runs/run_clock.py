"""How long a search for runs may take: everything that it does looks at one clock."""

from __future__ import annotations

import time


class OutOfTime(Exception):
    """Raised between two parts of a work when its time is up; the search returns what it has then."""


class Clock:
    """Seconds since a search began, and a limit for its present part.

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
    """

    def __init__(self, limit: float | None) -> None:
        self._began, self._limit, self.share, self.reserve = time.perf_counter(), limit, 1.0, 0.0
        self.paused = False

    @property
    def seconds(self) -> float:
        return time.perf_counter() - self._began

    def late(self) -> bool:
        """Whether the time of the present part is up."""
        if self._limit is None or self.paused:
            return False
        return self.seconds >= self.share * (self._limit - min(self.reserve, 0.5 * self._limit))

    def over(self) -> bool:
        """Whether the time of everything is up."""
        return self._limit is not None and self.seconds >= self._limit

    def check(self) -> None:
        """Raise `OutOfTime` where it is late."""
        if self.late():
            raise OutOfTime
