"""A race of climbs: each gets some work, the best go on with more of it, until one is left.

That is successive halving (Karnin, Koren and Somekh, Almost optimal exploration in multi-armed bandits, 2013). What a start is
worth says little about where it leads to; what it is worth after some ascents and changes says much of it. The work is counted in
segments, never in seconds. Where there is little to do all of them end before any is left behind.
"""

from __future__ import annotations

from collections.abc import Callable

from .run_climb import Climb
from .run_objective import RunObjective


def race(objective: RunObjective, climbs: list[Climb], report: Callable[[Climb], None]) -> None:
    """Let climbs go on until one is left, or all that are left have ended; `report` is called after each turn."""
    going = climbs
    while True:
        for one in going:
            end = objective.work + objective.tuning.rung_segments // len(going)
            while not one.ended and (one.last is None or objective.work < end):
                objective.clock.check()
                one.step()
            report(one)
        going = sorted(going, key=lambda one: one.worth, reverse=True)
        if len(going) == 1 or all(one.ended for one in going):
            return
        going = going[: -(-len(going) // objective.tuning.rung_survivors)]
