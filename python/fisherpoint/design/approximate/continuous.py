"""Points of a design in the region: maxima of the sensitivity function join the candidates until none is met above its level.

Ascents from the support and from good candidates find maxima, which get weights with the others. Then points of the support that
lie close together are merged and moved, as far as that costs nothing. Climbs at random and ascents from many starts search for
places above the level; what they find joins the candidates, and where they find nothing the search ends. `RegionTuning` has the
numbers.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ...information.point_information import PointInformation
from ...points.experiments import Experiments
from ..candidates.candidate_rows import CandidateRows, Places
from ..candidates.point_rows import PointRows
from ..goal.criteria import Criterion
from ..goal.determinant import Determinant
from ..goal.estimable_space import Estimable
from ..goal.variance import Variance
from ..weights.tuning import WeightsTuning
from ..weights.weights import Weights, optimal_weights
from .ascents import ascend, newton
from .elfving import moved, smallest_sum
from .tuning import RegionTuning


class UnitBox:
    """The region's coordinates that are free, as a unit box."""

    def __init__(self, source: PointRows) -> None:
        region, self.model = source.problem.point_region, source.problem.model
        self.source = source
        self.lower, self.upper = region.box(self.model)
        self.free = np.flatnonzero(self.upper > self.lower)

    def points(self, z: Array) -> Experiments:
        table = np.tile(self.lower, (len(z), 1))
        table[:, self.free] += z * (self.upper - self.lower)[self.free]
        return Experiments.of_table(self.model, np.clip(table, self.lower, self.upper))

    def places(self, points: Experiments) -> Array:
        table = points.table[:, : len(self.lower)]
        return np.asarray(np.clip((table - self.lower)[:, self.free] / (self.upper - self.lower)[self.free], 0.0, 1.0))

    @property
    def difference(self) -> float:
        """Half the distance of central differences: trajectories are known to the tolerance only."""
        return 1e-5 if not self.model.states else float(np.clip(0.3 * np.cbrt(self.source.problem.rtol), 1e-4, 3e-3))


def distinct(z: Array, value: Array, radius: float) -> Array:
    """Places without those closer than a radius to one with a larger value."""
    kept: list[int] = []
    for k in np.argsort(-value):
        if all(np.abs(z[k] - z[other]).max() > radius for other in kept):
            kept.append(int(k))
    return np.asarray(z[np.array(kept, dtype=np.intp)])


def groups_within(z: Array, radius: float) -> NDArray[np.intp]:
    """Numbers (m,) of groups of places that hang together within a radius."""
    group = np.arange(len(z))
    near = np.abs(z[:, None] - z[None]).max(axis=2) <= radius
    for _ in range(len(z)):
        smallest = np.where(near, group[None], len(z)).min(axis=1)
        if (smallest == group).all():
            break
        group = smallest
    return np.unique(group, return_inverse=True)[1]


Climb = Callable[[Callable[[PointInformation], Array], Experiments], Experiments]
"""Moves points uphill: takes the function to climb, (K,) of points valid at the prior mean, and starts; returns where they end."""


class Refinement(NamedTuple):
    """The support, its rows and weights; candidates and starts that the sensitivity function was followed from."""

    points: Experiments
    rows: Array
    weights: Weights
    n_candidates: int
    starts: int


class _Support(NamedTuple):
    """Points with their rows and weights; `chosen` counts within them where they were weighed alone."""

    points: Experiments
    rows: Array
    weights: Weights


