"""The search of method "auto": exchange over pools of evaluated candidates, which climb to peaks, and an ascent of all numbers.

Each of a few groups chooses one point after the other from a part of a pool, and exchanges them over it; rounds draw candidates
near its points. Candidates of the pool that would raise the criterion and are far apart then climb: an informative peak is mostly
narrow, and a random candidate on its slope cannot compete with points that have been followed to their peaks. The group's design is
exchanged over them, ascends, and is followed by more rounds. The best design of all groups is exchanged over all that they have
found, and candidates climb beside it too: what would help the designs of the groups may not be what this one lacks. Cycles of
exchange, ascent and rounds follow it to its end, where nearly equal points become copies. `PointSearchTuning` has the numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from ...basics.stop_reason import StopReason
from ...basics.values import Array
from ...basics.work_clock import OutOfTime
from ...information.point_information import PointInformation
from ...points.experiments import Experiments
from ...show.progress import Progress
from .point_search import Incumbent
from .pool import Pool, far_apart
from .pool_search import PoolSearch
from .replicates import with_copies


class AutoSearch(PoolSearch):
    """The state of one search."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._rounds = self._all_rounds()
        self._enough: Incumbent | None = None  # the best design that the required share of plants can run

    def __getstate__(self) -> dict[str, Any]:
        """A search that travels has ended: what it would do next stays behind."""
        return vars(self) | {"_rounds": iter(())}

    @property
    def for_enough_plants(self) -> bool:
        """Whether as many plants as are required can run the design, of those that were tried."""
        return self.away is None or self._enough is not None

    def _advance(self, iteration: int) -> bool | None:
        before = self.best
        try:
            next(self._rounds)
        except StopIteration:
            return None
        return self.best.information is not before.information

    def _all_rounds(self) -> Iterator[None]:
        """The whole search, round by round."""
        settings, tuning = self.settings, self.tuning
        edges = min(tuning.most_edge_candidates, tuning.edge_candidates * settings.n_candidates)
        count = max(1, round(self._drawn_share * edges))
        first = self.best.information
        some = first[:0]
        with self.time.part(tuning.pool_share / 2):
            some = self.source.draw(max(1, count // 2), partly=True)
        random = self._pool(PointInformation.join([first, some]))
        random.valid[: len(first)] = 1
        with self.time.part(tuning.pilot_share):
            self._confirm(random, np.arange(min(len(random), tuning.pilot_candidates)))
        least = tuning.group_budget if self.away is None else tuning.plant_budget_factor * tuning.group_budget
        times = int(np.clip(settings.max_iterations // least, 1, tuning.groups + tuning.merged_climbs))
        ends, found, easy = list[PointInformation](), random[np.arange(len(first))], False
        while not easy and len(ends) < min(times, tuning.groups):
            begun = self.time.seconds
            pool = self._with_edges(random, count)
            self._restrict_to_estimable(pool)
            design, peaks = yield from self._group(pool, at_random=len(ends) % 2 == 1)
            ends.append(design)
            found = found.with_more(peaks).with_more(self._pool(design, 1))
            values = np.array([self._value(end) for end in ends])
            easy = int((values > values.max() - tuning.agreement_per_parameter * self._level).sum()) >= tuning.agreeing_groups
            if self.time.late(tuning.group_times_left * (self.time.seconds - begun)):
                times = len(ends)  # what is left is better spent on the best design
        design = max(ends, key=self._value)
        for _ in range(0 if easy else times - len(ends)):
            design = yield from self._followed(design, found, tuning.merged_rounds)
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
        with self.time.part(self.tuning.pool_share):
            return random.with_more(self._pool(self.source.draw_at_edges(count)))
        return random

    def run(self, progress: Callable[[Progress], None] | None) -> StopReason:
        reason = super().run(progress)
        if self._enough is not None:
            self.best = self._enough
        if reason != StopReason.interrupted:
            try:
                self._copy_what_is_near()
            except OutOfTime:
                reason = StopReason.time_limit
        return reason

    def _copy_what_is_near(self) -> None:
        """Points that are nearly equal become replicates where that costs nothing."""
        lower, upper = self._lower, self._upper

        def evaluated(table: Array) -> PointInformation:
            survivors, _ = self.source.survivors(Experiments.of_table(self.problem.model, np.clip(table, lower, upper)))
            if self.away is not None:  # these have been tried on more plants
                survivors = survivors[:0]
            return self.source.confirm(survivors)

        design = self.best.information
        copied = with_copies(
            design, lower, upper, evaluated, self._value, self.tuning.copy_distance, self.tuning.most_points_for_copies
        )
        if copied is not design:
            self.best = self._incumbent(copied)
            self.trace[-1] = replace(self.trace[-1], log_det=self.best.log_det, drawn=self.source.drawn)

    def _finished(self, design: PointInformation, found: Pool) -> Generator[None, None, PointInformation]:
        """The design after cycles of rounds, until nothing gains any more."""
        idle, before = 0, self._value(design)
        while idle < self.tuning.most_idle_cycles:
            design = yield from self._followed(design, found, self.tuning.cycle_rounds)
            value = self._value(design)
            idle = idle + 1 if value - before < self.tuning.cycle_least_gain * self._level else 0
            before = value
        return design

    def _further_away(self, found: Pool) -> tuple[PointInformation, Pool]:
        """A design and candidates for other plants: those that were found, and sampled as late as these plants allow."""
        old = self.best.information
        found = found.with_more(self._pool(old))
        found.valid[:] = 0
        best = np.sort(np.argsort(-self._gains(old, found.columns), kind="stable")[: self.tuning.shortened_for_plants])
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
        for _ in range(self.tuning.first_rounds):
            yield
            design = self._round(design, self.tuning.near_share_in_groups)
        peaks = yield from self._climbed(design, pool)
        design = yield from self._followed(design, peaks, self.tuning.last_rounds, self.tuning.near_share_in_groups)
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
        table = self._numbers(pool.information)[live]
        tuning = self.tuning
        most = max(1, round(self._drawn_share * tuning.climbing_candidates * self.settings.n_candidates))
        each = tuning.climb.rounds * tuning.climb.near_per_point * len(self.over.problems)
        affordable = self.time.affordable("sensitivities", tuning.climb_share) / max(1, each)
        if affordable < tuning.climb_least_share * most:
            return pool[np.arange(0)]  # rounds gain more in that time
        most = int(min(most, affordable))
        gains, apart = self._gains(design, pool.columns.take(live, axis=3)), tuning.climb.least_distance
        peaks = pool[live[far_apart(table, self._upper - self._lower, gains, most, apart)]]
        self._confirm(peaks, np.arange(len(peaks)))
        lower = peaks[np.arange(0)]
        for climbed in range(0, tuning.climb.rounds, tuning.unchecked_rounds):
            if climbed == tuning.climb.rounds // 2:  # what is still far below others hardly comes past them
                order = np.argsort(-np.where(peaks.valid == 1, self._gains(design, peaks.columns), 0.0), kind="stable")
                going = int(np.ceil(tuning.climbing_survivors * len(order)))
                first, others = np.sort(order[:going]), np.sort(order[going:])
                peaks, lower = peaks[first], peaks[others]
            reached = peaks
            for _ in range(tuning.unchecked_rounds):
                yield
                reached = self._higher(design, reached)
            self._confirm(reached, np.arange(len(reached)))
            source = np.arange(len(peaks))
            better = np.flatnonzero(reached.valid == 1)
            source[better] += len(peaks)
            peaks = peaks.with_more(reached)[source]
        return peaks.with_more(lower)
