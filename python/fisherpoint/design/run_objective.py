"""log det of the information in runs as a function of their free numbers, and its gradient.

The gradient is taken by central differences, all of them in one batch: second derivatives of trajectories would cost as much as
the differences do. A run whose input changes in segment n is the same up to there, so it goes on from the state and the
sensitivities at its start: half of the segments need not be computed again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array
from ..information.problem import DesignProblem
from ..information.run_information import information_matrices
from ..information.run_tangents import RunTangents, run_tangents, tangents_from
from ..points.run_region import RunCoordinates
from ..points.runs import Runs
from ..points.settings import Settings
from ..points.status import Status
from .run_margins import RunMargins

STEP = 1e-3
"""Of a free number, for differences."""

LOOKS, MORE_LOOKS = 2, 4
"""Times in every segment at which the distance to limits is taken, and where that has not been enough."""

MOST_SEGMENTS = 100_000
"""Of runs that are computed at once, so that memory stays bounded."""


class Value(NamedTuple):
    """The criterion less costs; and the gradient by the free numbers. -inf where a run does not reach its end."""

    value: float
    gradient: Array


@dataclass(frozen=True, eq=False)
class Judged:
    """Of K runs: F (K, R, p, p) on every plant, whether they reach their ends on all (K,), and their costs (K,)."""

    matrices: Array
    ok: NDArray[np.bool_]
    costs: Array

    def some(self, rows: Any) -> Judged:
        return Judged(self.matrices[rows], self.ok[rows], self.costs[rows])

    @staticmethod
    def join(parts: list[Judged]) -> Judged:
        return Judged(*(np.concatenate([getattr(part, name) for part in parts]) for name in ("matrices", "ok", "costs")))


class RunObjective:
    """The mean over plants of log det F, F the sum over L runs, each described by its free numbers, less what runs cost.

    Parameters
    ----------
    problem : DesignProblem
    coordinates : RunCoordinates
    plants : ndarray, (R, p)
        Parameters of the model.
    previous : ndarray, (R, p, p)
        Information that is there without the runs.
    settings : Settings
        Of the trajectories.

    Attributes
    ----------
    kappa : float
        Standard deviations that runs keep from limits of the domain, or pay for; 0 for no costs.
    looks : int
        Times in every segment at which that distance is taken.
    evaluations : int
        Runs that were computed, or parts of them.
    """

    def __init__(
        self, problem: DesignProblem, coordinates: RunCoordinates, plants: Array, previous: Array, settings: Settings
    ) -> None:
        self.problem, self.coordinates, self.plants, self.previous = problem, coordinates, plants, previous
        self.kappa, self.looks, self.evaluations = 0.0, LOOKS, 0
        self.settings, self._margins = settings, RunMargins(problem)

    def judged(self, runs: Runs) -> Judged:
        """What runs are worth, each by itself."""
        return Judged.join([self._judged(self._tangents(runs[some]), len(runs[some])) for some in self._blocks(*runs.dt.shape)])

    def sample_matrices(self, runs: Runs) -> Array:
        """F (L, N, R, p, p) of the samples of runs, each by itself."""
        sensitivity = self._tangents(runs).rows(self.problem).sensitivity
        f = information_matrices(self.problem, sensitivity.reshape(-1, 1, *sensitivity.shape[2:]))
        return np.moveaxis(f.reshape(len(self.plants), *runs.dt.shape, *f.shape[1:]), 0, 2)

    def log_dets(self, total: Array) -> Array:
        """The mean over the plants of log det of F (..., R, p, p); -inf where one is singular."""
        sign, value = np.linalg.slogdet(total)
        return np.asarray(np.where(sign > 0, value, -np.inf).mean(axis=-1))

    def of(self, judged: Judged) -> float:
        """The criterion of runs together, less their costs."""
        if not judged.ok.all():
            return -np.inf
        return float(self.log_dets(judged.matrices.sum(axis=0) + self.previous)) - float(judged.costs.sum())

    def value_and_gradient(self, z: Array, selected: NDArray[np.bool_] | None = None, central: bool = True) -> Value:
        """The criterion less costs and its gradient (L, d) at free numbers (L, d); `selected` (L, N) are the samples that count.

        Without `central` differences the gradient costs half as much, and is exact to a step only.
        """
        count, plants = len(z), len(self.plants)
        base = self.tried(z, selected)
        along = self._tangents(base, outputs_alone=False)
        at = self._judged(along, count)
        gradient, value = np.zeros(z.shape), self.of(at)
        if not np.isfinite(value):
            return Value(-np.inf, gradient)
        total = at.matrices.sum(axis=0) + self.previous
        run, number = np.nonzero(np.broadcast_to(self.coordinates.stepped == 0, z.shape))
        here = z[run, number]
        ends = np.stack([np.minimum(here + STEP, 1.0), np.maximum(here - STEP, 0.0)], axis=1)
        if not central:  # to the side where there is room
            ends = np.where(here < 0.5, ends[:, 0], ends[:, 1])[:, None]
        sides = ends.shape[1]
        change = np.zeros(ends.shape)
        for some in self._blocks(len(run), sides * base.dt.shape[1]):
            moved = np.repeat(z[run[some]], sides, axis=0)
            moved[np.arange(len(moved)), np.repeat(number[some], sides)] = ends[some].ravel()
            own = np.repeat(run[some], sides)
            many, theta = self._on_plants(self.tried(moved, None if selected is None else selected[own]))
            lanes = (own[:, None] + count * np.arange(plants)).T.ravel()  # of `along`, plant after plant
            tangents = tangents_from(self.problem, along, lanes, many, theta, self.settings, outputs_alone=not self._costly)
            there = self._judged(tangents, len(own))
            difference = np.trace(np.linalg.solve(total, there.matrices - at.matrices[own]), axis1=-2, axis2=-1).mean(axis=1)
            difference -= there.costs - at.costs[own]
            difference[~there.ok] = np.nan
            change[some] = difference.reshape(-1, sides)
        self.evaluations += sides * len(run)
        # Where one side cannot be run, the other one tells.
        steps, lost = ends - here[:, None], np.isnan(change)
        change[lost], steps[lost] = 0.0, 0.0
        span, rise = (steps[:, 0], change[:, 0]) if sides == 1 else (steps[:, 0] - steps[:, 1], change[:, 0] - change[:, 1])
        gradient[run, number] = np.divide(rise, span, out=np.zeros(len(run)), where=span != 0)
        return Value(value, gradient)

    def tried(self, z: Array, selected: NDArray[np.bool_] | None) -> Runs:
        """Runs with free numbers z (K, d), which measure the `selected` (K, N) samples, in as short segments as costs need."""
        runs = self.coordinates.runs(z)
        runs = runs if selected is None else runs.measuring(selected)
        return runs.divided(self.looks) if self._costly else runs

    @property
    def _costly(self) -> bool:
        return self.kappa > 0 and self._margins.exist

    def _blocks(self, count: int, segments: int) -> list[slice]:
        each = max(1, MOST_SEGMENTS // (segments * len(self.plants)))
        return [slice(first, first + each) for first in range(0, count, each)]

    def _on_plants(self, runs: Runs) -> tuple[Runs, Array]:
        """The runs on every plant, plant after plant, and the parameters of each."""
        count = len(runs)
        many = runs[np.tile(np.arange(count), len(self.plants))] if len(self.plants) > 1 else runs
        return many, np.repeat(self.plants, count, axis=0)

    def _tangents(self, runs: Runs, outputs_alone: bool | None = None) -> RunTangents:
        self.evaluations += len(runs)
        many, theta = self._on_plants(runs)
        alone = not self._costly if outputs_alone is None else outputs_alone
        return run_tangents(self.problem, many, theta, self.settings, outputs_alone=alone)

    def _judged(self, tangents: RunTangents, count: int) -> Judged:
        """Of tangents of `count` runs, plant after plant."""
        plants = len(self.plants)
        rows = tangents.rows(self.problem)
        f = information_matrices(self.problem, rows.sensitivity)
        costs = self._margins.costs(tangents, self.kappa) if self._costly else np.zeros(len(f))
        return Judged(
            f.reshape(plants, count, *f.shape[1:]).swapaxes(0, 1),
            (rows.status.reshape(plants, count) == Status.ok).all(axis=0),
            costs.reshape(plants, count).mean(axis=0),
        )
