"""Points of a design in the region: local maxima of the sensitivity function join the candidates until none exceeds its level."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.quantity import names_of
from ..basics.values import Array, IntArray
from ..points.experiments import Experiments
from ..points.region import ExperimentRegion
from .ascents import ascend
from .candidate_rows import CandidateRows
from .criteria import Criterion
from .point_rows import PointRows
from .weights import Weights, optimal_weights

ABOVE = 1e-3
"""By which share of its level the sensitivity function may be exceeded by what the ascents from many starts find."""

MOST_ROUNDS, MOST_SEARCHES = 25, 6

CLOSE = 1e-6
"""The rounds end where no maximum near the support exceeds the level by more than this share."""

RADII = (0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)
"""Shares of the region's width within which points of the support are merged, where that costs nothing."""

MERGING_COSTS = 1e-6
"""Most that log phi may lose by merging."""

NEAR, FAR = 40, 60
"""Candidates with a large sensitivity from which ascents start in each round, and iterations of an ascent."""


class Refinement(NamedTuple):
    """The support, its rows and weights; candidates and starts that the sensitivity function was followed from."""

    points: Experiments
    rows: Array
    weights: Weights
    n_candidates: int
    starts: int


class _Box:
    """The region's coordinates that are free, as a unit box."""

    def __init__(self, source: PointRows) -> None:
        region, self.model = source.problem.region, source.problem.model
        assert isinstance(region, ExperimentRegion)
        self.source = source
        self.lower, self.upper = np.array([region.bounds[name] for name in names_of(self.model.axes)]).T
        self.free = np.flatnonzero(self.upper > self.lower)

    def points(self, z: Array) -> Experiments:
        table = np.tile(self.lower, (len(z), 1))
        table[:, self.free] += z * (self.upper - self.lower)[self.free]
        return Experiments.of_table(self.model, np.clip(table, self.lower, self.upper))

    def places(self, points: Experiments) -> Array:
        table = points.table[:, : len(self.lower)]
        return np.clip(((table - self.lower)[:, self.free]) / (self.upper - self.lower)[self.free], 0.0, 1.0)

    @property
    def difference(self) -> float:
        """Half the distance of central differences: trajectories are known to the tolerance only."""
        return 1e-4 if not self.model.states else float(np.clip(0.3 * np.cbrt(self.source.problem.rtol), 1e-4, 3e-3))


class _Refining:
    def __init__(self, source: PointRows, points: Experiments, pool: CandidateRows, asked: Criterion, weights: Weights) -> None:
        self.box, self.source, self.asked = _Box(source), source, asked
        self.points, self.pool, self.weights = points, pool, weights
        self.space = weights.estimable

    def psi(self, z: Array, on_nodes: bool = False) -> Array:
        """tr(G F(z)), (K,); -inf where a place is no valid point."""
        result = np.full(len(z), -np.inf)
        rows, places = (self.source.valid if on_nodes else self.source.at_mean)(self.box.points(z))
        result[places] = CandidateRows(rows, self.pool.constant).along(self.weights.half)
        return result

    def peaks(self, start: Array) -> tuple[Array, Array]:
        """Where ascents end, and the sensitivity there, of points that are valid on all nodes."""
        z, value = ascend(self.psi, start, self.box.difference, FAR)
        worth = np.flatnonzero(value > 1.0 - ABOVE)
        outside = worth[~np.isfinite(self.psi(z[worth], True))]
        if len(outside):  # the mean alone does not show where the prior's plants end: these ascents look at all of them
            z[outside], value[outside] = ascend(lambda x: self.psi(x, True), start[outside], self.box.difference, FAR)
        return z, value

    def solve(self, tolerance: float) -> None:
        self.weights = optimal_weights(self.pool, self.asked, tolerance=tolerance, space=self.space)

    def add(self, z: Array) -> None:
        points = self.box.points(z)
        rows, places = self.source.valid(points)
        self.points = Experiments.join([self.points, points[places]])
        self.pool = CandidateRows(np.concatenate([self.pool.rows, rows]), self.pool.constant)

    def settle(self, tolerance: float) -> None:
        """Add the maxima near the support and near good candidates until none is above the level."""
        for _ in range(MOST_ROUNDS):
            along = self.pool.along(self.weights.half)
            good = np.argsort(-along)[:NEAR]
            start = self.box.places(self.points[np.union1d(self.weights.chosen, good)])
            z, value = self.peaks(start)
            above = value > 1.0 + min(CLOSE, 10 * tolerance)
            if not above.any():
                return
            self.add(_distinct(z[above], value[above], 1e-6))
            self.solve(tolerance)

    def merged(self, tolerance: float) -> tuple[Experiments, Array, Weights]:
        """The support with points that lie close together taken for one, as far as that costs nothing."""
        chosen, w = self.weights.chosen, self.weights.weights
        z, best = self.box.places(self.points[chosen]), (self.points[chosen], self.pool.rows[chosen], self.weights)
        for radius in RADII:
            group = _groups(z, radius)
            if group.max() + 1 == len(z):
                break
            centre = np.array([np.average(z[group == k], axis=0, weights=w[group == k]) for k in range(group.max() + 1)])
            snapped = np.where(centre < 1e-7, 0.0, np.where(centre > 1 - 1e-7, 1.0, centre))
            points = self.box.points(snapped)
            rows, places = self.source.valid(points)
            if len(places) < len(points):
                continue
            some = self._weights_of(rows, tolerance)
            if some is not None and some.log_phi >= self.weights.log_phi - MERGING_COSTS:
                return points[some.chosen], rows[some.chosen], some
        return best

    def _weights_of(self, rows: Array, tolerance: float) -> Weights | None:
        try:
            return optimal_weights(CandidateRows(rows, self.pool.constant), self.asked, tolerance=tolerance, space=self.space)
        except np.linalg.LinAlgError:
            return None


