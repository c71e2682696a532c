"""What runs are worth by their free numbers: an average over plants of log det F, or of another criterion in its form, less what
runs cost that come near limits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array, IntArray
from ...basics.work_clock import Clock
from ...information.problem import DesignProblem
from ...information.run_information import information_matrices
from ...information.run_tangents import RunTangents, run_tangents, tangents_from
from ...points.run_coordinates import RunCoordinates
from ...points.run_trajectories import checked_run_trajectories
from ...points.runs import Runs
from ...points.settings import Integration
from ...points.status import Status
from ..goal.criteria import Criterion
from ..goal.scenario_average import Average
from .run_margins import RunMargins, costs_of
from .tried_runs import TriedRuns
from .tuning import RunSearchTuning

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Judged:
    """Results of K runs: F (K, R, p, p) on every plant, whether they reach their ends on all (K,), and their costs (K,)."""

    matrices: Array
    ok: NDArray[np.bool_]
    costs: Array

    def some(self, rows: Any) -> Judged:
        return Judged(self.matrices[rows], self.ok[rows], self.costs[rows])

    @staticmethod
    def join(parts: list[Judged]) -> Judged:
        return Judged(*(np.concatenate([getattr(part, name) for part in parts]) for name in ("matrices", "ok", "costs")))


class Lasted(NamedTuple):
    """How far K runs last: segments completed (K,), one more than there are where they are ok, statuses (K,), and plants (K,)."""

    segments: IntArray
    status: IntArray
    plant: NDArray[np.intp]

    @property
    def ok(self) -> NDArray[np.bool_]:
        return np.asarray(self.status == Status.ok)


class RunObjective:
    """An average over plants of log det F, or another criterion, F the sum over L runs, each described by its free numbers, less
    what runs cost.

    Parameters
    ----------
    problem : DesignProblem
    coordinates : RunCoordinates
    plants : ndarray, (R, p)
        Parameters of the model.
    average : Average
        Over these.
    previous : ndarray, (R, p, p)
        Information that is there without the runs.
    criteria : sequence of Criterion
        What is maximised on each plant.
    settings : Integration
        Of the trajectories.
    clock : Clock, optional
        Between parts of its work `OutOfTime` is raised where this says so.
    tuning : RunSearchTuning
        Of the whole search: all of its parts read it here.

    Attributes
    ----------
    kappa : float
        Standard deviations that runs keep from limits of the domain, or pay for; 0 for no costs.
    looks : int
        Times in every segment at which that distance is taken.
    work : int
        Segments of runs on plants that were computed so far, about.
    """

    def __init__(
        self,
        problem: DesignProblem,
        coordinates: RunCoordinates,
        plants: Array,
        average: Average,
        previous: Array,
        criteria: Sequence[Criterion],
        settings: Integration,
        clock: Clock | None = None,
        tuning: RunSearchTuning = RunSearchTuning(),
    ) -> None:
        self.tuning = tuning
        self.clock = Clock(None) if clock is None else clock
        self.problem, self.coordinates, self.plants, self.previous = problem, coordinates, plants, previous
        self.average, self.criteria = average, tuple(criteria)
        self.kappa, self.looks, self.settings = 0.0, tuning.looks_per_segment, settings
        self.margins, self.work = RunMargins(problem, tuning), 0
        native = problem.model.in_core
        self._threads = settings.threads if native else 1  # functions of Python need not bear several threads
        self._rows = (tuning.least_rows_at_once, tuning.most_rows_at_once) if native else (1, 1)
        self._pool = ThreadPoolExecutor(self._threads) if self._threads > 1 else None

    def judged(self, runs: TriedRuns) -> Judged:
        """What runs are worth, each by itself."""

        def part(some: slice) -> Judged:
            own = runs[some]
            return self._judged(self.tangents(own.runs, threads=1), own)

        return Judged.join(self.in_parts(part, len(runs)))

    def judged_beside(self, base: RunTangents, runs: TriedRuns) -> Judged:
        """What runs are worth that differ little from one run, whose tangents with all states are known.

        Each is computed from the segment on where it differs; those that differ about there share the lanes of a pack.
        """
        differ = runs.runs.first_difference(base.runs, np.zeros(len(runs), dtype=np.intp))
        order = np.argsort(differ, kind="stable")
        runs = runs[order]

        def part(some: slice) -> Judged:
            own = runs[some]
            many, theta = self.on_plants(own.runs)
            lanes = np.repeat(np.arange(len(self.plants)), len(own))
            settings = self.settings._replace(threads=1)
            there = tangents_from(self.problem, base, lanes, many, theta, settings, outputs_alone=not self.costly)
            return self._judged(there, own)

        return Judged.join(self.in_parts(part, len(runs))).some(np.argsort(order))

    def rows(self, runs: Runs) -> Array:
        """Whitened rows (R, K, m, p) of runs, each by itself; of many samples p rows with the same information."""

        def part(some: slice) -> Array:
            of_all = self.tangents(runs[some], threads=1).rows(self.problem).sensitivity
            white = of_all / np.sqrt(np.diag(self.problem.noise_covariance))[:, None]
            white = white.reshape(len(self.plants), -1, white.shape[1] * white.shape[2], white.shape[3])
            return white if self.coordinates.clock is None else np.asarray(np.linalg.qr(white, mode="r"))

        return np.concatenate(self.in_parts(part, len(runs)), axis=1)

    def sample_matrices(self, runs: Runs) -> Array:
        """F (L, N, R, p, p) of the samples of runs, each by itself."""
        sensitivity = self.tangents(runs).rows(self.problem).sensitivity
        f = information_matrices(self.problem, sensitivity.reshape(-1, 1, *sensitivity.shape[2:]))
        return np.moveaxis(f.reshape(len(self.plants), *runs.dt.shape, *f.shape[1:]), 0, 2)

    def chosen_matrices(self, tangents: RunTangents, run: int, count: int, flags: NDArray[np.bool_]) -> Array:
        """F (T, R, p, p) of one of `count` runs, whose tangents are given, where it measures samples `flags` (T, N) alone."""
        lanes = np.tile(run + count * np.arange(len(self.plants)), len(flags))
        informative = np.repeat(flags, len(self.plants), axis=0)[..., None]
        rows = tangents.some(lanes).rows(self.problem, informative)
        f = information_matrices(self.problem, rows.sensitivity)
        return f.reshape(len(flags), len(self.plants), *f.shape[1:])

    def averages(self, total: Array) -> Array:
        """The average over the plants of log det of F (..., R, p, p), or of another criterion in its form.

        -inf where an F that counts is singular, or does not determine the criterion.
        """
        return self.average.value(np.stack([one.objectives(total[..., s, :, :]) for s, one in enumerate(self.criteria)]))

    def of(self, judged: Judged) -> float:
        """The criterion of runs together, less their costs."""
        if not judged.ok.all():
            return -np.inf
        return float(self.averages(judged.matrices.sum(axis=0) + self.previous)) - float(judged.costs.sum())

    def values(self, z: Array, selected: NDArray[np.bool_] | None = None) -> Array:
        """The criterion less costs (T,) of T designs of L runs, of free numbers (T, L, d); `selected` (L, N) samples count."""
        designs, runs = z.shape[:2]
        flags = None if selected is None else np.tile(selected, (designs, 1))
        judged = self.judged(self.tried(z.reshape(designs * runs, -1), flags))
        f = judged.matrices.reshape(designs, runs, *judged.matrices.shape[1:]).sum(axis=1)
        values = self.averages(f + self.previous) - judged.costs.reshape(designs, runs).sum(axis=1)
        return np.where(judged.ok.reshape(designs, runs).all(axis=1), values, -np.inf)

    def tried(self, z: Array, selected: NDArray[np.bool_] | None, counts: NDArray[np.intp] | None = None) -> TriedRuns:
        """Runs with free numbers z (K, d), which measure the `selected` (K, N) samples, in as short segments as costs need.

        Those with a period of samples measure the first `counts` (K,) of these, all by default.
        """
        held = self.coordinates.held(z)
        held = held if selected is None else held.measuring(selected)
        held = held.divided(np.arange(1, self.looks + 1) / self.looks) if self.costly else held
        return TriedRuns(*self.coordinates.sampled(held, counts))

    @property
    def costly(self) -> bool:
        """Whether runs pay for coming near limits."""
        return self.kappa > 0 and self.margins.exist

    def in_parts(self, function: Callable[[slice], T], count: int, kind: str = "tangents") -> list[T]:
        """What a function makes of each part of `count` runs; no run's result depends on the others of its part."""
        clock = self.clock
        self.work += count * len(self.plants) * self.coordinates.segments
        least, most = (-(-rows // len(self.plants)) for rows in self._rows)
        each = min(max(-(-count // self._threads), least), most)
        if self.coordinates.clock is not None:
            parts_of_run = self.coordinates.parts(self.looks if self.costly else 1) * len(self.plants)
            each = min(each, max(1, self.tuning.most_parts_at_once // parts_of_run))
        lanes = len(self.plants)
        each = min(each, clock.size(kind, lanes, least=self.tuning.least_runs_at_once)) if clock.measures else each
        ahead = clock.cost(kind, each * lanes)
        parts = [slice(first, min(first + each, count)) for first in range(0, count, each)]

        def timed(some: slice) -> T:
            clock.check_in_thread(ahead)
            began = clock.seconds if clock.measures else 0.0
            found = function(some)
            if clock.measures:
                clock.measured(kind, (some.stop - some.start) * lanes, clock.seconds - began)
            return found

        def reported(found: T) -> T:
            clock.report()
            return found

        if self._pool is None or len(parts) == 1:
            return [reported(timed(part)) for part in parts]
        waiting = [self._pool.submit(timed, part) for part in parts]
        try:
            return [reported(one.result()) for one in waiting]
        except BaseException:
            for one in waiting:
                one.cancel()
            raise

    def lasted(self, z: Array) -> Lasted:
        """How far runs with free numbers z (K, d) come on the plant on which they end first."""

        def part(some: slice) -> Lasted:
            runs = self.coordinates.held(z[some])
            many, theta = self.on_plants(runs)
            assumed = self.problem.assumed
            model = self.problem.limited if assumed is None else assumed.model
            values = theta if assumed is None else assumed.theta(theta)
            done = checked_run_trajectories(model, many, values, self.settings._replace(threads=1))
            ends = np.where(done.status == Status.ok, runs.dt.shape[1] + 1, np.minimum(done.reached, runs.dt.shape[1]))
            ends, status = (array.reshape(len(self.plants), -1) for array in (ends, done.status))
            first, each = np.argmin(ends, axis=0), np.arange(len(runs))
            return Lasted(ends[first, each], status[first, each], first)

        parts = self.in_parts(part, len(z), "states")
        return Lasted(*(np.concatenate([one[k] for one in parts]) for k in range(3)))

    def on_plants(self, runs: Runs) -> tuple[Runs, Array]:
        """The runs on every plant, plant after plant, and the parameters of each."""
        count = len(runs)
        many = runs[np.tile(np.arange(count), len(self.plants))] if len(self.plants) > 1 else runs
        return many, np.repeat(self.plants, count, axis=0)

    def tangents(self, runs: Runs, outputs_alone: bool | None = None, threads: int | None = None) -> RunTangents:
        """Tangents of runs on every plant, plant after plant."""
        many, theta = self.on_plants(runs)
        alone = not self.costly if outputs_alone is None else outputs_alone
        settings = self.settings._replace(threads=threads or self.settings.threads)
        return run_tangents(self.problem, many, theta, settings, outputs_alone=alone)

    def distances(self, tangents: RunTangents, own: TriedRuns) -> Array:
        """Distances to limits of runs on every plant, plant after plant, by their tangents."""
        return self.margins.distances(tangents, None if own.looks is None else np.tile(own.looks, (len(self.plants), 1)))

    def _judged(self, tangents: RunTangents, own: TriedRuns) -> Judged:
        """Judge runs by their tangents, plant after plant."""
        plants, count = len(self.plants), len(own)
        rows = tangents.rows(self.problem)
        f = information_matrices(self.problem, rows.sensitivity)
        costs = np.zeros(len(f))
        if self.costly:
            costs = costs_of(self.distances(tangents, own), self.kappa, self.tuning.ascent.distance_cost)
        return Judged(
            f.reshape(plants, count, *f.shape[1:]).swapaxes(0, 1),
            (rows.status.reshape(plants, count) == Status.ok).all(axis=0),
            costs.reshape(plants, count).mean(axis=0),
        )
