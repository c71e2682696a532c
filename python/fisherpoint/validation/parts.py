"""Parts of the virtual experiments, as values: where each begins, its true parameters, and how far random numbers are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import repeat
from time import perf_counter
from typing import Any, NamedTuple

from ..basics.values import Array
from .fits import VirtualExperiments, VirtualFits
from .truths import Streams

SECONDS = 5.0
"""Time that a part should take here: the next is larger or smaller accordingly, by at most `GROWTH`. Fits take less together."""

GROWTH = 8.0

LARGEST, FEWEST = 500, 32
"""Experiments of a part that is sent at most, and parts that there are at least."""


class Part(NamedTuple):
    """Some of the virtual experiments, with every design.

    Attributes
    ----------
    first : int
        Number of the first of them.
    theta : ndarray, (n, p)
    positions : mapping of design to position
        Of the random numbers: see `Streams.at`.
    """

    first: int
    theta: Array
    positions: Mapping[str, tuple[Mapping[str, Any], ...]]


@dataclass(frozen=True, eq=False)
class PartWork:
    """The fits of a part, by design."""

    experiments: Mapping[str, VirtualExperiments]

    def __call__(self, part: Part) -> dict[str, VirtualFits]:
        return {name: one.run(part.theta, Streams.at(part.positions[name])) for name, one in self.experiments.items()}

    def parts(self, thetas: Array, seed: int, sizes: Iterable[int]) -> Iterator[Part]:
        """Cut the experiments into parts of these sizes; the random numbers before a part are drawn and dropped."""
        streams = {name: Streams.of(seed) for name in self.experiments}
        first = 0
        for size in sizes:
            if first >= len(thetas):
                return
            theta = thetas[first : first + size]
            yield Part(first, theta, {name: one.position for name, one in streams.items()})
            for name, one in self.experiments.items():
                one.rig.deviations(one.points, len(theta), streams[name])
            first += len(theta)

    @property
    def most(self) -> int:
        """How many experiments may be fitted together."""
        return min(one.estimator.at_once for one in self.experiments.values())


def sizes_here(most: int) -> Iterator[int]:
    """Sizes of parts that are computed one after the other: larger where they take little time, as fits take less together."""
    size = 1  # Ctrl-C is to find something, however long a fit takes
    while True:
        start = perf_counter()
        yield min(size, most)
        seconds = perf_counter() - start
        size = max(1, int(min(size, most) * min(GROWTH, max(1 / GROWTH, SECONDS / max(seconds, 1e-9)))))


def sizes_to_send(most: int, count: int) -> Iterator[int]:
    """Sizes of parts that are sent: they follow from the number of experiments alone."""
    return repeat(min(most, max(1, min(LARGEST, count // FEWEST))))
