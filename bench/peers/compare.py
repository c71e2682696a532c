"""All programs on the task, each at the loosest tolerance that meets the accuracy rule, timed in turn in one run on one core."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib import import_module

import numpy as np

import fisherpoint as fp

from .. import fresh_process
from ..accuracy import ACCURACY_RULE, Errors, loosest_rtol, output_errors, sensitivity_errors
from ..covariances import DEFAULT_RTOL, TIGHT_RTOL
from ..memory import peak_memory
from ..scipy_peer import solve_states
from ..timing import best_times
from ..workload import MODEL, PRIOR, RULE, Array, Pairs, candidates, random_pairs
from .ours import PEERS as OURS
from .peer import Peer, Solution
from .registry import ENTRIES

RUN = 243
"""Neighbouring nodes of the large sample: those of five parameters on all levels, as a user's loop over the grid has them."""


@dataclass(frozen=True)
class PeerFigures:
    """One program at one tolerance; the rate is per second, errors are those of y, or of dy/dtheta where these were asked for."""

    name: str
    rtol: float
    rate: float
    cores: float
    sample: int
    errors: Errors
    steps: float | None
    memory: float | None


@dataclass(frozen=True)
class Comparison:
    """What `measure` finds; our program comes first, at its default tolerance, then at the loosest."""

    states: list[PeerFigures]
    sensitivities: list[PeerFigures]
    skipped: dict[str, str]
    versions: dict[str, str]
    reference_difference: float


@dataclass(frozen=True, eq=False)
class Task:
    """States, or states with sensitivities, with samples of pairs for compiled programs and for the others."""

    with_sensitivities: bool
    large: Pairs
    small: Pairs

    def pairs(self, peer: Peer) -> Pairs:
        return self.large if peer.compiled else self.small

    def solve(self, peer: Peer, rtol: float) -> Solution:
        return (peer.sensitivities if self.with_sensitivities else peer.outputs)(self.pairs(peer), rtol)

    def timed(self, peer: Peer, rtol: float) -> tuple[int, Callable[[], object]]:
        return (peer.sensitivities_task if self.with_sensitivities else peer.states_task)(self.pairs(peer), rtol)

    def errors(self, peer: Peer, solution: Solution) -> tuple[Errors, ...]:
        """Errors of y, and those of dy/dtheta where these are asked for."""
        pairs = self.pairs(peer)
        y, dy_dtheta = _reference(self, pairs is self.large)
        of_y = Errors.of(output_errors(solution.y, y))
        if solution.dy_dtheta is None or dy_dtheta is None:
            return (of_y,)
        return of_y, Errors.of(sensitivity_errors(solution.dy_dtheta, dy_dtheta))

    def loosest(self, peer: Peer) -> float:
        return loosest_rtol(lambda rtol: all(map(ACCURACY_RULE.met_by, self.errors(peer, self.solve(peer, rtol)))))


@cache
def tasks(quick: bool) -> tuple[Task, Task]:
    """W1 and W2."""
    states = Task(False, neighbours(3 if quick else 9, seed=1), random_pairs(1 if quick else 8, seed=1))
    sensitivities = Task(True, random_pairs(8 if quick else 64, seed=3), random_pairs(1 if quick else 4, seed=3))
    return states, sensitivities


def neighbours(runs: int, seed: int) -> Pairs:
    """Every candidate with `runs` random runs of `RUN` nodes that follow each other in the grid."""
    points, nodes = candidates(), RULE.nodes(PRIOR)[0]
    rng = np.random.default_rng(seed)
    starts = np.concatenate([rng.choice(len(nodes) // RUN, runs, replace=False) for _ in range(len(points))])
    chosen = (starts[:, None] * RUN + np.arange(RUN)).ravel()
    rows = np.repeat(np.arange(len(points)), runs * RUN)
    return Pairs(points[rows], nodes[chosen], chosen)


@cache
def _reference(task: Task, large: bool) -> tuple[Array, Array | None]:
    pairs = task.large if large else task.small
    if not task.with_sensitivities:
        return fp.simulate(MODEL, pairs.points, pairs.theta, rtol=TIGHT_RTOL).y, None
    result = fp.sensitivities(MODEL, pairs.points, pairs.theta, rtol=TIGHT_RTOL)
    return result.y, result.dy_dtheta


@contextmanager
def one_core() -> Iterator[None]:
    """Keep this process, and the threads that programs start in it, on one core."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def measure(quick: bool, progress: Callable[[str], None]) -> Comparison:
    """Measure every program that is installed; `progress` is told what happens."""
    with one_core():
        peers = [*OURS]
        skipped: dict[str, str] = {}
        versions: dict[str, str] = {}
        for entry in ENTRIES:
            missing = entry.missing()
            if missing is None:
                peers += entry.load()
                versions |= entry.versions()
            else:
                skipped[entry.module] = missing
                progress(f"{entry.module}: left out, for want of it: {missing}")
        check = random_pairs(1, seed=6)
        independent = solve_states(check, TIGHT_RTOL, True, "DOP853")
        ours = fp.simulate(MODEL, check.points, check.theta, rtol=TIGHT_RTOL).y
        states, sensitivities = (
            _measure_task(task, [p for p in peers if p.has_sensitivities or not task.with_sensitivities], quick, progress)
            for task in tasks(quick)
        )
    return Comparison(states, sensitivities, skipped, versions, float(output_errors(ours, independent).max()))


def _measure_task(task: Task, peers: list[Peer], quick: bool, progress: Callable[[str], None]) -> list[PeerFigures]:
    chosen: list[tuple[Peer, float, Solution]] = []
    for peer in peers:
        if peer is peers[0]:
            chosen.append((peer, DEFAULT_RTOL, task.solve(peer, DEFAULT_RTOL)))
        rtol = task.loosest(peer)
        chosen.append((peer, rtol, task.solve(peer, rtol)))
        progress(f"{'sensitivities' if task.with_sensitivities else 'states'}, {peer.name}: rtol {rtol:.1e}")

    timed = [task.timed(peer, rtol) for peer, rtol, _ in chosen]
    best = best_times({str(i): work for i, (_, work) in enumerate(timed)}, 2 if quick else 5)
    figures = []
    for i, (peer, rtol, solution) in enumerate(chosen):
        count, timing = timed[i][0], best[str(i)]
        where = type(peer).__module__, peer.name
        memory = None if quick else fresh_process.call(__name__, memory_of.__name__, *where, rtol, task.with_sensitivities)
        errors = task.errors(peer, solution)[-1]
        sample = len(task.pairs(peer))
        figures.append(PeerFigures(peer.name, rtol, count / timing.seconds, timing.cores, sample, errors, solution.steps, memory))
    return figures


def memory_of(module: str, name: str, rtol: float, with_sensitivities: bool) -> float:
    """Return the MB by which the peak grows when a program is imported, compiled and set to work; for a process of its own."""
    task = tasks(True)[with_sensitivities]
    before = peak_memory()
    peer = next(peer for peer in import_module(module).PEERS if peer.name == name)
    task.timed(peer, rtol)[1]()
    return peak_memory() - before
