"""What every search for points has: the problem, the criterion, the best design so far, and what it becomes in the end."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from ...basics.stop_reason import StopReason
from ...basics.values import Array, FrozenMapping
from ...basics.work_clock import LANES, Clock, OutOfTime
from ...engine import _core
from ...information.candidates import CandidateSource
from ...information.evaluation import NEARBY, Evaluation, evaluate_information, finite_fisher
from ...information.output_covariance import OutputCovariance, output_covariance
from ...information.point_information import PointInformation
from ...information.problem import DesignProblem
from ...points.experiments import Experiments
from ...show.numbers import counted
from ...show.progress import Progress
from ..candidates.candidate_rows import CandidateRows
from ..goal.criteria import Criterion
from ..goal.estimability import not_estimable
from ..goal.estimable_space import RIDGE, Estimable, estimable
from ..goal.goal_criterion import criterion_of, known_beforehand, prior_rows
from ..goal.over_prior import Scenarios
from ..goal.scenario_average import Average
from ..results.efficiency import Efficiency
from ..results.found_design import FoundDesign, TraceRecord
from ..results.scenario_values import ScenarioValues, scenario_values
from ..results.settings import ExchangeSettings
from .candidate_archive import CandidateArchive
from .point_margins import Away
from .tuning import PointSearchTuning


class Incumbent(NamedTuple):
    """The best design so far; replaced as a whole, so that an interrupt cannot tear it."""

    information: PointInformation
    prepared: PointInformation
    log_det: float


@dataclass
class PointSearch:
    """The state of one search; it begins with random points."""

    problem: DesignProblem
    settings: ExchangeSettings
    threads: int
    previous: PointInformation | None = None  # stays, beside whatever points are searched for; the kept ones stand last
    kept: Experiments | None = None  # points of the design that are not searched for
    scenarios: Scenarios | None = None  # over which is maximised; else it is the prior mean
    clock: Clock | None = None  # default: its own
    tuning: PointSearchTuning = field(default_factory=PointSearchTuning)
    trace: list[TraceRecord] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.time = Clock(self.settings.method.time_limit) if self.clock is None else self.clock
        self.left_out: list[str] = []  # what there was no time for
        self.ends: tuple[float, ...] = ()  # what each of several starts came to
        over = self.scenarios
        self.over = Scenarios((self.problem,), Average.of_all(1), (self.previous,)) if over is None else over
        self.unrestricted: tuple[Criterion, ...] = tuple(map(self._criterion, self.over.problems))
        self.criteria = self.unrestricted  # later restricted to what the candidates can determine
        self.space: Estimable | None = None  # what the candidates determine at the prior mean, once it was computed
        self.spaces: tuple[Estimable, ...] | None = None  # what the pools of a search determine in each scenario
        self.ridge = 0.0  # what was added to F while designs were singular
        self.of_prior = known_beforehand(self.problem, self.settings.goal)
        archive, tried = self.tuning.archive, self.tuning.limit.tried_per_point * self.count
        self.seen = CandidateArchive(
            self.problem,
            self.threads,
            self.criteria,
            self.of_prior,
            archive,
            self.time,
            tried,
        )
        self.away: Away | None = None
        if self.settings.goal.share_of_plants is not None:
            self.away = Away(self.problem, self.settings, self.seen.validity, self.tuning.plants)
        keep = self.seen.add if self.settings.method.references and self.problem.noise is not None else None
        elsewhere, rng = () if over is None else over.problems, np.random.default_rng(self.settings.seed)
        self.source = CandidateSource(self.problem, rng, self.threads, keep, elsewhere, self.seen.validity, self.time)
        with self.time.pause():  # without points there is nothing to return
            start = self._first()
        self.time.reserve = self._reserve()
        self.d: OutputCovariance = output_covariance(self.problem, self._with_previous(start), self.threads)
        self._previous = [None if known is None else self.d.prepare(known) for known in self.over.previous]
        self.best = self._incumbent(start)
        self._record(0, False)

    def _criterion(self, problem: DesignProblem) -> Criterion:
        return criterion_of(problem, self.settings.goal, self.threads)

    @property
    def at_mean(self) -> Criterion:
        """What would be maximised at the prior mean alone."""
        if self.scenarios is None:
            return self.criteria[0]
        goal = self._criterion(self.problem)
        return goal if self.space is None else goal.restricted_to(self.space)

    @property
    def _ridge(self) -> float:
        if np.isfinite(self.best.log_det):
            return 0.0
        self.ridge = RIDGE
        return RIDGE

    def find_estimable_space(self) -> Estimable:
        """What points of the region determine together; the bound is then of that, for a design that determines as much."""
        if self.space is None:
            rng = np.random.default_rng([self.settings.seed, 3])
            source = CandidateSource(self.problem, rng, self.threads, validity=self.seen.validity, clock=self.time)
            with self.time.pause():  # what there is time for, and a block at least
                drawn = source.draw(self._space_candidates)
            information = self._with_previous(PointInformation.join([self.best.information, drawn]))
            rows = self.d.prepare(information).sensitivity
            size = np.sqrt(np.square(rows).mean(axis=(0, 2), keepdims=True))  # as F may be of another D than that of the noise
            self.space = estimable(CandidateRows(rows / np.where(size > 0, size, 1.0)).triangle())
            if self.scenarios is None:
                self.criteria = self.seen.criteria = (self.unrestricted[0].restricted_to(self.space),)
        return self.space

    def _first(self) -> PointInformation:
        return self.source.draw_confirmed(self.count)

    def run(self, progress: Callable[[Progress], None] | None) -> StopReason:
        """Search until something ends it, and return why."""
        settings, idle = self.settings, 0
        if progress is not None:
            self.time.beat = lambda: progress(self._progress(self.trace[-1].iteration))
        try:
            for iteration in range(1, settings.max_iterations + 1):
                exchanged = self._advance(iteration)
                if exchanged is None:
                    return StopReason.converged
                idle = 0 if exchanged else idle + 1
                self._record(iteration, exchanged)
                if progress is not None:
                    self.time.reported()
                    progress(self._progress(iteration))
                if settings.method.patience is not None and idle >= settings.method.patience:
                    return StopReason.patience
                if self._late():
                    return StopReason.time_limit
        except OutOfTime:
            self._record(self.trace[-1].iteration + 1, False)
            return StopReason.time_limit
        except KeyboardInterrupt:
            return StopReason.interrupted
        return StopReason.max_iterations

    def _progress(self, iteration: int) -> Progress:
        seconds = self.seconds
        message = self._message(iteration, seconds)
        return Progress(iteration, self.settings.max_iterations, self.best.log_det, message, seconds)

    def _reserve(self) -> float:
        """Seconds for what follows the search: its evaluation away from the prior mean, and what the design is compared with."""
        limit, tuning = self.settings.method.time_limit or 0.0, self.tuning.limit
        moved = self.time.cost("sensitivities", 4 * self.problem.n_unknowns * self.settings.n_experiments)
        most = tuning.evaluation_share * limit
        seconds = moved if moved < most else 0.0  # else it is left out
        if self.settings.method.references:
            seconds += min(
                tuning.references_share * limit, self.time.cost("sensitivities", tuning.references) + tuning.bound_seconds
            )
        return seconds + tuning.least_share * limit

    @property
    def _space_candidates(self) -> int:
        most = self.time.affordable("sensitivities", self.tuning.limit.space_share)
        return int(min(self.tuning.space_candidates, max(LANES, most)))

    def _message(self, iteration: int, seconds: float) -> str:
        if iteration == self.settings.max_iterations:
            return "proving how good it is"
        what = "log det" if self.settings.goal.criterion == "D" else "log of the criterion"
        rate = self.source.drawn / seconds if seconds > 0 else 0.0
        return f"{what} {self.best.log_det:.3f}, {rate:.0f} points/s"

    def _advance(self, iteration: int) -> bool | None:
        """One iteration: whether the best design is another one after it; None where nothing is left to try."""
        raise NotImplementedError

    def _late(self) -> bool:
        return self.time.late()

    @property
    def seconds(self) -> float:
        return self.time.seconds

    def _record(self, iteration: int, exchanged: bool) -> None:
        self.trace.append(TraceRecord(iteration, self.best.log_det, bool(exchanged), self.source.drawn, self.seconds))

    def _incumbent(self, information: PointInformation) -> Incumbent:
        return Incumbent(information, self.d.prepare(information), self._worth(information, 0.0))

    def _worth(self, information: PointInformation, ridge: float) -> float:
        """What is maximised: log det F or another criterion, or its average over the scenarios."""
        of_all = [self._log_det(self.d.prepare(one), ridge, s) for s, one in enumerate(information.everywhere)]
        return float(self.over.average.value(np.array(of_all)))

    def _log_det(self, prepared: PointInformation, ridge: float, scenario: int = 0) -> float:
        known, own = self._previous[scenario], len(prepared) + (0 if self.previous is None else len(self.previous))
        share = 1.0 if known is None else (len(known) + len(prepared)) / own  # a previous point may be none in a scenario
        return self._phi(self._accumulate(prepared, scenario), ridge, share, scenario, 2 / own * self.of_prior)

    def _accumulate(self, prepared: PointInformation, scenario: int = 0) -> _core.FisherAccumulator:
        """The previous points, and these."""
        known = self._previous[scenario]
        return self.d.accumulate(prepared if known is None else PointInformation.join([known, prepared]))

    def _with_previous(self, information: PointInformation) -> PointInformation:
        return information if self.previous is None else PointInformation.join([self.previous, information])

    def _phi(
        self,
        accumulator: _core.FisherAccumulator,
        ridge: float,
        share: float = 1.0,
        scenario: int = 0,
        known: Array | float = 0.0,
    ) -> float:
        fisher = share * finite_fisher(accumulator.fisher(accumulator.output_covariance(self.d.given, self.d.pooled)))
        return self.criteria[scenario].objective(fisher + known + ridge * np.eye(len(fisher)))

    def under_noise(self) -> Evaluation | None:
        if self.problem.noise is None:
            return None
        information = self._with_previous(self.best.information)
        d = output_covariance(self.problem, information, self.threads, "noise")
        known = prior_rows(self.problem, self.settings.goal)
        found = evaluate_information(self.problem, information, d, self.threads, known, self.time)
        if found.without_nearby:
            self.left_out.append(NEARBY)
        return found

    @property
    def count(self) -> int:
        """Points that are searched for."""
        return self.settings.n_experiments - (0 if self.kept is None else len(self.kept))

    def evaluation(self, under_noise: Evaluation | None) -> Evaluation:
        """Under the D of the criterion, which may be that of the noise."""
        if under_noise is not None and self.d.kind == "noise":
            return under_noise
        information = self._with_previous(self.best.information)
        return evaluate_information(self.problem, information, self.d, self.threads)

    def found(
        self,
        stop_reason: StopReason,
        evaluation: Evaluation,
        under_noise: Evaluation | None,
        efficiency: Efficiency | None,
        previous_left_out: Mapping[str, int],
    ) -> FoundDesign:
        own, n_kept = self.best.information.experiments, 0 if self.kept is None else len(self.kept)
        return FoundDesign(
            problem=self.problem,
            settings=self.settings,
            points=own if self.kept is None else Experiments.join([self.kept, own]),
            evaluation=evaluation,
            under_noise=under_noise,
            efficiency=efficiency,
            trace=tuple(self.trace),
            rejected=FrozenMapping(dict(self.source.rejected)),
            drawn=self.source.drawn,
            accepted=self.source.accepted,
            stop_reason=stop_reason,
            seconds=self.seconds,
            n_previous=(0 if self.previous is None else len(self.previous)) - n_kept,
            n_kept=n_kept,
            previous_left_out=previous_left_out,
            scenarios=self._scenario_values(),
            not_estimable=() if self.space is None else not_estimable(self.problem, self.space),
            ridge=self.ridge,
            ends=self.ends or (self.best.log_det,),
            again=self._again,
            left_out=(*self._not_all_nodes(), *self.left_out),
        )

    def _not_all_nodes(self) -> Iterator[str]:
        plants, problem = self.seen.validity.plants, self.problem
        if plants is not None:
            nodes = counted(problem.rule.size(problem.prior), "node")
            yield f"the {nodes} of the rule: points were tried on {plants} plants of the prior in their place"

    @property
    def worth(self) -> tuple[bool, int, float]:
        """What searches are compared by: whether enough plants can run the design, how much it determines, and the criterion."""
        return self.for_enough_plants, self.criteria[0].level, self.best.log_det

    @property
    def for_enough_plants(self) -> bool:
        """Whether as many plants as are required can run the design, of those that were tried."""
        return True

    @property
    def _again(self) -> int:
        least = self.best.log_det - self.tuning.agreement_per_parameter * self.criteria[0].level
        return max(1, sum(end >= least for end in self.ends))

    def _scenario_values(self) -> ScenarioValues | None:
        if self.scenarios is None:
            return None
        problems, total, evaluations = self.over.problems, len(self._with_previous(self.best.information)), []
        scenarios = zip(problems, self.over.previous, self.best.information.everywhere, self.criteria, strict=True)
        for problem, known, own, criterion in scenarios:
            everything = own if known is None else PointInformation.join([known, own])
            evaluation = evaluate_information(problem, everything, self.d, self.threads, prior_rows(problem, self.settings.goal))
            log_det = evaluation.log_det
            if criterion.of_all and evaluation.rank == criterion.level:
                log_det = float(evaluation.log_det_estimable or 0.0)
            scale = evaluation.rank * float(np.log(len(everything) / total))
            evaluations.append(replace(evaluation, log_det=log_det + scale))
        value = None if self.criteria[0].plain else self.best.log_det
        return scenario_values(problems, self.over.average, evaluations, value)
