"""Runs, as the search finds them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from ...basics.field_checks import Extents
from ...basics.stop_reason import StopReason
from ...basics.values import FrozenMapping
from ...information.evaluation import Evaluation
from ...information.feasibility import Feasibility
from ...information.problem import DesignProblem
from ...points.profiles import Fact
from ...points.runs import Runs
from ..goal.criteria import Criterion
from ..goal.goal_criterion import criterion_of_design
from .scenario_values import ScenarioValues
from .settings import RunSettings


@dataclass(frozen=True, eq=False, repr=False)
class FoundRuns:
    """The runs that `design_runs` found, with what is needed to judge and to repeat them.

    Attributes
    ----------
    problem : DesignProblem
    settings : RunSettings
    runs : Runs
    evaluation : Evaluation
        Of the runs, and of previous points and runs with them, at the prior mean.
    log_det : float
        What was maximised: log det F in its sum form, parameters standardised by the prior, or its average over the scenarios of a
        criterion over the prior. -inf where no runs of the region determine all parameters. With another criterion than "D" log phi
        times its `level` instead of log det F, such as the negative logarithm of the trace of F^-1.
    ends : tuple of float
        The value that each start of the search came to, in the order in which they were followed; some are given up on the way.
    again : int
        How many of them are as good as the best one.
    feasibility : Feasibility
        Which of a thousand plants that the search has not seen can run the whole design, and why others cannot.
    stop_reason : StopReason
    drawn : int
    rejected : mapping of reason to int
        Runs drawn at random for the search, and those of them that do not reach their ends, by status, and of "left_domain" the
        limit.
    seconds : float
    classical : mapping of profile to float
        The same of the best of a hundred random runs of each classical profile, steps for one, whether plants can run them or not.
    classical_shares : mapping of profile to float
        The share that can run these, of the plants of `feasibility`.
    n_kept : int
        The first so many runs were given, and stay.
    scenarios : ScenarioValues or None
        What the runs are worth in the scenarios of a criterion over the prior; None where it is of the prior mean.
    signals : mapping of input to tuple of runs
        The numbers of each input that follows a profile, such as frequencies and amplitudes, of each run that was designed.
    ridge : float
        Share of the prior's information that was added to F where no runs of the region determine all parameters, to compare
        runs; else 0. No figure of the design contains it.
    left_out : tuple of str
        What the time limit left no time for, such as classical runs to compare with.
    """

    problem: DesignProblem
    settings: RunSettings
    runs: Runs
    evaluation: Evaluation
    log_det: float
    ends: tuple[float, ...]
    again: int
    feasibility: Feasibility
    stop_reason: StopReason
    drawn: int
    rejected: Mapping[str, int]
    seconds: float
    classical: Mapping[str, float] = FrozenMapping({})
    classical_shares: Mapping[str, float] = FrozenMapping({})
    scenarios: ScenarioValues | None = None
    n_kept: int = 0
    ridge: float = 0.0
    signals: Mapping[str, tuple[tuple[Fact, ...], ...]] = FrozenMapping({})
    left_out: tuple[str, ...] = ()

    _EXTENTS: ClassVar[Extents] = {
        "runs.x0": ("n", "problem.model.states"),
        "runs.u": ("n", "segments", "problem.model.inputs"),
        "evaluation.parameters": ("problem.estimated",),
        "classical_shares": ("classical",),
        "scenarios.standard_errors": ("problem.estimated",),
    }

    @cached_property
    def criterion(self) -> Criterion:
        """The criterion as a function of information matrices; where F is singular, "A", "E" and "ME" are of the rest."""
        return criterion_of_design(self.problem, self.settings.goal, self.evaluation)

    @property
    def value(self) -> float:
        """The criterion at the prior mean with all measurements, previous ones too: at `Evaluation.information`."""
        return self.criterion.value(self.evaluation.information)

    @property
    def points(self) -> Runs:
        """The runs, under the name that designs of points have for them."""
        return self.runs

    @property
    def feasible(self) -> bool:
        """Whether at least the required share of the plants can run the design, of those that `feasibility` has tried."""
        return self.feasibility.share >= (self.settings.goal.confidence or 0.0)