def refined(
    source: PointRows,
    points: Experiments,
    pool: CandidateRows,
    asked: Criterion,
    weights: Weights,
    starts: int,
    tolerance: float,
    rng: np.random.Generator,
) -> Refinement:
    """Move the support in the region until ascents from so many starts meet nothing above the level.

    The bound of the efficiency is by the largest sensitivity among all candidates and wherever an ascent has ended.
    """
    work = _Refining(source, points, pool, asked, weights)
    if not len(work.box.free):
        return Refinement(points[weights.chosen], pool.rows[weights.chosen], weights, len(pool), 0)
    for search in range(MOST_SEARCHES):
        work.settle(tolerance)
        support, rows, final = work.merged(tolerance)
        # What bounds the optimum is the sensitivity function of the merged design where that has one, else the candidates'.
        slope = work.weights.log_bound - float(np.log(work.weights.largest))
        if final is not work.weights and np.isfinite(final.log_phi) and final.largest <= 1 + 10 * tolerance:
            work.weights, slope = final, final.log_bound - float(np.log(final.largest))
        along = work.pool.along(work.weights.half)
        first = _starts(work, support, along, starts, rng)
        z, value = work.peaks(first)
        largest = max(float(along.max()), float(value[np.isfinite(value)].max(initial=0.0)))
        if largest <= 1.0 + ABOVE or search == MOST_SEARCHES - 1:
            break
        above = value > 1.0 + CLOSE
        work.add(_distinct(z[above], value[above], 1e-6))
        work.solve(tolerance)
    log_bound = slope + float(np.log(largest))
    half = work.weights.half
    count = len(final.chosen)
    proven = Weights(
        np.arange(count), final.weights, half, largest, float(np.exp(min(final.log_phi - log_bound, 0.0))), final.log_phi, log_bound,
        final.estimable, weights.deleted, final.rounds,
    )  # fmt: skip
    return Refinement(support, rows, proven, len(work.pool), len(first))


def _starts(work: _Refining, support: Experiments, along: Array, count: int, rng: np.random.Generator) -> Array:
    """The support, the best candidates, and others at random, as places."""
    best = np.argsort(-along)[: count // 4]
    others = rng.permutation(np.setdiff1d(np.arange(len(along)), best))[: max(0, count - len(best))]
    places = work.box.places(Experiments.join([support, work.points[np.concatenate([best, others])]]))
    while len(places) < count:  # fewer candidates than starts: each is begun from again, a little beside
        more = places[rng.integers(len(places), size=count - len(places))]
        places = np.concatenate([places, np.clip(more + 0.05 * rng.standard_normal(more.shape), 0.0, 1.0)])
    return places


def _distinct(z: Array, value: Array, radius: float) -> Array:
    """Of places closer than a radius to each other, that of the largest value."""
    kept: list[IntArray] = []
    for k in np.argsort(-value):
        if all(np.abs(z[k] - z[other]).max() > radius for other in kept):
            kept.append(k)
    return z[np.array(kept, dtype=int)]


def _groups(z: Array, radius: float) -> NDArray[np.intp]:
    """Numbers (m,) of groups of places that hang together within a radius."""
    group = np.arange(len(z))
    near = np.abs(z[:, None] - z[None]).max(axis=2) <= radius
    for _ in range(len(z)):
        smallest = np.where(near, group[None], len(z)).min(axis=1)
        if (smallest == group).all():
            break
        group = smallest
    return np.unique(group, return_inverse=True)[1]
