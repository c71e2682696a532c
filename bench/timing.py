"""Times taken in turn, so that whatever else the machine does falls on all alike."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from time import perf_counter, process_time


@dataclass(frozen=True)
class Timing:
    """Wall time, s, and processor time per wall time: fewer cores than threads tells that others had the rest."""

    seconds: float
    cores: float


def best_times(tasks: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, Timing]:
    """Run every task once per round and return the shortest time of each."""
    best = dict.fromkeys(tasks, Timing(float("inf"), 0.0))
    for _ in range(rounds):
        for name, task in tasks.items():
            begin, used = perf_counter(), process_time()
            task()
            seconds = perf_counter() - begin
            if seconds < best[name].seconds:
                best[name] = Timing(seconds, (process_time() - used) / seconds)
    return best


def least_seconds(tasks: Mapping[str, Callable[[], object]], rounds: int, in_a_row: int = 1) -> dict[str, float]:
    """Run every task once per round, or as often, and return the least processor time of each, s: it counts on a busy machine too.

    More in a row have caches that are their own, as a longer task has.
    """
    least = dict.fromkeys(tasks, float("inf"))
    for _ in range(rounds):
        for name, task in tasks.items():
            for _ in range(in_a_row):
                began = process_time()
                task()
                least[name] = min(least[name], process_time() - began)
    return least
