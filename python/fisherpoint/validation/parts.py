"""Parts of the virtual experiments, as values: where each begins, its true parameters, and how far random numbers are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import repeat
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array
from ..basics.work_clock import LANES
from .fits import VirtualExperiments, VirtualFits
from .truths import Streams

SECONDS = 5.0
"""Time that a part should take here: the next is larger or smaller accordingly, by at most `GROWTH`. Fits take less together."""

GROWTH = 8.0

FULLER = 3
"""Parts behind the first are at least so many times as large: while searches end one by one, the others fill the lanes longer."""

BYTES, FEWEST = 90_000, 16
"""Size of what is sent of a part at most, and parts that there are at least: fits take longer in smaller ones."""


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


class SentFits(NamedTuple):
    """Fits as they are sent: without the truth, which is known where they go, and with each reason of failures once."""

    fits: VirtualFits
    reasons: NDArray[np.str_]
    reason: NDArray[np.uint8]

    @classmethod
    def of(cls, fits: VirtualFits) -> SentFits:
        reasons, reason = np.unique(fits.failure, return_inverse=True)
        return cls(fits._replace(truth=fits.truth[:0], failure=fits.failure[:0]), reasons, reason.astype(np.uint8))

    def whole(self, truth: Array) -> VirtualFits:
        return self.fits._replace(truth=truth, failure=self.reasons[self.reason])


@dataclass(frozen=True, eq=False)
class PartWork:
    """The fits of a part, by design."""

    experiments: Mapping[str, VirtualExperiments]

    def __call__(self, part: Part) -> dict[str, SentFits]:
        return {name: SentFits.of(one.run(part.theta, Streams.at(part.positions[name]))) for name, one in self.experiments.items()}

    def whole(self, sent: Mapping[str, SentFits], theta: Array) -> dict[str, VirtualFits]:
        """Fits that were sent, of the true parameters theta (n, p)."""
        return {name: sent[name].whole(one.truth(theta)) for name, one in self.experiments.items()}

    def parts(self, thetas: Array, seed: int, sizes: Iterable[int]) -> Iterator[Part]:
        """Cut the experiments into parts of these sizes; the random numbers before a part are drawn and dropped."""
        streams = {name: Streams.of(seed, len(one.rig.sensors.std)) for name, one in self.experiments.items()}
        first = 0
        for size in sizes:
            if first >= len(thetas):
                return
            theta = thetas[first : first + size]
            yield Part(first, theta, {name: one.position for name, one in streams.items()})
            for name, one in self.experiments.items():
                one.passed(theta, streams[name])
            first += len(theta)

    @property
    def most(self) -> int:
        """How many experiments may be fitted together."""
        return min(one.estimator.at_once for one in self.experiments.values())

    def least(self, threads: int) -> int:
        """How many experiments, at two searches each, take as long as one, as their trajectories are computed side by side."""
        in_core = all(one.rig.model.in_core for one in self.experiments.values())
        return max(1, threads * (LANES // 2) // 2) if in_core else 1

    @property
    def most_to_send(self) -> int:
        """How many experiments may be sent together, there as true parameters and back as fits."""
        experiments = self.experiments.values()
        there = 8 * max(len(one.rig.model.parameters) for one in experiments)
        back = sum(  # two numbers and two flags of each parameter, and two and one of a local value
            1 + 18 * len(one.estimator.parameters) + 17 * len(one.estimator.local.each) for one in experiments
        )
        return max(1, min(self.most, BYTES // max(there, back)))


def sizes_here(most: int, least: int = 1) -> Iterator[int]:
    """Sizes of parts that are computed one after the other: larger where they take little time, as fits take less together.

    The first one is small, as Ctrl-C is to find something, however long a fit takes: `least`, which take as long as one.
    """
    size = least
    while True:
        start = perf_counter()
        yield min(size, most)
        seconds = perf_counter() - start
        size = max(FULLER * least, int(min(size, most) * min(GROWTH, max(1 / GROWTH, SECONDS / max(seconds, 1e-9)))))


def sizes_to_send(most: int, count: int) -> Iterator[int]:
    """Sizes of parts that are sent: they follow from what is fitted, and to how many experiments."""
    return repeat(max(1, min(most, count // FEWEST)))
