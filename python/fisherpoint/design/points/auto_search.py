"""The search of method "auto": exchange over pools of evaluated candidates, from several starts, and an ascent of all numbers.

Every start chooses one point after the other from a part of a pool of random candidates, and exchanges them over it. In each round
candidates are drawn near the points of the design, and all of its points are exchanged over all of these together. The points of
a few starts are then a pool themselves, of which an exchange makes a design that is followed further: rounds, and between them
ascents. All that several such groups have found is the pool of the design that is followed to its end.

A pool is evaluated at the prior mean, or in all scenarios of a criterion over the prior. What would raise the criterion is tried on
all nodes of the rule before it may enter.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ...information.point_information import PointInformation
from ..optimality.aims import LogDet
from ..optimality.criteria import Determinant
from .point_ascent import PointAscent, scenario_rows, whitened_rows
from .point_search import RIDGE, PointSearch
from .pool_exchange import PoolExchange, greedy
from .told import told_aims

POOL, MOST_POOL = 200, 50_000
"""Random candidates, as a multiple of `n_candidates`, and at most."""

NEAR, LEAST_NEAR = 24, 4
"""Candidates near all points in each round after the starts, as a multiple of `n_candidates`, and near each point at least."""

PART, LEAST_PART, MOST_WORK = 0.3, 300, 200_000
"""Share of the pool from which a start chooses; how many at least; and points times candidates of an exchange at most."""

GROUPS, STARTS, SKETCH, FURTHER = 6, 3, 12, 2
"""Groups, starts of each, rounds of each start, and cycles of what a group's starts have found."""

OF_SKETCH = 0.5
"""The share of the candidates that the rounds of several starts and groups draw.

What a start has missed, as peaks that are narrow, another one has, and merging takes it over. Designs that are followed further
before they are merged have more that is worth taking over: six groups of three starts end in better designs than 16 starts do.
"""

AGREE, ALIKE = 3, 3e-4
"""No more starts follow where so many are as good as the best of them but for so much for each parameter: the problem is easy."""

TRIES = 6
"""Choices of half of the points at random, for every second start; each is exchanged over the least part of the pool."""

PROMISING, LOOKS = 4, 2
"""Candidates in the place of each point that are tried on all nodes, and how often more of them in each exchange."""

EARLIER = 6
"""Candidates in the place of each point that are sampled earlier where some plants cannot run them to their end."""

CYCLE, CLIMB = 8, 20
"""Rounds after which all numbers ascend together, and iterations of that ascent."""

AS_MANY = 4
"""Scenarios up to which as many candidates are drawn as for one; with more they are fewer, so that as much is computed."""

LEAST_SHARE = 0.1
"""Of the candidates that are drawn however many scenarios there are."""

LEAST_GAIN, MOST_IDLE = 1e-4, 2
"""The search ends after so many cycles in a row that gain less for each parameter."""


class Pool:
    """Candidates, and their whitened rows in each scenario as columns (S, p, n, N).

    `valid` is 1 of those that are valid on all nodes of the rule, -1 of those that are not, and 0 where it is not known.
    """

    def __init__(self, information: PointInformation, columns: Array, valid: int = 0) -> None:
        self.information, self.columns = information, columns
        self.valid = np.full(len(information), valid, dtype=np.int8)

    def with_more(self, other: Pool) -> Pool:
        """These candidates and then those of another pool."""
        if not len(other.information):
            return self
        both = Pool(
            PointInformation.join([self.information, other.information]), np.concatenate([self.columns, other.columns], axis=3)
        )
        both.valid = np.concatenate([self.valid, other.valid])
        return both


