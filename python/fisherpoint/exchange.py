"""The exchange algorithm, Algorithm 1.

Lines 11 and 13 print "arg min"; the reading is that the candidate with the largest Phi enters, and the point whose removal
leaves the largest Phi leaves. That may be the candidate itself, so Phi never falls.

Random candidates alone come close to an optimum only slowly, above all where it lies on bounds of the region, as it mostly does.
So some iterations end by drawing candidates near every point of the design; a point gives way to the best of its own where Phi
rises.

Where D needs the predictive covariance of every candidate, that is what takes the time. Screening orders the candidates by Phi with
their linearized covariances, which come with the sensitivities, and gives the rule only the best few.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from . import _core
from .candidates import CandidateSource
from .design import Design, ExchangeSettings, TraceRecord
from .efficiency import Efficiency, efficiency_of, random_designs
from .evaluation import Evaluation, evaluate_information
from .information import PointInformation, with_linearized_covariance
from .output_covariance import Criterion, criterion, needs_covariances
from .problem import DesignProblem
from .quantity import Array, FrozenMapping, IntArray
from .trajectories import resolve_threads

SHORTLIST = 10
"""Candidates that screening leaves for the rule; the best under the rule is nearly always among them (`bench/screening.py`)."""

MOVE_EVERY = 4
"""Iterations after which candidates are drawn near the points of the design: many at once cost less than a few each time."""

LEAST_GAIN = 1e-6
"""What log det F must gain for a point to be moved; less would be moved for ever."""

RIDGE = 1e-9
"""Share of the prior's information that is added to F as long as a design is singular, so that singular designs can be told
apart."""


class Progress(NamedTuple):
    """What the search reports after each iteration."""

    iteration: int
    max_iterations: int
    log_det: float
    exchanges: int
    drawn: int
    rejected: int
    seconds: float


def exchange(
    problem: DesignProblem,
    n_experiments: int = 12,
    n_candidates: int = 50,
    max_iterations: int = 200,
    seed: int = 0,
    threads: int | None = None,
    progress: Callable[[Progress], None] | None = None,
    *,
    patience: int | None = None,
    time_limit: float | None = None,
    max_redraws: int = 1,
    references: bool = True,
    screen: bool = True,
    local: float = 0.5,
) -> Design:
    """Find the design with the largest det F by exchanging points for random candidates, Algorithm 1.

    Parameters
    ----------
    problem : DesignProblem
        With a region.
    n_experiments, n_candidates : int
        L points, M candidates per draw.
    max_iterations : int
    seed : int
        The same seed gives the same design, for any number of threads.
    threads : int, optional
        Default: every core.
    progress : callable, optional
        Called with a `Progress` once per iteration.
    patience : int, optional
        Stop after so many iterations in a row without an exchange.
    time_limit : float, optional
        Stop after so many seconds.
    max_redraws : int
        How often candidates are drawn again where none improves Phi (lines 6 to 12); then the best of them is tried all the same.
    references : bool
        Also find what the design is compared with (`Efficiency`).
    screen : bool
        Where the output covariance is "pooled" or "pointwise": order candidates by their linearized covariances and take the rule
        for the best few only. False takes it for all, as Algorithm 1 is written.
    local : float
        Candidates near the points of the design that are drawn beside the n_candidates, as a share of these over all iterations:
        they come every fourth time, at least one for each point. 0 for none: Algorithm 1 alone.

    Returns
    -------
    Design
        Ctrl-C during the search returns the best design so far, with stop_reason "interrupted".

    Raises
    ------
    ValueError
        For misuse, a region in which hardly a point survives, or a singular output covariance.
    """
    if not isinstance(problem, DesignProblem):
        raise TypeError(f"problem: expected a DesignProblem, given {type(problem).__name__}")
    settings = ExchangeSettings(
        n_experiments, n_candidates, max_iterations, seed, patience, time_limit, max_redraws, references, screen, local
    )
    if progress is not None and not callable(progress):
        raise TypeError(f"progress: expected a function, given {type(progress).__name__}")
    threads = resolve_threads(threads)
    search = ExchangeSearch(problem, settings, threads)
    stop_reason = search.run(progress)
    efficiency = None
    under_noise = search.under_noise()
    if settings.references and stop_reason != "interrupted":
        try:
            efficiency = _references(search, under_noise)
        except KeyboardInterrupt:
            stop_reason = "interrupted"
    return search.design(stop_reason, under_noise, efficiency)


class _Incumbent(NamedTuple):
    """The best design so far; replaced as a whole, so that an interrupt cannot tear it."""

    information: PointInformation
    prepared: PointInformation
    log_det: float


@dataclass
class ExchangeSearch:
    """The state of one run of Algorithm 1."""

    problem: DesignProblem
    settings: ExchangeSettings
    threads: int
    trace: list[TraceRecord] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._started = time.perf_counter()
        self.source = CandidateSource(self.problem, np.random.default_rng(self.settings.seed), self.threads)
        self.needs_covariances = needs_covariances(str(self.problem.output_covariance))
        start = self.source.draw_confirmed(self.settings.n_experiments)
        self.criterion: Criterion = criterion(self.problem, start, self.threads)
        prepared = self.criterion.prepare(start)
        self.best = _Incumbent(start, prepared, self._log_det(prepared, 0.0))
        self._record(0, False)

    def run(self, progress: Callable[[Progress], None] | None) -> str:
        settings, exchanges, idle = self.settings, 0, 0
        try:
            for iteration in range(1, settings.max_iterations + 1):
                exchanged = self._iterate()
                if iteration % MOVE_EVERY == 0:
                    exchanged |= self._move()
                exchanges += exchanged
                idle = 0 if exchanged else idle + 1
                self._record(iteration, exchanged)
                if progress is not None:
                    progress(
                        Progress(
                            iteration,
                            settings.max_iterations,
                            self.best.log_det,
                            exchanges,
                            self.source.drawn,
                            self.source.rejected.total(),
                            self.seconds,
                        )
                    )
                if settings.patience is not None and idle >= settings.patience:
                    return "patience"
                if settings.time_limit is not None and self.seconds >= settings.time_limit:
                    return "time_limit"
        except KeyboardInterrupt:
            return "interrupted"
        return "max_iterations"

    @property
    def seconds(self) -> float:
        return time.perf_counter() - self._started

    def _record(self, iteration: int, exchanged: bool) -> None:
        self.trace.append(TraceRecord(iteration, self.best.log_det, bool(exchanged), self.source.drawn, self.seconds))

    def _log_det(self, prepared: PointInformation, ridge: float) -> float:
        return self._phi(self.criterion.accumulate(prepared), ridge)

    def _phi(self, accumulator: _core.FisherAccumulator, ridge: float) -> float:
        fisher = accumulator.fisher(accumulator.output_covariance(self.criterion.given, self.criterion.pooled))
        return _core.log_det(fisher + ridge * np.eye(len(fisher)))

    def _iterate(self) -> bool:
        """Lines 6 to 14: draw candidates until one improves Phi, let the best enter and the least useful point leave."""
        ridge = 0.0 if np.isfinite(self.best.log_det) else RIDGE
        accumulator = self.criterion.accumulate(self.best.prepared)
        phi = self._phi(accumulator, ridge)
        best_phi, entering = -np.inf, None
        for _ in range(1 + self.settings.max_redraws):
            candidates, confirmed = self._candidates(accumulator, ridge)
            phis = self._phis_with(accumulator, candidates, ridge)
            for m in np.argsort(-phis, kind="stable"):
                if not phis[m] > best_phi:
                    break
                exchanged = self._without_least(accumulator, candidates[m : m + 1], ridge)
                # A candidate that would leave at once need not be tried on the nodes.
                if exchanged is None or confirmed or len(self.source.confirm(candidates[m : m + 1])):
                    best_phi, entering = phis[m], exchanged
                    break
            if best_phi > phi:
                break
        if entering is None:
            return False
        prepared = self.criterion.prepare(entering)
        log_det = self._log_det(prepared, 0.0)
        if not (log_det if ridge == 0.0 else self._log_det(prepared, ridge)) > phi:  # the same to rounding
            return False
        self.best = _Incumbent(entering, prepared, log_det)
        return True

    def _move(self) -> bool:
        """Draw candidates near the points; in the place of each point put the best of its own where that raises Phi."""
        settings, start = self.settings, self.best.information
        if not settings.local or not np.isfinite(self.best.log_det):
            return False
        each = max(1, round(MOVE_EVERY * settings.local * settings.n_candidates / len(start)))
        candidates, near = self.source.draw_near(start.points, each)
        chosen, places = self._nearby(candidates, near)
        moved = False
        for m, k in enumerate(places):
            rows = np.arange(len(start))
            rows[k] = len(start)
            information = PointInformation.join([self.best.information, chosen[m : m + 1]])[rows]
            prepared = self.criterion.prepare(information)
            log_det = self._log_det(prepared, 0.0)
            if log_det > self.best.log_det + LEAST_GAIN:
                self.best, moved = _Incumbent(information, prepared, log_det), True
        return moved

    def _nearby(self, candidates: PointInformation, near: IntArray) -> tuple[PointInformation, IntArray]:
        """For each point the best candidate near it, where it alone would raise Phi and is valid on all nodes; and which points."""
        accumulator, best = self.criterion.accumulate(self.best.prepared), self.best.prepared
        if self.needs_covariances:
            candidates = with_linearized_covariance(self.problem, candidates)
        chosen = []
        for k in range(len(best)):
            own = np.flatnonzero(near == k)
            if len(own):
                sensitivity, covariance = best.sensitivity[k : k + 1], best.covariance[k : k + 1]
                accumulator.remove(sensitivity, covariance)
                phis = self._phis_with(accumulator, candidates[own], 0.0)
                accumulator.add(sensitivity, covariance)
                if phis.max() > self.best.log_det + LEAST_GAIN:
                    chosen.append(own[np.argmax(phis)])
        if not chosen:
            return candidates[:0], near[:0]
        information, valid = self.source.confirmed(candidates[chosen])
        return information[valid], near[chosen][valid]

    def _candidates(self, accumulator: _core.FisherAccumulator, ridge: float) -> tuple[PointInformation, bool]:
        """Candidates for one draw, and whether they are valid on all nodes and carry the rule's covariances."""
        if not self.needs_covariances:
            return self.source.draw(self.settings.n_candidates), False
        if not self.settings.screen:
            return self.source.draw_confirmed(self.settings.n_candidates), True
        candidates = with_linearized_covariance(self.problem, self.source.draw(self.settings.n_candidates))
        phis = self._phis_with(accumulator, candidates, ridge)
        return self.source.confirm(candidates[np.argsort(-phis, kind="stable")[:SHORTLIST]]), True

    def _phis_with(self, accumulator: _core.FisherAccumulator, candidates: PointInformation, ridge: float) -> Array:
        """log det F with each candidate beside the design, (K,)."""
        prepared = self.criterion.prepare(candidates)
        phis: Array = accumulator.log_det_with(
            prepared.sensitivity, prepared.covariance, self.criterion.given, self.criterion.pooled, ridge
        )
        return phis

    def _without_least(
        self, accumulator: _core.FisherAccumulator, candidate: PointInformation, ridge: float
    ) -> PointInformation | None:
        """The design with the candidate in the place of the point that is missed least; None where that is the candidate."""
        added = self.criterion.prepare(candidate)
        sensitivity = np.concatenate([self.best.prepared.sensitivity, added.sensitivity])
        covariance = np.concatenate([self.best.prepared.covariance, added.covariance])
        accumulator.add(added.sensitivity, added.covariance)
        phis = accumulator.log_det_without(sensitivity, covariance, self.criterion.given, self.criterion.pooled, ridge)
        accumulator.remove(added.sensitivity, added.covariance)
        leaving = int(np.argmax(phis))
        last = len(phis) - 1
        if leaving == last or not phis[leaving] > phis[last]:
            return None
        rows = np.arange(last)
        rows[leaving] = last
        return PointInformation.join([self.best.information, candidate])[rows]

    def under_noise(self) -> Evaluation | None:
        if self.problem.noise_std is None:
            return None
        information = self.best.information
        return evaluate_information(self.problem, information, criterion(self.problem, information, self.threads, "noise"))

    def design(self, stop_reason: str, under_noise: Evaluation | None, efficiency: Efficiency | None) -> Design:
        return Design(
            problem=self.problem,
            settings=self.settings,
            points=self.best.information.points,
            evaluation=evaluate_information(self.problem, self.best.information, self.criterion),
            under_noise=under_noise,
            efficiency=efficiency,
            trace=tuple(self.trace),
            rejected=FrozenMapping(dict(self.source.rejected)),
            drawn=self.source.drawn,
            accepted=self.source.accepted,
            stop_reason=stop_reason,
            seconds=self.seconds,
        )


def _references(search: ExchangeSearch, under_noise: Evaluation | None) -> Efficiency:
    """Find the noise-only optimum with the same settings and another seed, and the median random design."""
    if under_noise is None:
        return efficiency_of(search.problem, search.criterion, search.best.log_det, None, None, None)
    problem = search.problem.replace(output_covariance="noise")
    settings = search.settings
    other = ExchangeSettings(
        settings.n_experiments,
        settings.n_candidates,
        settings.max_iterations,
        settings.seed + 1,
        settings.patience,
        settings.time_limit,
        0,
        False,
        False,
        settings.local,
    )
    reference = ExchangeSearch(problem, other, search.threads)
    if reference.run(None) == "interrupted":
        raise KeyboardInterrupt
    random = random_designs(problem, settings.n_experiments, settings.seed, search.threads)
    return efficiency_of(
        search.problem, search.criterion, search.best.log_det, under_noise.log_det, reference.best.log_det, float(np.median(random))
    )
