"""Check whether data were added before: nothing counts twice.

A point is a run of one segment here. A run is known where it starts as an earlier one, has the same inputs as far as both have
numbers, and reads the same there to the last bit.
"""

from __future__ import annotations

import warnings
from collections.abc import Hashable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array
from ..data import Measurements
from ..points.runs import Runs


class _Run(NamedTuple):
    """A run up to its last number: where it is, and its outputs (n, n_y)."""

    runs: Runs
    row: int
    y: Array

    @property
    def begin(self) -> Hashable:
        """How the run begins."""
        return self.runs.key(self.row, 1)

    def same_samples(self, other: _Run) -> tuple[int, int]:
        """How many samples read the same as those of another run with the same inputs, and how many both have."""
        n = min(len(self.y), len(other.y))
        if self.runs.key(self.row, n) != other.runs.key(other.row, n):
            return 0, 0
        both = np.isfinite(self.y[:n]) & np.isfinite(other.y[:n])
        there = both.any(axis=1)
        return int((there & ((self.y[:n] == other.y[:n]) | ~both).all(axis=1)).sum()), int(there.sum())


def check_new(batches: Sequence[Measurements], data: Measurements) -> None:
    """Raise for two samples or more that would count twice; warn of a single one, and of a run most of which is known.

    That may be a replicate: a coarse sensor often reads the same.

    Parameters
    ----------
    batches : sequence of Measurements
        The data of each earlier batch.
    data : Measurements
        Those that are to be new.
    """
    known: dict[int, dict[int, int]] = {}  # by batch and row, how many samples
    alike: dict[int, tuple[int, str]] = {}  # by row
    kind = data.points.kind
    for k, batch in enumerate(batches, 1):
        for row, same, both in _matches(batch, data):
            if same == both:
                known.setdefault(k, {})[row] = same
            elif 2 * same >= both:
                alike[row] = k, f", in {same} of {both} samples"
    samples: dict[int, int] = {}
    for k, rows in known.items():
        for row, same in rows.items():
            samples[row] = max(same, samples.get(row, 0))
            alike[row] = k, ""
    if sum(samples.values()) > 1:
        k = max(known, key=lambda k: len(known[k]))
        number = sum(1 for _ in _runs(batches[k - 1]))
        which = "those" if len(known[k]) >= number else f"{len(known[k])} of the {number} {kind}s"
        raise ValueError(f"data: expected new measurements only, given {which} of batch {k} among them")
    for row, (k, part) in sorted(alike.items()):
        warnings.warn(f"data: {kind}s[{row}] is also in batch {k}{part}; it counts as a repeated measurement", stacklevel=3)


def _matches(batch: Measurements, data: Measurements) -> Iterator[tuple[int, int, int]]:
    """Rows of `data` with samples that read as in `batch`: how many, and how many both have, compared with the most similar run."""
    before: dict[Hashable, list[_Run]] = {}
    for run in _runs(batch):
        before.setdefault(run.begin, []).append(run)
    for run in _runs(data):
        counts = [run.same_samples(other) for other in before.get(run.begin, ())]
        same, both = max(counts, key=lambda count: (count[0] == count[1], count[0]), default=(0, 0))
        if same:
            yield run.row, same, both


def _runs(data: Measurements) -> Iterator[_Run]:
    """The runs that have a number."""
    runs, y = data.runs, data.run_outputs
    there: NDArray[np.bool_] = np.asarray(np.isfinite(y).any(axis=2))
    for row in np.flatnonzero(there.any(axis=1)).tolist():
        yield _Run(runs, row, y[row, : int(np.flatnonzero(there[row])[-1]) + 1])
