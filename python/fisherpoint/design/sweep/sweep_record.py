"""Designs of several sizes: what each is worth, and which to take."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from typing import ClassVar

import numpy as np

from ...basics.checks import as_positive, by_name
from ...basics.field_checks import Extents
from ...basics.messages import shown
from ...basics.stop_reason import StopReason
from ...information.evaluation import Evaluation
from ...information.problem import DesignProblem
from ...points.experiments import Experiments
from ..results.cost import Cost
from ..results.efficiency import d_efficiency
from ..results.settings import ExchangeSettings


@dataclass(frozen=True, eq=False)
class SizedDesign:
    """A design of one size.

    Attributes
    ----------
    points : Experiments
    evaluation : Evaluation
        Under the sensor noise, with the previous points.
    cost : float or None
        None where no costs were given.
    at_most : float or None
        Proven: no design of as many of the candidates that all searches together have evaluated has a larger log det F, (7), or
        more of what was maximised in its place. None where the points are too few to determine as much as these candidates do.
    maximised : float or None
        Of F as in (7), what was: level log phi of another criterion than "D", or the average over scenarios; -inf where points were
        too few for it, which are chosen by log det F. None for log det F at the prior mean.
    level : int or None
        Of that criterion, where there is another; else how many directions of the parameters points of the region can determine,
        where these are not all: log dets are of them.
    degree : int
        Of the criterion.
    """

    points: Experiments
    evaluation: Evaluation
    cost: float | None
    at_most: float | None
    _: KW_ONLY
    maximised: float | None = None
    level: int | None = None
    degree: int = 1

    _POSITIVE = ("level", "degree")

    @property
    def log_det(self) -> float:
        """log det F, (7), of what points of the region can determine; -inf where this design's determine less.

        Where something else was maximised it is that of all parameters.
        """
        return log_det_of(self.evaluation, self.level if self.maximised is None else None)

    @property
    def at_least(self) -> float | None:
        """The efficiency against `at_most`: a lower bound among designs of these candidates."""
        return d_efficiency(self._value, self.at_most, self._level)

    @property
    def information(self) -> float:
        """`log_det`, or what was maximised, of the sum over the measurements, standardised: it rises with each."""
        return float(self._value + self._level * self.degree * np.log(self.evaluation.n_points / 2))

    @property
    def mean_error(self) -> float:
        """phi^(-1/2): for "D" det(F)^(-1/2p), the geometric mean of the standard errors over the principal directions.

        These are in prior std. For "c" it is the standard deviation of the function, for "I" that of predictions, for "A" the root
        of the sum of the squared errors; over the prior the geometric mean over the scenarios, or over those that count.
        """
        return float(np.exp(-self.information / (2 * self._level)))

    @property
    def _value(self) -> float:
        return self.log_det if self.maximised is None else self.maximised

    @property
    def _level(self) -> int:
        return len(self.evaluation.parameters) if self.level is None else self.level


def log_det_of(evaluation: Evaluation, level: int | None) -> float:
    """log det F of so many directions of the parameters; -inf where fewer are determined."""
    if level is None or evaluation.log_det_estimable is None:
        return evaluation.log_det
    return evaluation.log_det_estimable if evaluation.rank == level else -np.inf


@dataclass(frozen=True, eq=False, repr=False)
class SweptDesigns:
    """Designs of several sizes.

    Attributes
    ----------
    problem : DesignProblem
    designs : tuple of SizedDesign
        With ascending numbers of points; ``sweep[12]`` is that of 12.
    cost : Cost or None
    n_previous, n_candidates : int
        Points that are added to every design; candidates that the searches have evaluated.
    stop_reason : StopReason
        Where it is not "completed", larger sizes are missing; with "time_limit" the search for the largest was cut short, and
        "interrupted_first" came before the first size was done, and this is its best design so far.
    seconds : float
    settings : ExchangeSettings
        Those of the search for the smallest design; the others differ in their size.
    not_estimable : tuple of mappings of parameter name to float
        Combinations of standardised parameters that no point of the region was found to have information on.
    ridge : float
        As that of a design, of any of the searches.
    """

    problem: DesignProblem
    designs: tuple[SizedDesign, ...]
    cost: Cost | None
    n_previous: int
    n_candidates: int
    stop_reason: StopReason
    seconds: float
    _: KW_ONLY
    settings: ExchangeSettings
    not_estimable: tuple[Mapping[str, float], ...] = ()
    ridge: float = 0.0

    _EXTENTS: ClassVar[Extents] = {
        "designs": ("+",),
        "designs.points.x0": ("*", "problem.model.states"),
        "designs.points.u": ("*", "problem.model.inputs"),
        "designs.evaluation.parameters": ("problem.estimated",),
        "not_estimable": ("*", "some problem.estimated"),
    }

    def __getitem__(self, n_experiments: int) -> SizedDesign:
        if n_experiments not in self.sizes:
            sizes = ", ".join(map(str, self.sizes))
            raise KeyError(f"n_experiments: expected one of {sizes}; given {shown(n_experiments)}")
        return self.designs[self.sizes.index(n_experiments)]

    @property
    def sizes(self) -> tuple[int, ...]:
        """The numbers of points."""
        return tuple(len(of.points) for of in self.designs)

    @property
    def knee(self) -> int | None:
        """The size from which on more experiments help little; None where there is none, as of fewer than three regular designs.

        The mean standard error, `SizedDesign.mean_error`, falls with the size; the knee is where its curve lies furthest below the
        straight line from the first to the last of the sizes (Satopaa et al. 2011). It depends on these two, and is no optimum.
        There is none where the curve is nowhere below that line.
        """
        able = [of for of in self.designs if np.isfinite(of.information)]
        if len(able) < 3:
            return None
        sizes = [len(of.points) for of in able]
        errors = np.array([of.mean_error for of in able])
        x = (np.array(sizes) - sizes[0]) / (sizes[-1] - sizes[0])
        y = (errors - errors[-1]) / max(errors[0] - errors[-1], np.finfo(float).tiny)
        below = int(np.argmin(x + y))
        return sizes[below] if x[below] + y[below] < 1 - 1e-9 and errors[-1] < errors[0] else None

    def within(self, budget: float) -> int | None:
        """The size of the most informative design that costs no more than a budget; None where all cost more.

        Raises
        ------
        ValueError
            Where no costs were given.
        """
        budget = as_positive(budget, "budget")
        if self.cost is None:
            raise ValueError("budget: expected a sweep with costs, given one without: sweep(..., cost=fp.Cost(...))")
        able = [of for of in self.designs if of.cost is not None and of.cost <= budget]
        return len(max(able, key=lambda of: of.information).points) if able else None

    def reaching(self, standard_errors: Mapping[str, float]) -> int | None:
        """The smallest size whose standard errors are no larger than given ones, SI units; None where none of the sizes does.

        Parameters
        ----------
        standard_errors : mapping of parameter name to float
            Of some or all estimated parameters.
        """
        limits = by_name(standard_errors, self.problem.estimated, "standard_errors", as_positive)
        if not limits:
            raise ValueError("standard_errors: expected at least one parameter, given none")
        for of in self.designs:
            errors = of.evaluation.standard_errors
            if errors is not None and all(errors[name] <= limit for name, limit in limits.items()):
                return len(of.points)
        return None