class _Refining:
    def __init__(
        self,
        source: PointRows,
        points: Experiments,
        pool: CandidateRows,
        criterion: Criterion,
        weights: Weights,
        report: Callable[[str, int], None],
        tuning: RegionTuning,
    ) -> None:
        self.report, self.tuning = report, tuning
        self.box, self.source, self.criterion = UnitBox(source), source, criterion
        self.points, self.pool, self.weights = points, pool, weights
        self.space = weights.estimable

    def psi(self, z: Array, on_nodes: bool = False) -> Array:
        """tr(G F(z)), (K,); -inf where a place is no valid point."""
        result = np.full(len(z), -np.inf)
        rows, places = (self.source.valid if on_nodes else self.source.at_mean)(self.box.points(z))
        result[places] = self._along(rows)
        return result

    def _along(self, rows: Array) -> Array:
        return CandidateRows(rows, self.pool.constant).along(self.weights.half)

    def climbed(self, climb: Climb, start: Experiments) -> tuple[Array, Array]:
        """Where points have climbed to, some from the start, and the sensitivity there; again while none is above the level."""
        z, value = np.empty((0, len(self.box.free))), np.empty(0)
        for _ in range(self.tuning.quiet_climbs):
            self.report("searching", len(self.pool))
            reached = self.box.places(climb(lambda points: self._along(self.source.whitened(points)), start))
            z, value = np.concatenate([z, reached]), np.append(value, self.psi(reached, True))
            if value.max(initial=0.0) > 1.0 + self.tuning.above:
                break
        return z, value

    def peaks(self, start: Array, iterations: int) -> tuple[Array, Array]:
        """Where ascents end, and the sensitivity there, of points that are valid on all nodes."""
        z, value = ascend(self.psi, start, self.box.difference, iterations, self.tuning)
        worth = np.flatnonzero(value > 1.0 - self.tuning.above)
        outside = worth[~np.isfinite(self.psi(z[worth], True))]
        if len(outside):  # the mean alone does not show where the prior's plants end: back on the way, to where all of them run
            back = np.array(self.tuning.back_shares)
            tried = start[outside, None] + back[None, :, None] * (z[outside] - start[outside])[:, None]
            values = self.psi(tried.reshape(-1, z.shape[1]), True).reshape(len(outside), -1)
            best = values.argmax(axis=1)
            z[outside], value[outside] = tried[np.arange(len(outside)), best], values[np.arange(len(outside)), best]
        return z, value

    def solve(self, tolerance: float) -> None:
        self.report("weighing", len(self.pool))
        first = None
        if isinstance(self.criterion, Determinant) and self.criterion.whole:  # optima of others may be singular, which is no start
            latest = np.arange(max(0, len(self.pool) - self.tuning.latest_candidates), len(self.pool))
            first = np.union1d(self.weights.chosen, latest)
        new = optimal_weights(self.pool, self.criterion, tolerance=tolerance, space=self.space, first=first)
        if new.log_phi >= self.weights.log_phi - tolerance:  # what was found before is among the candidates still
            self.weights = new

    def add(self, z: Array) -> None:
        points = self.box.points(z)
        rows, places = self.source.valid(points)
        self.points = Experiments.join([self.points, points[places]])
        self.pool = CandidateRows(np.concatenate([self.pool.rows, rows]), self.pool.constant)

    def add_new(self, z: Array, value: Array) -> bool:
        """Add those places that no candidate is at already; whether there are any."""
        places = distinct(z, value, self.tuning.same_place)
        known = self.box.places(self.points)
        new = np.array([np.abs(known - one).max(axis=1).min() > self.tuning.same_place for one in places])
        if new.any():
            self.add(places[new])
        return bool(new.any())

    def settle(self, tolerance: float) -> None:
        """Add the maxima near the support and near good candidates until none is above the level."""
        highest = np.inf
        for k in range(self.tuning.most_rounds):
            along = self.pool.along(self.weights.half)
            good = np.argsort(-along)[: self.tuning.ascents_per_round]
            start = self.box.places(self.points[np.union1d(self.weights.chosen, good)])
            z, value = self.peaks(start, self.tuning.round_iterations)
            above = value > 1.0 + min(self.tuning.close, 10 * tolerance)
            if k % 3 == 0:
                if value.max() - 1.0 > 0.5 * highest:  # no closer than three rounds ago
                    return
                highest = value.max() - 1.0
            if not above.any() or not self.add_new(z[above], value[above]):
                return
            self.solve(tolerance)

    def bounding(self, own: Weights) -> tuple[Weights, float]:
        """Whose sensitivity function bounds the optimum better over all candidates, and its largest value there.

        That of the support's own weights, or that of the candidates' where those do not determine all parameters well.
        """
        found = []
        for one in (own, self.weights):
            largest = float(self.pool.along(one.half).max())
            found.append((one.log_bound - np.log(one.largest) + np.log(largest), one, largest))
        own_bound, others = found
        return own_bound[1:] if own_bound[0] <= others[0] + self.tuning.merging_loss else others[1:]

    def merged(self, tolerance: float) -> _Support:
        """The support with points that lie close together taken for one, as far as that costs nothing."""
        if (of_function := self._of_function()) is not None:
            return of_function
        chosen, w = self.weights.chosen, self.weights.weights
        z, best = self.box.places(self.points[chosen]), _Support(self.points[chosen], self.pool.rows[chosen], self.weights)
        tuning = self.tuning
        for radius in tuning.merge_radii:
            group = groups_within(z, radius)
            if group.max() + 1 == len(z):
                break
            centre = np.array([np.average(z[group == k], axis=0, weights=w[group == k]) for k in range(group.max() + 1)])
            snapped = np.where(centre < 1e-7, 0.0, np.where(centre > 1 - 1e-7, 1.0, centre))
            points = self.box.points(snapped)
            rows, places = self.source.valid(points)
            if len(places) < len(points):
                continue
            some = self._weights_of(points, rows, tolerance)
            if some.weights.log_phi >= self.weights.log_phi - tuning.worth_polishing:
                some = self._polished(some, tolerance)
                if some.weights.log_phi >= self.weights.log_phi - tuning.merging_loss:
                    return some
        return self._polished(best, tolerance)

    def _of_function(self) -> _Support | None:
        """The support by Elfving's theorem, where it holds: of the fewest points that do not lose anything; None elsewhere."""
        criterion, pool, tuning = self.criterion, self.pool, self.tuning
        if (
            not (isinstance(criterion, Variance) and criterion.k.shape[1] == 1 and pool.rows.shape[1] == 1)
            or pool.constant is not None
        ):
            return None
        inner = criterion.within(self.space)
        assert isinstance(inner, Variance)
        c = inner.k[:, 0]
        program = self._program(c)
        if program is None:
            return None
        near, b, _ = program
        z = self.box.places(self.points[near])
        for radius, least in itertools.product((*tuning.merge_radii, 0.0), (tuning.least_held, 0.0)):
            group = groups_within(z, radius)
            numbers = [k for k in range(int(group.max()) + 1) if abs(b[group == k].sum()) > least * np.abs(b).sum()]
            if any(np.ptp(np.sign(b[group == k])) for k in numbers):
                continue
            of = np.array([b[group == k].sum() for k in numbers])
            centre = np.array([np.average(z[group == k], axis=0, weights=np.abs(b[group == k])) for k in numbers])
            found = moved(self._rows_inside, centre, of, c, self.box.difference)
            if found is None or -2 * np.log(np.abs(found[1]).sum()) < self.weights.log_phi - tuning.merging_loss:
                continue
            self.add_new(found[0], np.ones(len(found[0])))
            again = self._program(c)
            support = None if again is None else self._by_sums(found[0], found[1], again[2], inner)
            if support is not None:
                return support
        return None

    def _program(self, c: Array) -> tuple[Places, Array, Array] | None:
        """Candidates with a part in the smallest sum, their parts, and the plane that proves it among candidates."""
        along = self.pool.along(self.weights.half)
        near = np.union1d(self.weights.chosen, np.argsort(-along, kind="stable")[: self.tuning.program_candidates])
        found = smallest_sum(self.pool.rows[near, 0] @ self.space.into, c)
        if found is None:
            return None
        b, y = found
        return near[b != 0], b[b != 0], y

    def _rows_inside(self, z: Array) -> Array | None:
        rows, places = self.source.at_mean(self.box.points(z))
        return rows[:, 0] @ self.space.into if len(places) == len(z) else None

    def _by_sums(self, z: Array, b: Array, y: Array, inner: Variance) -> _Support | None:
        """Points with the weights |b| / sum |b|, and the bound by a plane y that is moved to touch Elfving's set at them."""
        points = self.box.points(z)
        rows, places = self.source.valid(points)
        if len(places) < len(points):
            return None
        weights, flat = np.abs(b) / np.abs(b).sum(), rows[:, 0] @ self.space.into
        log_phi = inner.log_phi((flat * weights[:, None]).T @ flat)
        if not np.isfinite(log_phi):
            return None
        conditions, wanted, h = [flat], [np.sign(b)], self.box.difference
        for k in range(z.shape[1]):  # the sensitivity function is flat where a point could move
            free = np.flatnonzero((z[:, k] > h) & (z[:, k] < 1 - h))
            step = h * (np.arange(z.shape[1]) == k)
            below, above = self._rows_inside(z[free] - step), self._rows_inside(z[free] + step)
            if len(free) and below is not None and above is not None:
                conditions.append((above - below) / (2 * h))
                wanted.append(np.zeros(len(free)))
        a = np.concatenate(conditions)
        touching = y + np.linalg.lstsq(a, np.concatenate(wanted) - a @ y, rcond=1e-10)[0]
        found = [self._by_plane(one, inner) for one in (touching, y)]
        half, largest, log_bound = min(found, key=lambda one: one[2])
        efficiency = float(np.exp(min(log_phi - log_bound, 0.0)))
        chosen, same = np.arange(len(b)), self.weights
        new = Weights(chosen, weights, half, largest, efficiency, log_phi, log_bound, self.space, same.deleted, same.rounds)
        return _Support(points, rows, new)

    def _by_plane(self, y: Array, inner: Variance) -> tuple[Array, float, float]:
        """Y, its largest sensitivity, and the bound phi(N) <= (y^T N y) / (c^T y)^2, by Cauchy and Schwarz."""
        half = (self.space.into @ y)[:, None]
        largest = float(self.pool.along(half).max())
        return half, largest, float(np.log(largest) - 2 * np.log(abs(float(inner.k[:, 0] @ y))))

    def _weights_of(self, points: Experiments, rows: Array, tolerance: float) -> _Support:
        """The best weights of these points; of some candidates too where the points alone do not determine what is estimated."""
        beside = _completing(CandidateRows(rows, self.pool.constant), self.pool, self.space)
        points, rows = Experiments.join([points, self.points[beside]]), np.concatenate([rows, self.pool.rows[beside]])
        pool = CandidateRows(rows, self.pool.constant)
        weights = optimal_weights(pool, self.criterion, tolerance=0.1 * tolerance, space=self.space)
        return _Support(points[weights.chosen], rows[weights.chosen], weights)

    def _polished(self, support: _Support, tolerance: float) -> _Support:
        """Return a support with its points moved to maxima of the sensitivity function, to a precision at which that is flat."""
        for _ in range(self.tuning.newton_steps):
            before = self.weights
            self.weights, _ = self.bounding(support.weights)
            z = newton(self.psi, self.box.places(support.points), self.box.difference, self.tuning)
            self.weights = before
            points = self.box.points(z)
            rows, places = self.source.valid(points)
            if len(places) < len(points):
                break
            new = self._weights_of(points, rows, tolerance)
            if new.weights.log_phi < support.weights.log_phi - 1e-9 or len(new.points) > len(support.points):
                break
            support = new
        return support


