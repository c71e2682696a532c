"""What a search does with pools of evaluated candidates: a design begins there, is exchanged over them, and moves near its points.

A pool is evaluated at the prior mean, or in all scenarios of a criterion over the prior. What would raise the criterion is tried on
all nodes of the rule before it may enter.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ...information.point_information import PointInformation
from ...points.runs import Runs
from ..goal.estimability import restricted_criteria
from ..goal.estimable_space import Estimable
from ..goal.goal import Goal
from ..goal.goal_criterion import criterion_of
from .past_moves import Lineage
from .point_ascent import PointAscent, scenario_rows, whitened_rows
from .point_search import PointSearch
from .pool import Pool
from .pool_exchange import PoolExchange, greedy
from .random_climbs import higher


class PoolSearch(PointSearch):
    """The state of a search over pools, for a D that does not depend on the other points."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._lower, self._upper = self.problem.point_region.box(self.problem.model)
        p = self.problem.n_unknowns
        self._known = np.tile(self.of_prior, (len(self.over.problems), 1, 1))
        for s, known in enumerate(self.over.previous):
            if known is not None:
                rows = whitened_rows(self.d, known).reshape(-1, p)
                self._known[s] += np.einsum("kp,kq->pq", rows, rows)
        of_d = criterion_of(self.problem, Goal())
        self._level, self._log_dets = self.criteria[0].level, [of_d] * len(self.criteria)
        self._drawn_share = max(self.tuning.least_scenario_share, min(1.0, self.tuning.scenarios_in_full / len(self._known)))
        self._rng = np.random.default_rng([self.settings.seed, 2])
        self.lineage = Lineage(self.tuning.climb.generations)

    @property
    def _fixed(self) -> Array:
        """What is added to F, the sum over the points: previous ones, the prior's where it counts, and as long as designs are
        singular a little of the prior.
        """
        total = self.count + (0 if self.previous is None else len(self.previous))
        fixed: Array = self._known + self._ridge * total / 2 * np.eye(self._known.shape[1])
        return fixed

    def _restrict_to_estimable(self, pool: Pool, spaces: Sequence[Estimable] | None = None) -> None:
        """Restrict the criteria to what the candidates determine; `spaces` are of more candidates, where there were."""
        rows, singular = pool.columns.transpose(0, 3, 2, 1), self.settings.goal.singular
        criteria, self.spaces = restricted_criteria(
            self.problem, self.unrestricted, rows, self._known, self.count, singular, spaces=spaces
        )
        if self.scenarios is None:
            self.space = self.spaces[0]
        if criteria != self.criteria:
            self.criteria, self._level = criteria, criteria[0].level
            self.seen.criteria = criteria
            self.best = self._incumbent(self.best.information)

    def _numbers(self, points: PointInformation) -> Array:
        """The numbers of points, (K, d)."""
        return points.experiments.table[:, : len(self._lower)]

    def _pool(self, information: PointInformation, valid: int = 0) -> Pool:
        return Pool(information, self._columns(information), valid)

    def _columns(self, information: PointInformation) -> Array:
        return np.ascontiguousarray(scenario_rows(self.d, information).transpose(0, 3, 2, 1))

    def _value(self, design: PointInformation) -> float:
        return self._worth(design, self._ridge)

    def _kept(self, design: PointInformation) -> PointInformation:
        """Return the design, and keep it as the best so far where it is better."""
        if self._value(design) > self._value(self.best.information):
            self.best = self._incumbent(design)
        return design

    def _start(self, pool: Pool, at_random: bool) -> PointInformation:
        """A design of a random part of the pool, the best points or half of them any; valid points replace others.

        The best by log det F where half of them are not any, as other criteria see only what is known worst while points are few.
        """
        rng, count, tuning = self._rng, self.count, self.tuning
        criteria = self.criteria if at_random and not self.criteria[0].bounded else self._log_dets
        live = np.flatnonzero(pool.valid >= 0)
        size = int(max(tuning.least_start_candidates, min(tuning.start_share * len(live), tuning.most_start_work / count)))
        part, designs = np.sort(rng.permutation(live)[:size]), list[PointInformation]()
        for _ in range(tuning.random_starts if at_random else 1):
            some = np.sort(rng.permutation(part)[: tuning.least_start_candidates]) if at_random else part
            first = rng.integers(len(some), size=count // 2 if at_random else 0)
            columns = pool.columns.take(some, axis=3)
            chosen = some[greedy(columns, count, self._fixed, self.over.average, criteria, first)]
            self._confirm(pool, np.unique(chosen))
            lost = pool.valid[chosen] < 0
            chosen[lost] = rng.choice(np.flatnonzero(pool.valid == 1), int(lost.sum()))
            designs.append(self._exchanged(pool.information[chosen], pool, some))
        return self._kept(max(designs, key=self._value))

    def _round(self, design: PointInformation, share: float = 1.0) -> PointInformation:
        """Draw candidates near all points, a share of the usual number, and exchange the points over all of them.

        The most informative points lie on the boundary of what all plants can run, and most candidates near them lie past it: the
        best candidates for each point are sampled earlier where some plants cannot run them to their end.
        """
        points, count = design.experiments, len(design)
        places = np.sort(Runs.of_points(points).distinct()[0])
        wanted_near = int(share * self._drawn_share * self.tuning.near_candidates * self.settings.n_candidates)
        each = max(self.tuning.least_near_per_point, wanted_near // len(places))
        near, of = self.source.draw_near(points[places], each, self.lineage.steps(self._numbers(design)[places]))
        if not len(near):
            return design
        pool, place = self._pool(near), places[of]
        exchange = self._exchange(np.concatenate([self._columns(design), pool.columns], axis=3), count)
        wanted = exchange.promising(count + np.arange(len(place)), self.tuning.climb.shortened_per_point, place) - count
        pool, place = self._with_sampled_earlier(pool, wanted, place)
        return self._kept(self._exchanged(design, pool, place=place))

    def _exchanged(
        self,
        design: PointInformation,
        pool: Pool,
        part: NDArray[np.intp] | None = None,
        place: NDArray[np.intp] | None = None,
    ) -> PointInformation:
        """The design after an exchange over a pool, or a part of it; what enters is valid on all nodes.

        Of candidates that are near the points at some places, which these are says what is tried on all nodes.
        """
        count = len(design)
        live = np.arange(len(pool.valid)) if part is None else part
        live = live[pool.valid[live] >= 0]
        columns = np.concatenate([self._columns(design), pool.columns.take(live, axis=3)], axis=3)
        exchange = self._exchange(columns, count)
        for look in range(self.tuning.checks_per_exchange):
            unknown = np.flatnonzero(pool.valid[live] == 0)
            places = None if place is None else place[live[unknown]]
            wanted = exchange.promising(count + unknown, self.tuning.checked_per_point, places) - count
            if look and not len(wanted):
                break
            self._confirm(pool, live[wanted])
            exchange.run(np.append(np.arange(count), count + np.flatnonzero(pool.valid[live] == 1)), self._late)
        entered = exchange.chosen >= count
        source = exchange.chosen.copy()
        source[entered] = count + np.arange(int(entered.sum()))
        of_pool = live[exchange.chosen[entered] - count]
        taken = pool.information[of_pool]
        if place is not None:
            self.lineage.add(self._numbers(taken), self._numbers(design[place[of_pool]]))
        return PointInformation.join([design, taken])[source]

    def _with_sampled_earlier(self, pool: Pool, wanted: NDArray[np.intp], place: NDArray[np.intp]) -> tuple[Pool, NDArray[np.intp]]:
        """The pool, and beside wanted candidates that some plants cannot run the same for a shorter time; the place of each."""
        earlier, of, lost = self.source.sampled_earlier(pool.information.experiments[wanted])
        pool.valid[wanted[lost]] = -1
        return pool.with_more(self._pool(earlier)), np.append(place, place[wanted[of]])

    def _confirm(self, pool: Pool, rows: NDArray[np.intp]) -> None:
        rows = rows[pool.valid[rows] == 0]
        if len(rows):
            _, valid = self.source.confirmed(pool.information[rows])
            pool.valid[rows] = np.where(valid, 1, -1)

    def _higher(self, design: PointInformation, peaks: Pool) -> Pool:
        """Each candidate, or the best of what is drawn near it and of this sampled earlier, if few nodes let that pass."""
        least = np.where(peaks.valid >= 0, self._gains(design, peaks.columns), 1.0)
        steps = self.lineage.steps(self._numbers(peaks.information))

        def gains(points: PointInformation) -> Array:
            return self._gains(design, self._columns(points))

        found, of = higher(self.source, peaks.information, steps, least, gains, self.tuning.climb)
        source = np.arange(len(peaks))
        source[of] = len(peaks) + np.arange(len(of))
        self.lineage.add(self._numbers(found), self._numbers(peaks.information[of]))
        return peaks.with_more(self._pool(found))[source]

    def _gains(self, design: PointInformation, columns: Array) -> Array:
        """Factors by which candidates would raise the criterion beside the design."""
        count = len(design)
        exchange = self._exchange(np.concatenate([self._columns(design), columns], axis=3), count)
        return exchange.gains(count + np.arange(columns.shape[3]))

    def _exchange(self, columns: Array, count: int) -> PoolExchange:
        """The exchange of a design whose points stand first."""
        return PoolExchange(columns, np.arange(count), self._fixed, self.over.average, self.criteria, self.tuning.exchange)

    def _ascended(self, design: PointInformation) -> PointInformation:
        tuning, free = self.tuning, int((self._upper > self._lower).sum())
        trials = len(tuning.ascent.step_shares) * len(tuning.ascent.reach_factors)
        each = len(design) * (free + trials) * len(self.over.problems)
        if self.time.affordable("sensitivities", tuning.ascent_share) < each:
            return design  # rounds gain more in that time
        given = self.problem, self.source, self.d, self._fixed, self.threads, self.over, self.criteria, self.tuning
        ascent = PointAscent(*given, self.time)
        ascended = ascent.run(design, self.tuning.ascent_iterations, self._late)
        before, after = self._numbers(design), self._numbers(ascended)
        moved = (before != after).any(axis=1)
        self.lineage.add(after[moved], before[moved])
        return ascended
