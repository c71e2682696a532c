"""Runs as a search computes them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...points.runs import Runs


@dataclass(frozen=True, eq=False)
class TriedRuns:
    """K runs, and the segments (K, M) at whose ends their distances to limits are taken; None for all.

    Runs that are sampled on a clock of their own have many more segments than there are such ends.
    """

    runs: Runs
    looks: NDArray[np.intp] | None = None

    def __len__(self) -> int:
        return len(self.runs)

    def __getitem__(self, rows: Any) -> TriedRuns:
        return TriedRuns(self.runs[rows], None if self.looks is None else self.looks[rows])
