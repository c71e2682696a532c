"""What a search finds: points, how they were found, and what they are worth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..basics.checks import LARGEST_INT, as_float, as_positive, check_flag, check_positive_int
from ..basics.values import FrozenMapping
from ..information.evaluation import Evaluation
from ..information.problem import DesignProblem
from ..points.experiments import Experiments
from .efficiency import Efficiency

STOP_REASONS = ("max_iterations", "patience", "time_limit", "interrupted")


_LEAST = {"n_experiments": 1, "n_candidates": 1, "max_iterations": 0, "seed": 0, "patience": 1, "max_redraws": 0}
MOST = {"n_experiments": 10**6, "n_candidates": 10**6, "max_iterations": 10**9, "patience": 10**9, "max_redraws": 10**6}


@dataclass(frozen=True, kw_only=True)
class ExchangeSettings:
    """The arguments of `exchange` that decide its result."""

    n_experiments: int
    n_candidates: int
    max_iterations: int
    seed: int
    patience: int | None
    time_limit: float | None
    max_redraws: int
    references: bool
    screen: bool = False  # as in files that do not say
    local: float = 0.0

    def __post_init__(self) -> None:
        set_field = object.__setattr__
        for name, least in _LEAST.items():
            value = getattr(self, name)
            if value is not None or name != "patience":
                set_field(self, name, check_positive_int(value, name, least, MOST.get(name, LARGEST_INT)))
        if self.time_limit is not None:
            set_field(self, "time_limit", as_positive(self.time_limit, "time_limit", "number of seconds"))
        set_field(self, "references", check_flag(self.references, "references"))
        set_field(self, "screen", check_flag(self.screen, "screen"))
        set_field(self, "local", as_float(self.local, "local"))
        if not 0 <= self.local <= 1:
            raise ValueError(f"local: expected a share between 0 and 1, given {self.local:g}")


@dataclass(frozen=True)
class TraceRecord:
    """One iteration: log det F after it, whether a point was exchanged, candidates drawn so far, seconds so far."""

    iteration: int
    log_det: float
    exchanged: bool
    drawn: int
    seconds: float


@dataclass(frozen=True, eq=False, repr=False)
class FoundDesign:
    """The points that `exchange` found, with everything needed to judge and to repeat them.

    Attributes
    ----------
    points : Experiments
    evaluation : Evaluation
        Under the problem's output covariance; of the previous points, where there are any, and these together.
    under_noise : Evaluation or None
        Under the sensor noise alone; None where it is not known.
    efficiency : Efficiency or None
        Against the references; None where they were not asked for.
    trace : tuple of TraceRecord
        The first is the random start; log_det never falls.
    rejected : mapping of reason to int
        Candidates that are no points; drawn = accepted + their sum.
    drawn, accepted : int
    stop_reason : {"max_iterations", "patience", "time_limit", "interrupted"}
    seconds : float
    settings : ExchangeSettings
    problem : DesignProblem
    n_previous : int
        Points whose information was already collected: the evaluations count them, `points` does not have them.
    previous_left_out : mapping of reason to int
        Previous points that are not valid at the prior mean, and are not used.
    """

    problem: DesignProblem
    settings: ExchangeSettings
    points: Experiments
    evaluation: Evaluation
    under_noise: Evaluation | None
    efficiency: Efficiency | None
    trace: tuple[TraceRecord, ...]
    rejected: Mapping[str, int]
    drawn: int
    accepted: int
    stop_reason: str
    seconds: float
    n_previous: int = 0
    previous_left_out: Mapping[str, int] = FrozenMapping({})

    @property
    def distinct_points(self) -> int:
        """Number of different points; a design may repeat one."""
        return len(np.unique(self.points.table, axis=0))
