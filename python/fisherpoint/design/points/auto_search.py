"""The search of method "auto": exchange over pools of evaluated candidates, which climb to peaks, and an ascent of all numbers.

Each of a few groups chooses one point after the other from a part of a pool, and exchanges them over it. Candidates of the pool
that would raise the criterion and are far apart climb then, each to what is near it and would raise it more: a peak that tells
much is mostly narrow, and a random candidate on its slope cannot compete with points that have been followed to their peaks. The
design takes over what it can use of them, and in rounds candidates are drawn near its own points. All that the groups have found
is the pool of one design, beside which candidates climb again: what would help the designs of the groups may not be what this one
lacks. It is followed to its end by such rounds and ascents.

A pool is evaluated at the prior mean, or in all scenarios of a criterion over the prior. What would raise the criterion is tried on
all nodes of the rule before it may enter.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ...information.point_information import PointInformation
from ...points.experiments import Experiments
from ...points.region import ExperimentRegion
from ..optimality.aims import LogDet
from ..optimality.criteria import Determinant
from ..optimality.estimable import Estimable
from ..optimality.told import told_aims
from .point_ascent import PointAscent, scenario_rows, whitened_rows
from .point_search import Incumbent, PointSearch, Progress
from .pool import Pool, best_of_each, far_apart
from .pool_exchange import PoolExchange, greedy
from .replicates import with_copies

POOL, MOST_POOL = 400, 50_000
"""Candidates at the edges of the region for each group, as a multiple of `n_candidates`, and at most; half as many random ones."""

PEAKS, NEAR_PEAK = 2, 16
"""Candidates that climb in each group, as a multiple of `n_candidates`; those that are drawn near each of them in a round."""

NEAR, OF_GROUPS, LEAST_NEAR = 24, 0.5, 4
"""Candidates near all points in each round, as a multiple of `n_candidates`; the share of groups; and near each point at least."""

PART, LEAST_PART, MOST_WORK = 0.3, 300, 200_000
"""Share of the pool from which a group begins; how many at least; and points times candidates of an exchange at most."""

GROUPS, FIRST_ROUNDS, CLIMB_ROUNDS, ROUNDS = 4, 2, 18, 6
"""Groups, and in each the rounds of its first design, of the climbing candidates, and of what the design becomes with them.

