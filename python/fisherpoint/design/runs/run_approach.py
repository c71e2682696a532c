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
    """The best runs that enough plants can run on the ways from `best`, which they can, to `targets` (L, d), one after the other.

    Each way is halved so often. All is gone through again from what was found, until that gains less than `least`. `hopeful` says,
    at little cost, whether free numbers may be worth more than a value.
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
