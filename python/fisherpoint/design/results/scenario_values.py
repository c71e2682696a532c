"""What a design is worth in the scenarios of a criterion over the prior."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...basics.field_checks import Extents
from ...basics.values import FrozenMapping
from ...information.evaluation import Evaluation
from ...information.problem import DesignProblem
from ..goal.scenario_average import Average


@dataclass(frozen=True)
class ScenarioValues:
    """What a design is worth where the parameters are others than the prior mean: in each of S scenarios, D = R.

    Attributes
    ----------
    value : float
        What was maximised: the average of `log_dets` that the criterion takes, or of what stands in their place with another
        criterion than "D".
    parameters : tuple of mappings of parameter name to float
        The estimated parameters of each scenario, SI units.
    weights : tuple of float
        They sum to 1.
    log_dets : tuple of float
        log det F, in the scaling of (7) and for parameters in units of their prior standard deviations; -inf where F is singular.
    standard_errors : mapping of parameter name to tuple of float
        In each scenario, SI units; inf where F is singular.
    """

    value: float
    parameters: tuple[Mapping[str, float], ...]
    weights: tuple[float, ...]
    log_dets: tuple[float, ...]
    standard_errors: Mapping[str, tuple[float, ...]]

    _EXTENTS: ClassVar[Extents] = {
        "parameters": ("weights", "standard_errors"),
        "log_dets": ("weights",),
        "standard_errors": ("*", "weights"),
    }

    @property
    def mean(self) -> float:
        """The mean of log det F over the scenarios."""
        return float(np.dot(self.weights, self.log_dets))

    @property
    def expected_errors(self) -> Mapping[str, float]:
        """Geometric mean over the scenarios of each standard error: what their logarithms are in the mean, as with log det F."""
        means = {name: float(np.exp(np.dot(self.weights, np.log(of)))) for name, of in self.standard_errors.items()}
        return FrozenMapping(means)

    @property
    def largest_errors(self) -> Mapping[str, float]:
        """The largest standard error of each parameter."""
        return FrozenMapping({name: max(of) for name, of in self.standard_errors.items()})


def scenario_values(
    problems: Sequence[DesignProblem], average: Average, evaluations: Sequence[Evaluation], value: float | None = None
) -> ScenarioValues:
    """Collect the evaluations of a design in all scenarios; `value` is what was maximised where that is not of log dets."""
    log_dets = np.array([evaluation.log_det for evaluation in evaluations])
    names, nothing = problems[0].estimated, dict[str, float]()
    errors = {name: tuple((one.standard_errors or nothing).get(name, np.inf) for one in evaluations) for name in names}
    values = (problem.prior.mean for problem in problems)
    return ScenarioValues(
        value=float(average.value(log_dets)) if value is None else value,
        parameters=tuple(FrozenMapping({name: of[name] for name in names}) for of in values),
        weights=tuple((average.weights / len(average.weights)).tolist()),
        log_dets=tuple(log_dets.tolist()),
        standard_errors=FrozenMapping(errors),
    )
