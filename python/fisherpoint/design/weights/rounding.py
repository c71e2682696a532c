"""Whole numbers of measurements from weights."""

from __future__ import annotations

import numpy as np

from ...basics.values import Array, IntArray


def efficient_rounding(weights: Array, n: int) -> IntArray:
    """How often each of m points is measured, (m,), n times in all: Pukelsheim and Rieder, Biometrika 79 (1992), 763-770.

    Each point keeps at least one; no ratio n_i / (n w_i) is smaller than it has to be.
    """
    counts = np.maximum(np.ceil((n - len(weights) / 2) * weights), 1).astype(int)
    while (total := int(counts.sum())) != n:
        if total < n:
            counts[np.argmin(counts / weights)] += 1
        else:
            counts[np.argmax((counts - 1) / weights)] -= 1
    return counts
