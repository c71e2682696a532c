"""Weights of points, as the search finds them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from ...basics.field_checks import Extents
from ...basics.stop_reason import StopReason
from ...basics.values import Array
from ...information.problem import DesignProblem
from ...points.experiments import Experiments
from ..goal.averaged_criterion import EstimableOver
from ..goal.criteria import Criterion
from ..goal.estimable_space import Estimable
from ..goal.goal import Goal
from ..goal.goal_criterion import criterion_of
from ..goal.over_prior import moved_problems
from ..goal.scenario_average import Average


@dataclass(frozen=True, eq=False, repr=False)
class ApproximateWeights:
    """Weights of points: the share of all measurements that each is to get.

    Attributes
    ----------
    problem : DesignProblem
    goal : Goal
    n_experiments : int or None
        Beside how many experiments what is known beforehand counts once: the prior's information where the goal adds it, and that
        about uncertain constants. None where nothing was added.
    points : Experiments
        The support.
    weights : ndarray, (m,)
        They sum to 1.
    information : ndarray, (p, p), or (S, p, p)
        M = sum_i w_i F_i, with parameters in units of their prior std, and 1/n_experiments of the prior's where it was added; in
        each of the scenarios, where the criterion is over the prior. Uncertain constants and shared starts have rows and columns
        of their own, behind those of the parameters.
    value : float
        The criterion at M, which is that of one experiment; n of them have n M. Over the prior it is the average over the scenarios
        of log phi times `level`, which is log det M for "D".
    efficiency : float
        Lower bound of the share of the optimum that the design reaches, by concavity, among everything that was searched.
    largest : float
        The largest value of the sensitivity function that was met, as a share of its level: at most 1 at an optimum.
    level : int
        What the sensitivity function is at most at an optimum: p for "D", where it is tr(M^-1 F).
    half : ndarray, (p, q)
        Y of the sensitivity function level |J Y|^2.
    estimable : Estimable
        What the candidates determine together.
    null_directions : tuple of mappings of parameter name to float
        Combinations of standardised parameters that no candidate says anything about: the design is for the others.
    n_candidates : int
        Valid candidates over which the sensitivity function was computed, all of them.
    starts : int
        Local ascents of the sensitivity function in the region, from as many places, after the last change of the support, and
        after climbs at random that had met nothing; 0 where only the candidates count.
    sample : Experiments
        Some of the candidates, for pictures.
    left_out : mapping of reason to int
        Candidates that are no points.
    deleted : int
        Candidates that were proven to have no weight in any optimum.
    stop_reason : StopReason
        "converged" where the sensitivity function exceeds its level by no more than the tolerance, in the region by a thousandth;
        "rounding" where double precision has no more, and "max_iterations" where the region still had better places.
    seconds : float
    """

    problem: DesignProblem
    goal: Goal
    n_experiments: int | None
    points: Experiments
    weights: Array
    information: Array
    value: float
    efficiency: float
    largest: float
    level: int
    half: Array
    estimable: Estimable
    null_directions: tuple[Mapping[str, float], ...]
    n_candidates: int
    starts: int
    sample: Experiments
    left_out: Mapping[str, int]
    deleted: int
    stop_reason: StopReason
    seconds: float

    _EXTENTS: ClassVar[Extents] = {
        "points.x0": ("m", "problem.model.states"),
        "points.u": ("m", "problem.model.inputs"),
        "sample.x0": ("*", "problem.model.states"),
        "sample.u": ("*", "problem.model.inputs"),
        "weights": ("m",),
        "information": ("...", "problem.unknowns", "problem.unknowns"),
        "half": ("h", "*"),
        "estimable.length": ("h",),
        "null_directions": ("*", "some problem.estimated"),
    }
    _POSITIVE = ("level", "n_experiments")

    @cached_property
    def criterion(self) -> Criterion:
        """The criterion, as a function of information matrices; at the prior mean."""
        return criterion_of(self.problem, self.goal)

    @cached_property
    def _scenarios(self) -> tuple[tuple[DesignProblem, ...], Average] | None:
        return None if self.goal.over is None else moved_problems(self.problem, self.goal.over)

    @property
    def scenario_values(self) -> tuple[float, ...] | None:
        """The criterion at M in each scenario; None where it is of the prior mean."""
        if self._scenarios is None:
            return None
        assert isinstance(self.estimable, EstimableOver)
        found = []
        for one, matrix, space in zip(self._scenarios[0], self.information, self.estimable.parts, strict=True):
            own = criterion_of(one, self.goal)
            if len(space.null):
                own, matrix = own.within(space.orthonormal), space.span.T @ matrix @ space.span
            found.append(own.value(matrix))
        return tuple(found)