What a group has missed another one has, and merging takes it over.
"""

MERGED, MERGED_ROUNDS = 2, 4
"""How often candidates climb beside the design that is merged of all groups, and its rounds before that."""

LEAST_ROUNDS = 28
"""Iterations for each group, and each time that candidates climb later; with less there are fewer."""

FOR_PLANTS = 2
"""Times as many where a share of the plants is asked: the design is followed to its end for several sets of them."""

AGREE, ALIKE = 3, 3e-4
"""No more groups follow where so many are as good as the best of them but for so much for each parameter: the problem is easy."""

TRIES = 6
"""Choices of half of the points at random, for every second group; each is exchanged over the least part of the pool."""

TAUGHT = 1000
"""Candidates of the pool that are tried on all nodes at the beginning, to learn which of the nodes tell most."""

PROMISING, LOOKS = 4, 2
"""Candidates in the place of each point that are tried on all nodes, and how often more of them in each exchange."""

EARLIER = 6
"""Candidates in the place of each point that are sampled earlier where some plants cannot run them to their end."""

CYCLE, ASCENT = 8, 20
"""Rounds after which all numbers ascend together, and iterations of that ascent."""

CUT = 200
"""Candidates that are sampled earlier where more plants have to run them."""

AS_MANY = 4
"""Scenarios up to which as many candidates are drawn as for one; with more they are fewer, so that as much is computed."""

LEAST_SHARE = 0.1
"""Of the candidates that are drawn however many scenarios there are."""

LEAST_GAIN, MOST_IDLE = 1e-3, 2
"""The search ends after so many cycles in a row that gain less for each parameter."""

UNCONFIRMED = 3
"""Rounds after which candidates that climb are tried on all nodes; between these few nodes tell which are none."""

LEAST_CLIMB = 1 + 1e-6
"""By which a candidate that climbs must gain more."""


class AutoSearch(PointSearch):
    """The state of one search, for a D that does not depend on the other points."""

    def __post_init__(self) -> None:
        super().__post_init__()
        p = len(self.problem.estimated)
        self._known = np.tile(self.of_prior, (len(self.over.problems), 1, 1))
        for s, known in enumerate(self.over.previous):
            if known is not None:
                rows = whitened_rows(self.criterion, known).reshape(-1, p)
                self._known[s] += np.einsum("kp,kq->pq", rows, rows)
        self._level, self._log_dets = self.aims[0].level, [LogDet(Determinant("D", np.eye(p), True))] * len(self.aims)
        self._drawn_share = max(LEAST_SHARE, min(1.0, AS_MANY / len(self._known)))
        self._rng = np.random.default_rng([self.settings.seed, 2])
        self._rounds = self._all_rounds()
        self._enough: Incumbent | None = None  # the best design that as many plants can run as are asked

    def _advance(self, iteration: int) -> bool | None:
        before = self.best
        try:
            next(self._rounds)
        except StopIteration:
            return None
        return self.best.information is not before.information

    def _all_rounds(self) -> Iterator[None]:
        """The whole search, round by round."""
        settings = self.settings
        count = max(1, round(self._drawn_share * min(MOST_POOL, POOL * settings.n_candidates)))
        first = self.best.information
        random = self._pool(PointInformation.join([first, self.source.draw(max(1, count // 2))]))
        random.valid[: len(first)] = 1
        self._confirm(random, np.arange(min(len(random), TAUGHT)))
        least = LEAST_ROUNDS if self.away is None else FOR_PLANTS * LEAST_ROUNDS
        times = int(np.clip(settings.max_iterations // least, 1, GROUPS + MERGED))
        ends, found, easy = list[PointInformation](), random[np.arange(len(first))], False
        while not easy and len(ends) < min(times, GROUPS):
            pool = self._with_edges(random, count)
            self._ask_for_what_is_told(pool)
            design, peaks = yield from self._group(pool, at_random=len(ends) % 2 == 1)
            ends.append(design)
            found = found.with_more(peaks).with_more(self._pool(design, 1))
            values = np.array([self._value(end) for end in ends])
            easy = int((values > values.max() - ALIKE * self._level).sum()) >= AGREE
        design = max(ends, key=self._value)
        for _ in range(0 if easy else times - len(ends)):
            design = yield from self._followed(design, found, MERGED_ROUNDS)
            found = found.with_more((yield from self._climbed(design, self._with_edges(random, count))))
        while True:
            design = yield from self._finished(design, found)
            if self.away is None:
                return
            lost = self.away.lost(self.best.information.experiments)
            if self.away.enough(lost) and (self._enough is None or self.best.log_det > self._enough.log_det):
                self._enough = self.best
            if not self.away.change(lost):
                return
            design, found = self._further_away(found)

    def _with_edges(self, random: Pool, count: int) -> Pool:
        """A pool of what is there and so many new candidates at the edges of the region."""
        return random.with_more(self._pool(self.source.draw_at_edges(count)))

    def run(self, progress: Callable[[Progress], None] | None) -> str:
        reason = super().run(progress)
        if self._enough is not None:
            self.best = self._enough
        if reason != "interrupted":
            self._copy_what_is_near()
        return reason

    def _copy_what_is_near(self) -> None:
        """Points that are nearly equal become replicates where that costs nothing."""
        lower, upper = np.array(self._bounds).T

        def evaluated(table: Array) -> PointInformation:
            survivors, _ = self.source.survivors(Experiments.of_table(self.problem.model, np.clip(table, lower, upper)))
            if self.away is not None:  # these have been tried on more plants
                survivors = survivors[:0]
            return self.source.confirm(survivors)

        design = self.best.information
        copied = with_copies(design, lower, upper, evaluated, self._value)
        if copied is not design:
            self.best = self._incumbent(copied)
            self.trace[-1] = replace(self.trace[-1], log_det=self.best.log_det, drawn=self.source.drawn)

    def _finished(self, design: PointInformation, found: Pool) -> Generator[None, None, PointInformation]:
        """The design after cycles of rounds, until nothing gains any more."""
        idle, before = 0, self._value(design)
        while idle < MOST_IDLE:
            design = yield from self._followed(design, found, CYCLE)
            value = self._value(design)
            idle = idle + 1 if value - before < LEAST_GAIN * self._level else 0
            before = value
        return design

    def _further_away(self, found: Pool) -> tuple[PointInformation, Pool]:
        """A design and candidates for other plants: those that were found, and sampled as late as these plants allow."""
        old = self.best.information
        found = found.with_more(self._pool(old))
        found.valid[:] = 0
        best = np.sort(np.argsort(-self._gains(old, found.columns), kind="stable")[:CUT])
        own, cut = (self._pool(self.source.cut_for_plants(some.experiments)[0]) for some in (old, found.information[best]))
        for pool in (own, cut, found):
            self._confirm(pool, np.arange(len(pool)))
        kept, others = np.flatnonzero(own.valid == 1), cut.with_more(found)
        design, usable = own.information[kept], np.flatnonzero(others.valid == 1)
        if missing := len(old) - len(kept):
            some = others.information[self._rng.choice(usable, missing)] if len(usable) else self.source.draw_confirmed(missing)
            design = PointInformation.join([design, some])
        self.best = self._incumbent(design)
        return design, cut.with_more(found)

    def _group(self, pool: Pool, at_random: bool) -> Generator[None, None, tuple[PointInformation, Pool]]:
        """A design, and the candidates that have climbed for it."""
        design = self._start(pool, at_random)
        for _ in range(FIRST_ROUNDS):
            yield
            design = self._round(design, OF_GROUPS)
        peaks = yield from self._climbed(design, pool)
        design = yield from self._followed(design, peaks, ROUNDS, OF_GROUPS)
        return design, peaks

    def _followed(
        self, design: PointInformation, pool: Pool, rounds: int, share: float = 1.0
    ) -> Generator[None, None, PointInformation]:
        """The design after an exchange over a pool, an ascent and rounds."""
        design = self._kept(self._ascended(self._kept(self._exchanged(design, pool))))
        for _ in range(rounds):
            yield
            design = self._round(design, share)
        return design

    def _climbed(self, design: PointInformation, pool: Pool) -> Generator[None, None, Pool]:
        """Candidates that would raise the criterion and are far apart, each after some rounds in which it climbs."""
        live = np.flatnonzero(pool.valid >= 0)
        width = np.array([upper - lower for lower, upper in self._bounds])
        table = pool.information.experiments.table[live, : len(width)]
        most = max(1, round(self._drawn_share * PEAKS * self.settings.n_candidates))
        peaks = pool[live[far_apart(table, width, self._gains(design, pool.columns[..., live]), most)]]
        self._confirm(peaks, np.arange(len(peaks)))
        lower = peaks[np.arange(0)]
        for climbed in range(0, CLIMB_ROUNDS, UNCONFIRMED):
            if climbed == CLIMB_ROUNDS // 2:  # what is still far below others hardly comes past them
                order = np.argsort(-np.where(peaks.valid == 1, self._gains(design, peaks.columns), 0.0), kind="stable")
                first, others = np.sort(order[: -(-len(order) // 2)]), np.sort(order[-(-len(order) // 2) :])
                peaks, lower = peaks[first], peaks[others]
            reached = peaks
            for _ in range(UNCONFIRMED):
                yield
                reached = self._higher(design, reached)
            self._confirm(reached, np.arange(len(reached)))
            source = np.arange(len(peaks))
            better = np.flatnonzero(reached.valid == 1)
            source[better] += len(peaks)
            peaks = peaks.with_more(reached)[source]
        return peaks.with_more(lower)

    def _higher(self, design: PointInformation, peaks: Pool) -> Pool:
        """Each candidate, or the best of what is drawn near it and of this sampled earlier, if few nodes let that pass."""
        near, place = self.source.draw_near(peaks.information.experiments, NEAR_PEAK)
        pool, of = self._pool(near), place.astype(np.intp)
        gains = self._gains(design, pool.columns)
        least = LEAST_CLIMB * np.where(peaks.valid >= 0, self._gains(design, peaks.columns), 1.0)
        wanted = best_of_each(gains, of, least, EARLIER, np.ones(len(of), dtype=bool))
        pool, of = self._with_sampled_earlier(pool, wanted, of)
        gains = np.append(gains, self._gains(design, pool.columns[..., len(gains) :]))
        tried = np.arange(len(of)) >= len(near)
        tried[wanted] = pool.valid[wanted] >= 0
        best = best_of_each(gains, of, least, 1, tried)
        source = np.arange(len(peaks))
        source[of[best]] = len(peaks) + best
        return peaks.with_more(pool)[source]

    def _gains(self, design: PointInformation, columns: Array) -> Array:
        """By how much each candidate would raise the criterion beside the design, as a factor."""
        count = len(design)
        exchange = self._exchange(np.concatenate([self._columns(design), columns], axis=3), count)
        return exchange.gains(count + np.arange(columns.shape[3]))

    def _exchange(self, columns: Array, count: int) -> PoolExchange:
        """Of a design whose points stand first."""
        return PoolExchange(columns, np.arange(count), self._fixed, self.over.average, self.aims)

    def _ask_for_what_is_told(self, pool: Pool, spaces: Sequence[Estimable] | None = None) -> None:
        """Where no candidate tells about some parameters, ask for the others; `spaces` are of more candidates, where there were."""
        rows, singular = pool.columns.transpose(0, 3, 2, 1), self.settings.singular
        aims, self.spaces = told_aims(self.problem, self.asked, rows, self._known, self.count, singular, spaces=spaces)
        if self.scenarios is None:
            self.space = self.spaces[0]
        if aims != self.aims:
            self.aims, self._level = aims, aims[0].level
            self.seen.aims = aims
            self.best = self._incumbent(self.best.information)

    @property
    def _bounds(self) -> list[tuple[float, float]]:
        region = self.problem.region
        assert isinstance(region, ExperimentRegion)
        return [region.bounds[axis.name] for axis in self.problem.model.axes]

    @property
    def _fixed(self) -> Array:
        """What is added to F, the sum over the points: previous ones, the prior's where it counts, and as long as designs are
        singular a little of the prior.
        """
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
        part, designs = np.sort(rng.permutation(live)[:size]), list[PointInformation]()
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
        """Draw candidates near all points, a share of the usual number, and exchange the points over all of them.

        What tells most lies where some plants just can run it, and of what is near such a point the best is mostly beyond: the
        best in the place of each point are sampled earlier where some plants cannot run them to their end.
        """
        points, count = design.experiments, len(design)
        places = np.sort(np.unique(points.table, axis=0, return_index=True)[1])
        each = max(LEAST_NEAR, int(share * self._drawn_share * NEAR * self.settings.n_candidates) // len(places))
        near, of = self.source.draw_near(points[places], each)
        if not len(near):
            return design
        pool, place = self._pool(near), places[of]
        exchange = self._exchange(np.concatenate([self._columns(design), pool.columns], axis=3), count)
        wanted = exchange.promising(count + np.arange(len(place)), EARLIER, place) - count
        pool, place = self._with_sampled_earlier(pool, wanted, place)
        return self._kept(self._exchanged(design, pool, place=place))

    def _with_sampled_earlier(self, pool: Pool, wanted: NDArray[np.intp], place: NDArray[np.intp]) -> tuple[Pool, NDArray[np.intp]]:
        """The pool, and beside wanted candidates that some plants cannot run the same for a shorter time; the place of each."""
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
        exchange = self._exchange(columns, count)
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
        return ascent.run(design, ASCENT, self._late)
