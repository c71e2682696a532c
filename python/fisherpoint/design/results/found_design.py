"""What a search finds: points, how they were found, and what they are worth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from ...basics.field_checks import Extents
from ...basics.stop_reason import StopReason
from ...basics.values import FrozenMapping
from ...information.feasibility import Feasibility, feasibility
from ...points.runs import Runs
from ..goal.criteria import Criterion
from ..goal.goal_criterion import criterion_of_design
from .efficiency import Efficiency
from .evaluated_points import EvaluatedPoints
from .scenario_values import ScenarioValues
from .settings import ExchangeSettings

DRAWS = 1000
"""Plants that a search has not seen, on which its design is tried at the end."""

UNSEEN = 1_000_003
"""Added to the seed for these plants."""


@dataclass(frozen=True)
class TraceRecord:
    """One iteration: log det F after it, whether a point was exchanged, candidates drawn so far, seconds so far.

    With another criterion than "D" `log_det` is what is maximised in its place: log phi times its `level` for F as in (7), such as
    the negative logarithm of the trace of F^-1. With a criterion over the prior it is the average over the scenarios.
    """

    iteration: int
    log_det: float
    exchanged: bool
    drawn: int
    seconds: float


@dataclass(frozen=True, eq=False, repr=False)
class FoundDesign(EvaluatedPoints):
    """The points that `exchange` found, with everything needed to judge and to repeat them.

    Attributes
    ----------
    problem, points, evaluation, under_noise
        As of `EvaluatedPoints`.
    scenarios : ScenarioValues or None
        What the design is worth in the scenarios of a criterion over the prior; None where it is of the prior mean.
    efficiency : Efficiency or None
        Against the references; None where they were not requested.
    trace : tuple of TraceRecord
        The first is the random start; log_det never falls, but where `confidence` makes points keep further away from limits.
    rejected : mapping of reason to int
        Candidates that are no points; drawn = accepted + their sum.
    drawn, accepted : int
    stop_reason : StopReason
    seconds : float
    settings : ExchangeSettings
    n_previous : int
        Points whose information was already collected: the evaluations count them, `points` does not have them.
    n_kept : int
        The first so many points were given, and stay.
    previous_left_out : mapping of reason to int
        Previous points that are not valid at the prior mean, and are not used.
    not_estimable : tuple of mappings of parameter name to float
        Where F is singular: combinations of standardised parameters that no point of the region was found to have information
        on. Where these are fewer than the `Evaluation.null_directions`, more or other points determine more.
    ends : tuple of float
        What each of the starts came to, in their order, as `log_det` of a `TraceRecord`; fewer where Ctrl-C ended them.
    again : int
        How many of them are as good as the best one.
    ridge : float
        Share of the prior's information that was added to F while designs of the search were singular, to compare them; 0 where
        none were. No figure of the design contains it.
    left_out : tuple of str
        What the time limit left no time for, such as random designs to compare with.
    """

    settings: ExchangeSettings
    efficiency: Efficiency | None
    trace: tuple[TraceRecord, ...]
    rejected: Mapping[str, int]
    drawn: int
    accepted: int
    stop_reason: StopReason
    seconds: float
    n_previous: int = 0
    n_kept: int = 0
    previous_left_out: Mapping[str, int] = FrozenMapping({})
    scenarios: ScenarioValues | None = None
    not_estimable: tuple[Mapping[str, float], ...] = ()
    ridge: float = 0.0
    ends: tuple[float, ...] = ()
    again: int = 1
    left_out: tuple[str, ...] = ()

    _EXTENTS: ClassVar[Extents] = {
        "points.x0": ("settings.n_experiments", "problem.model.states"),
        "points.u": ("settings.n_experiments", "problem.model.inputs"),
        "evaluation.parameters": ("problem.estimated",),
        "under_noise.parameters": ("problem.estimated",),
        "scenarios.standard_errors": ("problem.estimated",),
        "not_estimable": ("*", "some problem.estimated"),
    }

    @cached_property
    def criterion(self) -> Criterion:
        """The criterion as a function of information matrices.

        Where F is singular "D", "A", "E" and "ME" are of what the points determine.
        """
        return criterion_of_design(self.problem, self.settings.goal, self.evaluation)

    @property
    def value(self) -> float:
        """The criterion at the prior mean with all measurements, previous ones too: at `Evaluation.information`."""
        return self.criterion.value(self.evaluation.information)

    @cached_property
    def feasibility(self) -> Feasibility | None:
        """Which plants of the prior can run all points, of `DRAWS` that the search has not seen.

        None for models of Python functions, where so many trajectories take minutes: `fp.feasibility` counts them too.
        """
        if not self.problem.model.in_core:
            return None
        return feasibility(self.problem, self.points, draws=DRAWS, seed=self.settings.seed + UNSEEN)

    @property
    def too_few(self) -> bool:
        """Whether the points leave more open than all points of the region together would: no efficiency is claimed then."""
        return len(self.evaluation.null_directions) > len(self.not_estimable)

    @property
    def feasible(self) -> bool:
        """Whether at least the required share of the plants can run all points, of those that `feasibility` has tried."""
        required, tried = self.settings.goal.share_of_plants, self.feasibility
        return required is None or (tried is not None and tried.share >= required)

    @property
    def distinct_points(self) -> int:
        """Number of different points; a design may repeat one."""
        return len(Runs.of_points(self.points).distinct()[0])
