"""How often each of some candidates is measured, as the search finds it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ...basics.field_checks import Extents
from ...basics.stop_reason import StopReason
from ...basics.values import Array
from ...information.problem import DesignProblem
from ...points.experiments import Experiments
from ..goal.criteria import Criterion
from ..goal.goal import Goal
from ..goal.goal_criterion import criterion_of


@dataclass(frozen=True, eq=False, repr=False)
class ExactCounts:
    """How often each of some candidates is measured.

    Attributes
    ----------
    problem : DesignProblem
    goal : Goal
    points : Experiments
        As many as measurements; those that are repeated stand side by side.
    chosen : ndarray of int, (m,)
        The candidates that are measured, as places among those that were given.
    counts : ndarray of int, (m,)
        How often each is.
    information : ndarray, (p, p)
        sum_i n_i F_i, with parameters in units of their prior std, and that of the prior where it was added. Uncertain constants
        have rows and columns of their own, behind those of the parameters.
    value : float
        The criterion at this matrix.
    efficiency : float
        Lower bound of the efficiency of the design against every design of as many measurements of the candidates.
    of_weights : float
        The same against weights that need not be whole numbers, with which the best design mostly cannot compete.
    gap : float
        By which share of measurements a better design was allowed to stay unknown.
    stop_reason : StopReason
        "proven" where the efficiency is at least 1 - gap.
    nodes : int
        Number of boxes of counts whose bound was computed.
    n_candidates, n_left : int
        Valid candidates, and those of them that better designs than what exchanges had found could have, copies counted once.
    null_directions : tuple of mappings of parameter name to float
        Combinations of standardised parameters that no candidate says anything about: the design is for the others.
    left_out : mapping of reason to int
        Candidates that are no points.
    seconds : float
    """

    problem: DesignProblem
    goal: Goal
    points: Experiments
    chosen: NDArray[np.intp]
    counts: NDArray[np.int64]
    information: Array
    value: float
    efficiency: float
    of_weights: float
    gap: float
    stop_reason: StopReason
    nodes: int
    n_candidates: int
    n_left: int
    null_directions: tuple[Mapping[str, float], ...]
    left_out: Mapping[str, int]
    seconds: float

    _EXTENTS: ClassVar[Extents] = {
        "points.x0": ("*", "problem.model.states"),
        "points.u": ("*", "problem.model.inputs"),
        "chosen": ("m",),
        "counts": ("m",),
        "information": ("problem.unknowns", "problem.unknowns"),
        "null_directions": ("*", "some problem.estimated"),
    }

    @cached_property
    def criterion(self) -> Criterion:
        """The criterion, as a function of information matrices."""
        return criterion_of(self.problem, self.goal)

    @property
    def proven(self) -> bool:
        """Whether no design of as many measurements of the candidates is better by more than the gap."""
        return self.stop_reason == StopReason.proven

    @property
    def distinct(self) -> Experiments:
        """The m points that are measured, each once."""
        return self.points[np.cumsum(self.counts) - self.counts]
