"""Times taken in turn, so that what else the machine does falls on all alike."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from time import perf_counter


def best_times(tasks: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Run every task once per round and return the shortest time of each, s."""
    best = dict.fromkeys(tasks, float("inf"))
    for _ in range(rounds):
        for name, task in tasks.items():
            begin = perf_counter()
            task()
            best[name] = min(best[name], perf_counter() - begin)
    return best


def loosest(meets: Callable[[float], bool]) -> float:
    """The loosest tolerance 10^(-k/4) that meets what is asked of it and is followed by another that does."""
    tolerances = [10 ** (-k / 4) for k in range(12, 45)]
    met = False
    for previous, rtol in zip([tolerances[0], *tolerances], tolerances, strict=False):
        if meets(rtol):
            if met:
                return previous
            met = True
        else:
            met = False
    raise RuntimeError("expected a tolerance that meets the accuracy rule, found none down to 1e-11")
