"""Peak memory of a predictive covariance against the number of nodes R, each in a process of its own."""

from __future__ import annotations

import re
import resource
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import fisherpoint as fp

from . import fresh_process
from .workload import MODEL, PRIOR, candidates

GRIDS = {2**6 * 3**3: [2] * 6 + [3] * 3, 3**9: [3] * 9, 5**9: [5] * 9}
"""Levels of the parameters by the number of nodes."""


@dataclass(frozen=True)
class MemoryFigures:
    """MB by which the peak grew, and what the nodes and their outputs would take if they were stored."""

    nodes: int
    seconds: float
    grown: float
    stored: float


def measure() -> list[MemoryFigures]:
    """Measure one point on each of the grids."""
    figures = []
    for nodes, levels in GRIDS.items():
        seconds, grown = fresh_process.call(__name__, grown_by.__name__, levels)
        figures.append(MemoryFigures(nodes, seconds, grown, nodes * (9 + 4) * 8 / 1e6))
    return figures


def grown_by(levels: list[int]) -> tuple[float, float]:
    """Return seconds and MB of one predictive covariance on all cores, past imports and a first call."""
    point = candidates()[:1]
    fp.predictive_covariance(MODEL, point, PRIOR, fp.TensorGrid(levels=2), jumps="exclude")
    before, begin = peak_memory(), perf_counter()
    rule = fp.TensorGrid(dict(zip(PRIOR.names, levels, strict=True)))
    result = fp.predictive_covariance(MODEL, point, PRIOR, rule, jumps="exclude")
    seconds = perf_counter() - begin
    if result.status[0] != fp.Status.ok:
        raise RuntimeError(f"expected a covariance, given status {result.status[0]}")
    return seconds, peak_memory() - before


def peak_memory() -> float:
    """Return the peak resident memory of this process in MB.

    Linux hands ru_maxrss down from the process that started this one, so that a large parent would hide any growth; the kernel's
    VmHWM is this process's own.
    """
    status = Path("/proc/self/status")
    if status.exists() and (found := re.search(r"VmHWM:\s+(\d+) kB", status.read_text())):
        return int(found[1]) * 1024 / 1e6
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6
