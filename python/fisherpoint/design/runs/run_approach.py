"""From runs that enough plants can run towards better ones that too few can, as far as enough can.

Distances from limits are taken to first order at the prior mean. Where plants differ by more than that shows, as those that stick
and those that slide, no such distance leads to runs that enough plants can run, or only to small ones. Between runs that they can
run and better ones, some of the way is open to them all the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ...basics.values import Array
from .reached_runs import ReachedRuns


def approach(
    best: ReachedRuns,
    targets: Sequence[Array],
    tried: Callable[[Array], ReachedRuns],
    hopeful: Callable[[Array, float], bool],
    least: float,
    halvings: int,
) -> ReachedRuns:
    """The best runs that enough plants can run on the ways from `best`, which they can, to targets, one after the other.

    All is gone through again from what was found, until that gains less than `least`.

    Parameters
    ----------
    best : ReachedRuns
        L runs that enough plants can run, with free numbers z (L, d).
    targets : sequence of ndarray, (L, d)
        Free numbers of better runs, between 0 and 1.
    tried : callable
        Takes free numbers (L, d), and has the runs that they stand for with what these are worth, and for how many plants.
    hopeful : callable
        Takes free numbers (L, d) and a value of the criterion, and has at little cost whether they may be worth more.
    least : float
        In the criterion's unit, such as that of log det F.
    halvings : int
        How often each way is halved.

    Returns
    -------
    ReachedRuns
        `best`, or better ones that enough plants can run.
    """
    before = -float("inf")
    while best.value > before + least:
        before = best.value
        for target in targets:
            start, low, high = best.z, 0.0, 1.0
            for _ in range(halvings):
                share = 0.5 * (low + high)
                z = start + share * (target - start)
                if not hopeful(z, best.value):
                    low = share  # further on it may be better
                    continue
                found = tried(z)
                low, high = (share, high) if found.feasible else (low, share)
                if found.feasible and found.regular and found.value > best.value:
                    best = found
    return best
