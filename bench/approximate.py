"""``python -m bench approximate``: D-optimal weights of a million candidates; time, proven gap, and memory in its own process."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import numpy as np

from fisherpoint.design.candidates.candidate_rows import CandidateRows
from fisherpoint.design.goal.determinant import Determinant
from fisherpoint.design.weights.weights import optimal_weights

from . import fresh_process
from .memory import peak_memory

PARAMETERS, OUTPUTS = 9, 4


@dataclass(frozen=True)
class WeightsFigures:
    """Of weights: candidates, seconds, MB at the peak and before, by how much the sensitivity function exceeds its level, points
    with a weight, candidates that were deleted, and rounds."""

    kind: str
    candidates: int
    seconds: float
    peak: float
    before: float
    gap: float
    support: int
    deleted: int
    rounds: int


def measure(quick: bool) -> list[WeightsFigures]:
    """Rows of random numbers, and rows that are smooth functions of places, of which many neighbours are nearly as good."""
    count = 100_000 if quick else 1_000_000
    return [WeightsFigures(**fresh_process.call(__name__, weighed.__name__, kind, count)) for kind in ("random", "smooth")]


def weighed(kind: str, count: int) -> dict[str, str | float]:
    """The figures of one set of candidates."""
    rows = _rows(kind, count)
    before, begin = peak_memory(), perf_counter()
    weights = optimal_weights(CandidateRows(rows), Determinant("D", np.eye(PARAMETERS), True), tolerance=1e-6)
    seconds = perf_counter() - begin
    return {
        "kind": kind,
        "candidates": count,
        "seconds": seconds,
        "peak": peak_memory(),
        "before": before,
        "gap": weights.largest - 1.0,
        "support": len(weights.chosen),
        "deleted": weights.deleted,
        "rounds": weights.rounds,
    }


def _rows(kind: str, count: int) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    rng = np.random.default_rng(0)
    rows = rng.standard_normal((count, OUTPUTS, PARAMETERS))
    if kind == "smooth":
        mixing = rng.standard_normal((3, OUTPUTS * PARAMETERS))
        for first in range(0, count, 1 << 16):
            part = rows[first : first + (1 << 16)]
            part[:] = np.sin(rng.uniform(-1, 1, (len(part), 3)) @ mixing).reshape(part.shape)
    return rows


def show(figures: list[WeightsFigures]) -> str:
    """As a table of text."""
    head = f"{'rows':8} {'candidates':>10} {'s':>6} {'MB':>6} {'before':>6} {'gap':>8} {'points':>6} {'deleted':>8} {'rounds':>6}"
    lines = [
        f"{f.kind:8} {f.candidates:10d} {f.seconds:6.1f} {f.peak:6.0f} {f.before:6.0f} {f.gap:8.1e} {f.support:6d} {f.deleted:8d} "
        f"{f.rounds:6d}"
        for f in figures
    ]
    return "\n".join([head, *lines])
