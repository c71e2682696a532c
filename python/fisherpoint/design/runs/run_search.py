"""The search for runs: starts from a pool of random ones, then all free numbers together, then single changes, and again.

A start takes runs from a part of the pool (run_pool.py), or is a classical one (run_references.py). An ascent leads to a local
maximum of log det F, all numbers of all runs together (run_ascent.py); single changes of a run (run_moves.py) lead out of it,
until none of them gains (run_climb.py). After each step plants are tried, and the distance from limits changes
(run_feasibility.py). Where that is much work, all starts get some of it, and only the best go on (run_race.py). The winner hops
and climbs until that is in vain, and its numbers are rounded (run_rounding.py). How many starts end at the same value is what
is known about whether there is a better one.

Its work is counted in starts and iterations, so that it finds the same on every machine; a limit of time only cuts it short.
`RunSearchTuning` has the numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from ...basics.stop_reason import StopReason
from ...basics.values import Array, FrozenMapping
from ...basics.work_clock import Clock, OutOfTime
from ...information.fewer_samples import with_fewer_samples
from ...information.problem import DesignProblem
from ...information.run_information import run_rows
from ...points.profiles import Fact
from ...points.run_coordinates import RunCoordinates
from ...points.run_region import RunRegion
from ...points.runs import Runs
from ...show.progress import Progress
from ..goal.criteria import Criterion
from ..goal.estimability import RUNS, restricted_criteria
from ..goal.estimable_space import RIDGE
from ..goal.scenario_average import Average
from ..results.settings import RunSettings
from .reached_runs import ReachedRuns
from .run_approach import approach
from .run_climb import Climb
from .run_feasibility import RunGuard
from .run_objective import RunObjective
from .run_pool import RunPool, determine_all
from .run_race import race
from .run_references import CLASSICAL_RUNS, classical_runs
from .run_rounding import tidied
from .sample_choice import best_samples
from .sampled_plants import RunPlants
from .tried_runs import TriedRuns
from .tuning import RunSearchTuning


class RunSearch:
    """The state of one search.

    Parameters
    ----------
    problem : DesignProblem
    region : RunRegion
    settings : RunSettings
    plants : ndarray, (R, p)
        Parameters of the model over which log det F is averaged.
    average : Average
        How.
    previous : ndarray, (R, p, p)
    criteria : sequence of Criterion
        What is maximised on each plant.
    threads : int
    clock : Clock
    kept : Runs, optional
        Runs that plants have to be able to run too; their information is in `previous`.
    tuning : RunSearchTuning, optional

    Attributes
    ----------
    left_out : list of str
        What there was no time for.
    classical : dict of profile to ReachedRuns
        Runs as they are chosen by hand; the search begins from them too.
    pool : RunPool
        Random runs, from which starts begin.
    singular : bool
        Whether the criterion is log det F, and no runs determine all parameters.
    """

    def __init__(
        self,
        problem: DesignProblem,
        region: RunRegion,
        settings: RunSettings,
        plants: Array,
        average: Average,
        previous: Array,
        criteria: Sequence[Criterion],
        *,
        threads: int,
        clock: Clock,
        kept: Runs | None = None,
        tuning: RunSearchTuning | None = None,
    ) -> None:
        self.tuning = tuning = RunSearchTuning() if tuning is None else tuning
        self.problem, self.region, self.clock, self.threads = problem, region, clock, threads
        self.n_runs = n_runs = settings.n_runs - (0 if kept is None else len(kept))
        self.n_starts, self.seed = settings.n_starts, settings.seed
        self._share_of_plants = settings.goal.share_of_plants
        self._whole = self.coordinates = RunCoordinates(region, problem.model)
        self._settings = problem.integration(threads)
        finer = self._settings._replace(rtol=min(self._settings.rtol, tuning.trajectory_rtol))
        searched, fewer = with_fewer_samples(problem, region)
        if searched is not problem:
            self.coordinates = RunCoordinates(fewer, problem.model)
        self.objective = RunObjective(searched, self.coordinates, plants, average, previous, criteria, finer, clock, tuning)
        self._rng = np.random.default_rng(self.seed)
        of_search = RunPlants(problem, tuning.plants, np.random.default_rng([self.seed, 1]), self._settings)
        self.guard = RunGuard(of_search, self._share_of_plants, kept, clock, tuning)
        self._climbs: list[Climb] = []
        self._other_ends: list[ReachedRuns] = []
        self.classical: dict[str, ReachedRuns] = {}
        self.left_out: list[str] = []
        self._found: list[ReachedRuns] = []
        self._hurried = False
        self._longest_trial = 0.0
        most = tuning.most_pool_segments // (region.segments * len(plants))
        wanted = max(4 * n_runs, 20, min(settings.n_candidates, most))
        clock.share = tuning.time_shares[0]
        self.pool = RunPool(self.objective, wanted, self._rng)
        clock.share = 1.0
        self.singular = self.pool.singular and criteria[0].of_all
        if self.singular:
            self.objective.previous = self.objective.previous + RIDGE * np.eye(previous.shape[-1])
        elif not criteria[0].of_all:
            self.objective.criteria, _ = restricted_criteria(problem, criteria, self.pool.rows, previous, n_runs, "estimable", RUNS)

    @property
    def best(self) -> ReachedRuns:
        """The best runs so far: such that enough plants can run them, where there are any."""
        return max(self._found, key=lambda found: found.worth)

    @property
    def worth(self) -> tuple[bool, tuple[bool, bool, float]]:
        """What searches are compared by."""
        return not self.singular, self.best.worth

    def include(self, other: RunSearch) -> None:
        """Count what another search has drawn, and the ends of its starts."""
        self._other_ends += other.ends
        self.pool.drawn += other.pool.drawn
        self.pool.rejected.update(other.pool.rejected)

    def go_on_here(self, seed: int, clock: Clock, threads: int) -> None:
        """Go on in this process, and with another seed for what is tried at the end."""
        self.seed, self.clock, self.threads = seed, clock, threads
        self.objective.clock = self.guard.clock = clock

    @property
    def ends(self) -> list[ReachedRuns]:
        """The best runs of each start, also of other searches that were included."""
        return [*(one.best for one in self._climbs if one.best is not None), *self._other_ends]

    @property
    def again(self) -> int:
        """How many starts have ended where the best one did."""
        least = self.best.value - self.tuning.same_value
        return sum(end.value >= least and end.feasible == self.best.feasible for end in self.ends)

    def planned(self, found: ReachedRuns) -> Runs:
        """The runs that were found, by their held segments; `sampled` has them as they are carried out."""
        return self._planned(found.z, found.selected)

    def _planned(self, z: Array, selected: NDArray[np.bool_] | None) -> Runs:
        held = self.coordinates.held(z)
        return held if selected is None else held.measuring(selected)

    def sampled(self, held: Runs) -> Runs:
        """Runs of held segments as they are sampled."""
        return self._whole.sampled(held)[0]

    def worth_of_all_samples(self, held: Runs, value: float) -> float:
        """What runs of held segments are worth, whose value by the samples of the search is given."""
        if self.coordinates is self._whole or not np.isfinite(value):
            return value
        found = self.objective
        of = found.plants, found.average, found.previous, found.criteria, found.settings
        whole = RunObjective(self.problem, self._whole, *of, tuning=self.tuning)
        return whole.of(whole.judged(TriedRuns(self.sampled(held))))

    def signals(self, z: Array) -> Mapping[str, tuple[tuple[Fact, ...], ...]]:
        """The numbers of profiles of runs (L, d), by input."""
        each = [self.coordinates.facts(one) for one in z]
        return FrozenMapping({name: tuple(one[name] for one in each) for name in each[0]})

    def _ends(self, held: Runs) -> bool:
        """Whether runs end at the prior mean, at the problem's own tolerance."""
        return not run_rows(self.problem, self.sampled(held), self.problem.theta, self._settings).status.any()

    def run(self, progress: Callable[[Progress], None] | None) -> StopReason:
        """Search to the end, or until it is late or interrupted; there are runs then in any case."""
        reason = StopReason.completed
        if progress is not None:
            self.clock.beat = lambda: progress(self._progress("searching"))
        try:
            if self.pool.interrupted:
                raise KeyboardInterrupt
            self._begin()
            self._climb(progress)
        except KeyboardInterrupt:
            reason = StopReason.interrupted
        except OutOfTime:
            reason = StopReason.time_limit
        with self.clock.pause():
            if not self._found:  # without runs there is nothing to return
                z = self.pool.chosen(self.n_runs, self._rng)
                self._tried(z, self._chosen_samples(z))
            elif reason != StopReason.completed and self.clock.left > self.tuning.left_for_last_trial * self._longest_trial:
                self._try_last()
        self.clock.beat, self.clock.share = None, 1.0
        self.clock.reserve = self.clock.cost("tangents", self.n_runs)  # of the evaluation
        return reason

    def _try_last(self) -> None:
        """Try the plants with the best of what climbs have come to since they did that."""
        reached = [one.reached for one in self._climbs if one.untried]
        if reached:
            z, selected, _ = max(reached, key=lambda of: of[2])
            with suppress(KeyboardInterrupt):
                self._tried(z, selected)

    def _begin(self) -> None:
        """Evaluate classical runs, and set how far runs keep from limits at first."""
        objective = self.objective
        easy: bool | None = None
        self._hurried = self._raced < self.n_starts
        if self._hurried:
            objective.looks = 1
        costly = self.clock.costly("tangents", self.tuning.costly_runs * len(objective.plants))
        if costly:  # what follows may take all of the time
            with self.clock.pause():
                z = self.pool.chosen(self.n_runs, self._rng)
                easy = self._tried(z, self._chosen_samples(z)).feasible
            self.clock.reserve = max(self.clock.reserve, 2 * self.clock.cost("tangents", self.n_runs))
        if objective.problem.model.in_core:
            self.clock.share = self.tuning.time_shares[1]
            classical, all_of_them = classical_runs(objective, self.n_runs, self.seed)
            if not all_of_them:
                self.left_out.append(CLASSICAL_RUNS)
            for name, z in classical.items():
                self.clock.share = 1.0
                self.classical[name] = self._tried(z, self._chosen_samples(z))
        self.clock.share = 1.0
        if easy is None:
            with self.clock.part(self.tuning.tightened_share):
                easy = self._easy()
        if easy:
            self.guard.first = 0.0
        else:
            objective.kappa = self.guard.first
            with self.clock.part(self.tuning.tightened_share):
                self.pool.tighten(self._rng)
        self.clock.check()

    def _easy(self) -> bool:
        """Whether enough plants can run the best single runs of the pool as they are: then limits hardly matter."""
        if self._share_of_plants is None or not self.objective.margins.exist:
            return True
        return all(self.guard.enough(share) for share in self.guard.each(self.pool.best(self.tuning.runs_looked_at)))

    def _climb(self, progress: Callable[[Progress], None] | None) -> None:
        """Race the best starts, and follow the winner to its end, and from there."""

        def report(one: Climb) -> None:
            if progress is not None and one.last is not None:
                self.clock.reported()
                progress(self._progress(f"log det {one.last.value:.3f}, best {self.best.value:.3f}"))

        starts = [self.pool.chosen(self.n_runs, self._rng) for _ in range(self.n_starts)]
        starts += [found.z for found in self.classical.values()]
        worth = self.objective.values(np.stack(starts)) if self.region.samples is None else np.array(list(map(self._worth, starts)))
        order = np.argsort(-worth, kind="stable")[: self._raced]
        ways = self._tried, self._chosen_samples, self._others, self._rng
        self._climbs = [Climb(self.objective, self.guard, starts[k], *ways, hurried=self._hurried) for k in order]
        if not self._hurried and (able := self._able_start()) is not None:
            self._climbs[-1] = Climb(self.objective, self.guard, able, *ways, kappa=self._kappa_of(able))
        self.clock.share = self.tuning.time_shares[2]
        try:
            race(self.objective, self._climbs, report)
        except OutOfTime:
            self.clock.share = 1.0
            self.clock.check()
        self.clock.share = 1.0
        with self.clock.part(self.tuning.approach_share if self._hurried else 1.0):
            self._approach()
        for one in sorted(self._climbs, key=lambda one: one.worth, reverse=True):
            while not one.ended:
                one.step()
            if one.best is not None and one.best.feasible:
                break  # otherwise another one may come to runs that enough plants can run
        max(self._climbs, key=lambda one: (-np.inf,) if one.best is None else one.best.worth).go_on()
        self._approach()

    @property
    def _raced(self) -> int:
        """How many starts race: fewer than there are where there is no time for a first step of each."""
        tuning = self.tuning
        of_iteration = len(self.coordinates.quiet) + len(tuning.ascent.reach_factors) * len(tuning.ascent.step_shares)
        of_step = self.n_runs * len(self.objective.plants) * tuning.ascent_iterations * of_iteration
        affordable = self.clock.affordable("tangents", tuning.race_share) * self.threads / of_step
        return max(1, int(min(self.n_starts, affordable)))

    def _progress(self, message: str) -> Progress:
        value = self.best.value if self._found else None
        return Progress(len(self.ends), self.n_starts, value, message, self.clock.seconds)

    def _approach(self) -> None:
        """Go from the best runs that enough plants can run towards better ones, where limits matter."""
        if not self._found:
            return
        best = self.best
        if self.guard.first == 0 or self.region.samples is not None or not best.feasible:
            return
        better = [found for found in [*self.ends, *self.classical.values()] if found.value > best.value]
        better += sorted((found for found in self._found if found.value > best.value), key=lambda found: -found.value)
        targets = [found.z for found in better[: self.tuning.runs_looked_at]]
        targets += list(self.pool.best_numbers(self.tuning.runs_looked_at)[:, None]) if self.n_runs == 1 else []
        self.objective.kappa = 0.0

        def hopeful(z: Array, value: float) -> bool:
            return float(self.objective.values(z[None])[0]) > value

        tuning = self.tuning
        approach(best, targets, lambda z: self._tried(z, None), hopeful, tuning.climb_least_gain, tuning.halvings_within)

    def _able_start(self) -> Array | None:
        """Free numbers of the best of the pool's runs that enough plants can run as they are, whatever they pay for limits."""
        if self.guard.first == 0 or self.region.samples is not None:
            return None
        able = self.pool.able(self.guard, self.tuning.most_tightened)
        if not len(able):
            return None
        z = self.pool.chosen(self.n_runs, self._rng, among=able)
        self._tried(z, None)
        return z

    def _kappa_of(self, z: Array) -> float:
        """The distance from limits that runs keep, up to that to begin with: they hardly pay for it."""
        objective = self.objective
        for share in (1.0, 0.75, 0.5, 0.25):
            objective.kappa = share * self.guard.first
            if objective.judged(objective.tried(z, None)).costs.sum() <= self.tuning.most_start_cost:
                break
        else:
            objective.kappa = 0.0
        return objective.kappa

    def _worth(self, z: Array) -> float:
        return float(self.objective.values(z[None], self._chosen_samples(z))[0])

    def _others(self) -> Array:
        """Free numbers of the pool's best runs, and of the best of all starts."""
        return np.concatenate([self.pool.best_numbers(self.tuning.copied_from), *(found.z for found in self.ends)])

    def _tried(self, z: Array, selected: NDArray[np.bool_] | None) -> ReachedRuns:
        """What runs are worth without costs, and how many plants can run them.

        At the problem's own tolerance they may touch a surface that they just miss at the search's, and have no derivative there.
        """
        began = self.clock.seconds
        found = self._judged(z, selected)
        self._longest_trial = max(self._longest_trial, self.clock.seconds - began)
        self._found.append(found)
        return found

    def _judged(self, z: Array, selected: NDArray[np.bool_] | None) -> ReachedRuns:
        planned = self._planned(z, selected)
        if not self._ends(planned):
            return ReachedRuns(z, selected, -np.inf, 0.0, False, False, (False, False, -np.inf))
        judged = self.objective.judged(self.objective.tried(z, selected))
        value = self.objective.of(judged) + float(judged.costs.sum())
        share = self.guard.share(planned)
        enough = self.guard.enough(share)
        regular = bool(np.isfinite(value))
        if regular and self.objective.criteria[0].of_all:
            regular = determine_all(judged.matrices.sum(axis=0) + self.objective.previous)
        worth = value - self.tuning.value_per_sigma * max(0.0, self.guard.short(share)) * (not enough)
        return ReachedRuns(z, selected, value, share, enough, regular, (regular, enough, worth))

    def tidy(self, found: ReachedRuns) -> tuple[Runs, float]:
        """The held segments of the runs that were found, with round numbers where that changes next to nothing, and what they
        are worth then."""
        runs, objective = self.planned(found), self.objective
        if self.singular or not found.regular:
            return runs, found.value
        # No classical run that enough plants can run becomes better than it.
        rivals = [one.value for one in self.classical.values() if one.value <= found.value]
        objective.kappa = 0.0

        def worth(designs: list[Runs]) -> Array:
            judged = objective.judged(TriedRuns(self.coordinates.sampled(Runs.join(designs))[0]))
            shape = len(designs), len(runs)
            total = judged.matrices.reshape(*shape, *judged.matrices.shape[1:]).sum(axis=1) + objective.previous
            return np.where(judged.ok.reshape(shape).all(axis=1), objective.averages(total), -np.inf)

        def able(design: Runs) -> bool:
            return self._ends(design) and (not found.feasible or self.guard.enough(self.guard.share(design)))

        least = max([found.value - self.tuning.most_lost_by_rounding, *rivals])
        try:
            plan = tidied(runs, self.region, self.problem.model, worth, able, least, self.tuning)
            return plan, float(worth([plan])[0]) if plan is not runs else found.value
        except OutOfTime:
            return runs, found.value

    def _chosen_samples(self, z: Array) -> NDArray[np.bool_] | None:
        if self.region.samples is None:
            return None
        return best_samples(self.objective, self.coordinates.runs(z), self.region.samples)