class AutoSearch(PointSearch):
    """The state of one search, for a D that does not depend on the other points."""

    def __post_init__(self) -> None:
        super().__post_init__()
        p = len(self.problem.estimated)
        self._known = np.zeros((len(self.over.problems), p, p))
        for s, known in enumerate(self.over.previous):
            if known is not None:
                rows = whitened_rows(self.criterion, known).reshape(-1, p)
                self._known[s] = np.einsum("kp,kq->pq", rows, rows)
        self._level, self._log_dets = self.aims[0].level, [LogDet(Determinant("D", np.eye(p), True))] * len(self.aims)
        self._drawn_share = max(LEAST_SHARE, min(1.0, AS_MANY / len(self._known)))
        self._rng = np.random.default_rng([self.settings.seed, 2])
        self._rounds = self._all_rounds()

    def _advance(self, iteration: int) -> bool | None:
        before = self.best
        try:
            next(self._rounds)
        except StopIteration:
            return None
        return self.best is not before

    def _all_rounds(self) -> Iterator[None]:
        """The whole search, round by round."""
        settings = self.settings
        random = self.best.information
        count = max(1, round(self._drawn_share * min(MOST_POOL, POOL * settings.n_candidates)))
        pool = self._pool(PointInformation.join([random, self.source.draw(count)]))
        pool.valid[: len(random)] = 1
        self._ask_for_what_is_told(pool)
        groups = min(GROUPS, settings.max_iterations // (2 * (STARTS * SKETCH + FURTHER * CYCLE)))
        starts = STARTS if groups else int(np.clip(settings.max_iterations // (2 * SKETCH), 1, STARTS))
        share = OF_SKETCH if starts > 1 else 1.0
        ends: list[PointInformation] = []
        for _ in range(max(groups, 1)):
            for start in range(starts):
                design = self._start(pool, at_random=start % 2 == 1)
                for _ in range(SKETCH):
                    design = self._round(design, share)
                    yield
                ends.append(design)
            values = np.array([self._value(end) for end in ends])
            if int((values > values.max() - ALIKE * self._level).sum()) >= AGREE:
                break
            if groups > 1:
                own = ends[-starts:]
                design, found = max(own, key=self._value), self._pool(PointInformation.join(own), 1)
                for _ in range(FURTHER):
                    design = yield from self._cycle(design, found, share)
                ends.append(design)
        design, found = max(ends, key=self._value), self._pool(PointInformation.join(ends), 1)
        idle, before = 0, self._value(design)
        while idle < MOST_IDLE:
            design = yield from self._cycle(design, found)
            value = self._value(design)
            idle = idle + 1 if value - before < LEAST_GAIN * self._level else 0
            before = value

    def _cycle(self, design: PointInformation, found: Pool, share: float = 1.0) -> Generator[None, None, PointInformation]:
        """An exchange over what was found before, an ascent, and rounds."""
        design = self._kept(self._ascended(self._kept(self._exchanged(design, found))))
        for _ in range(CYCLE):
            yield
            design = self._round(design, share)
        return design

    def _ask_for_what_is_told(self, pool: Pool) -> None:
        """Where no candidate tells about some parameters, ask for the others."""
        aims = told_aims(self.problem, self.aims, pool.columns.transpose(0, 3, 2, 1), self._known, self.count)
        if aims != self.aims:
            self.aims = self.seen.aims = aims
            self.best = self._incumbent(self.best.information)

    @property
    def _ridge(self) -> float:
        return 0.0 if np.isfinite(self.best.log_det) else RIDGE

    @property
    def _fixed(self) -> Array:
        """What is added to F, the sum over the points: previous ones, and as long as designs are singular a little of the prior."""
        total = self.count + (0 if self.previous is None else len(self.previous))
        fixed: Array = self._known + self._ridge * total / 2 * np.eye(self._known.shape[1])
        return fixed

    def _pool(self, information: PointInformation, valid: int = 0) -> Pool:
        return Pool(information, self._columns(information), valid)

    def _columns(self, information: PointInformation) -> Array:
        return np.ascontiguousarray(scenario_rows(self.criterion, information).transpose(0, 3, 2, 1))

    def _value(self, design: PointInformation) -> float:
        return self._worth(design, self._ridge)

    def _kept(self, design: PointInformation) -> PointInformation:
        """The same, which is the best so far where it is better."""
        if self._value(design) > self._value(self.best.information):
            self.best = self._incumbent(design)
        return design

    def _start(self, pool: Pool, at_random: bool) -> PointInformation:
        """A design of a random part of the pool, the best points or half of them any; what is not valid gives way to what is.

        The best by log det F where half of them are not any, as other criteria see only what is known worst while points are few.
        """
        rng, count = self._rng, self.count
        aims = self.aims if at_random and not self.aims[0].bounded else self._log_dets
        live = np.flatnonzero(pool.valid >= 0)
        size = int(max(LEAST_PART, min(PART * len(live), MOST_WORK / count)))
        part = np.sort(rng.permutation(live)[:size])
        designs = []
        for _ in range(TRIES if at_random else 1):
            some = np.sort(rng.permutation(part)[:LEAST_PART]) if at_random else part
            first = rng.integers(len(some), size=count // 2 if at_random else 0)
            columns = np.ascontiguousarray(pool.columns[..., some])
            chosen = some[greedy(columns, count, self._fixed, self.over.average, aims, first)]
            self._confirm(pool, np.unique(chosen))
            lost = pool.valid[chosen] < 0
            chosen[lost] = rng.choice(np.flatnonzero(pool.valid == 1), int(lost.sum()))
            designs.append(self._exchanged(pool.information[chosen], pool, some))
        return self._kept(max(designs, key=self._value))

    def _round(self, design: PointInformation, share: float = 1.0) -> PointInformation:
        """Draw candidates near all points, a share of the usual number, and exchange the points over all of them."""
        points = design.experiments
        places = np.sort(np.unique(points.table, axis=0, return_index=True)[1])
        each = max(LEAST_NEAR, int(share * self._drawn_share * NEAR * self.settings.n_candidates) // len(places))
        near, of = self.source.draw_near(points[places], each)
        if not len(near):
            return design
        pool, place = self._with_sampled_earlier(design, self._pool(near), places[of])
        return self._kept(self._exchanged(design, pool, place=place))

    def _with_sampled_earlier(self, design: PointInformation, pool: Pool, place: NDArray[np.intp]) -> tuple[Pool, NDArray[np.intp]]:
        """The pool, and beside its best candidates that some plants cannot run the same for a shorter time; the place of each.

        What tells most lies where some plants just can run it, and of what is near such a point the best is mostly beyond.
        """
        count = len(design)
        columns = np.concatenate([self._columns(design), pool.columns], axis=3)
        exchange = PoolExchange(columns, np.arange(count), self._fixed, self.over.average, self.aims)
        wanted = exchange.promising(count + np.arange(len(place)), EARLIER, place) - count
        earlier, of, lost = self.source.sampled_earlier(pool.information.experiments[wanted])
        pool.valid[wanted[lost]] = -1
        return pool.with_more(self._pool(earlier)), np.append(place, place[wanted[of]])

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
        columns = np.concatenate([self._columns(design), pool.columns[..., live]], axis=3)
        exchange = PoolExchange(columns, np.arange(count), self._fixed, self.over.average, self.aims)
        for look in range(LOOKS):
            unknown = np.flatnonzero(pool.valid[live] == 0)
            places = None if place is None else place[live[unknown]]
            wanted = exchange.promising(count + unknown, PROMISING, places) - count
            if look and not len(wanted):
                break
            self._confirm(pool, live[wanted])
            exchange.run(np.append(np.arange(count), count + np.flatnonzero(pool.valid[live] == 1)), self._late)
        entered = exchange.chosen >= count
        source = exchange.chosen.copy()
        source[entered] = count + np.arange(int(entered.sum()))
        taken = pool.information[live[exchange.chosen[entered] - count]]
        return PointInformation.join([design, taken])[source]

    def _confirm(self, pool: Pool, rows: NDArray[np.intp]) -> None:
        rows = rows[pool.valid[rows] == 0]
        if len(rows):
            _, valid = self.source.confirmed(pool.information[rows])
            pool.valid[rows] = np.where(valid, 1, -1)

    def _ascended(self, design: PointInformation) -> PointInformation:
        ascent = PointAscent(self.problem, self.source, self.criterion, self._fixed, self.threads, self.over, self.aims)
        return ascent.run(design, CLIMB, self._late)