def refined(
    source: PointRows,
    points: Experiments,
    pool: CandidateRows,
    criterion: Criterion,
    weights: Weights,
    starts: int,
    tolerance: float,
    rng: np.random.Generator,
    climb: Climb | None,
    report: Callable[[str, int], None],
    tuning: RegionTuning = RegionTuning(),
) -> Refinement:
    """Move the support in the region until ascents from so many starts meet nothing above the level.

    Before these, points `climb` at random along limits where ascents end. `report` is called with the step and
    the number of candidates.

    The bound of the efficiency is by the largest sensitivity among all candidates and wherever an ascent or a climb has ended.
    """
    work = _Refining(source, points, pool, criterion, weights, report, tuning)
    if not len(work.box.free):
        return Refinement(points[weights.chosen], pool.rows[weights.chosen], weights, len(pool), 0)
    for search in range(tuning.most_searches):
        work.settle(tolerance)
        support, rows, final = work.merged(tolerance)
        # What bounds the optimum is the sensitivity function of the merged design where that has one, else the candidates'.
        of_pool = work.weights
        work.weights, _ = work.bounding(final)
        slope = work.weights.log_bound - float(np.log(work.weights.largest))
        along = work.pool.along(work.weights.half)
        z, value, last = np.empty((0, len(work.box.free))), np.empty(0), search == tuning.most_searches - 1
        if climb is not None:
            best = np.argsort(-along, kind="stable")[: tuning.climbing_beside]
            z, value = work.climbed(climb, Experiments.join([support, work.points[best]]))
        if last or value.max(initial=0.0) <= 1.0 + tuning.above:
            first = _starts(work, support, along, starts, rng)
            ended = work.peaks(first, tuning.proof_iterations)
            z, value = np.concatenate([z, ended[0]]), np.append(value, ended[1])
        largest = max(float(along.max()), float(value[np.isfinite(value)].max(initial=0.0)))
        if last or largest <= 1.0 + tuning.above:
            break
        above = value > 1.0 + tuning.close
        work.weights = of_pool
        work.add_new(z[above], value[above])
        work.solve(tolerance)
    log_bound = slope + float(np.log(largest))
    half = work.weights.half
    count = len(final.chosen)
    efficiency, deleted = float(np.exp(min(final.log_phi - log_bound, 0.0))), weights.deleted
    bounds = final.log_phi, log_bound, final.estimable, deleted, final.rounds
    proven = Weights(np.arange(count), final.weights, half, largest, efficiency, *bounds)
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


def _completing(some: CandidateRows, pool: CandidateRows, space: Estimable) -> Places:
    """Candidates that together with some others determine all that is estimable."""
    beside = np.empty(0, dtype=np.intp)
    matrix = some.matrices(np.arange(len(some)), space.into).mean(axis=0)
    for _ in range(space.rank):
        values, vectors = np.linalg.eigh(matrix)
        if values[0] > WeightsTuning().regular:
            break
        beside = np.append(beside, int(np.argmax(pool.along(space.into @ vectors[:, :1]))))
        matrix = matrix + pool.matrices(beside[-1:], space.into)[0]
    return beside
