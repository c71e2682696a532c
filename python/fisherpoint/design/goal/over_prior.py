"""A criterion over the prior: which parameters a design is to be good for, beside the mean, and how they count."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field

import numpy as np

from ...basics.checks import as_float, as_sequence, by_name, check_choice, check_mapping
from ...basics.options import Options
from ...basics.quantity import names_of
from ...basics.values import Array
from ...information.point_information import PointInformation
from ...information.problem import DesignProblem
from ...points.parameter_checks import sensible
from ...prior.gaussian import GaussianPrior
from ...prior.rules import LinearizedRule, Rule, Sobol
from .scenario_average import Average

KINDS = ("log", "worst", "cvar")
MOST_SCENARIOS = 1024


@dataclass(frozen=True)
class OverPrior(Options):
    """A criterion over the prior: what `exchange` maximises instead of log det F at the prior mean.

    Parameters
    ----------
    kind : {"log", "worst", "cvar"}
        The mean of log det F over the scenarios, the smallest, or the mean of the worst `share` of them.
    scenarios : Rule or sequence of mappings of parameter name to float
        The nodes of a rule over the prior of the estimated parameters, with its weights, which must be positive; or values in SI
        units that each count the same. Parameters that are left out of a mapping are at their mean, so that `{}` is the mean.
    share : float
        Of "cvar", between 0 and 1.
    """

    kind: str
    _: KW_ONLY
    scenarios: Rule | Sequence[Mapping[str, float]] = field(default=Sobol(8))
    share: float = 0.25

    def __post_init__(self) -> None:
        set_field = object.__setattr__
        check_choice(self.kind, KINDS, "kind")
        if isinstance(self.scenarios, LinearizedRule) or (isinstance(self.scenarios, Rule) and self.scenarios.signed):
            raise ValueError(
                "scenarios: expected a rule whose nodes have positive weights, such as fisherpoint.Sobol(8), "
                f"given {type(self.scenarios).__name__}"
            )
        if not isinstance(self.scenarios, Rule):
            given = as_sequence(self.scenarios, "scenarios", "mappings of parameters, or a rule")
            if not given:
                raise ValueError("scenarios: expected a rule, or at least one mapping of parameters, given none")
            labels = [f"scenarios[{k}]" for k in range(len(given))]
            pairs = zip(given, labels, strict=True)
            checked = (by_name(check_mapping(values, label), None, label, as_float) for values, label in pairs)
            set_field(self, "scenarios", tuple(checked))
        set_field(self, "share", as_float(self.share, "share"))
        if not 0 < self.share <= 1:
            raise ValueError(f"share: expected a share above 0 and up to 1, given {self.share:g}")

    def nodes(self, problem: DesignProblem) -> tuple[Array, Array]:
        """Parameters (S, p) of the model and weights (S,) that sum to 1; nodes that make no sense to the model are left out.

        Raises
        ------
        ValueError
            Where names are not those of estimated parameters, values make no sense to the model, or there are too many.
        """
        if isinstance(self.scenarios, Rule):
            size = self.scenarios.size(problem.prior)
            if size <= MOST_SCENARIOS:
                theta, weights = self.scenarios.core_nodes(problem.prior, problem.estimated).nodes()
                kept = sensible(problem.model, theta) & (weights > 0)
                if not kept.any():
                    raise ValueError("scenarios: expected nodes that make sense to the model, given none")
                return theta[kept], weights[kept] / weights[kept].sum()
        else:
            size = len(self.scenarios)
            if size <= MOST_SCENARIOS:
                given = [by_name(values, problem.estimated, "scenarios", as_float) for values in self.scenarios]
                names = names_of(problem.model.parameters)
                theta = np.array([[values.get(name, problem.prior.mean[name]) for name in names] for values in given])
                return theta, np.full(size, 1 / size)
        raise ValueError(f"scenarios: expected at most {MOST_SCENARIOS}, given {size}")

    @property
    def described(self) -> str:
        """What is maximised, as part of a sentence."""
        return self.described_with("log det F")

    @property
    def named_scenarios(self) -> str:
        """The scenarios, in words."""
        return f"nodes of {self.scenarios}" if isinstance(self.scenarios, Rule) else "given values"

    def described_with(self, what: str) -> str:
        """What is maximised for another criterion, as part of a sentence."""
        of = {"log": f"the mean {what}", "worst": f"the smallest {what}"}
        return of.get(self.kind, f"the mean {what} of the worst {100 * self.share:g} %")


@dataclass(frozen=True, eq=False)
class Scenarios:
    """The parameters for which a search evaluates its points.

    A scenario is the design problem with its prior moved there. The standard deviations that standardise parameters stay.

    Attributes
    ----------
    problems : tuple of DesignProblem
    average : Average
    previous : tuple of PointInformation or None
        What is known beside the points that are searched for, in each scenario.
    """

    problems: tuple[DesignProblem, ...]
    average: Average
    previous: tuple[PointInformation | None, ...]


def moved_problems(problem: DesignProblem, over: OverPrior) -> tuple[tuple[DesignProblem, ...], Average]:
    """The problem at each scenario, itself where that is the mean, and how they count."""
    theta, weights = over.nodes(problem)
    names = names_of(problem.model.parameters)
    problems = []
    for values in theta:
        if np.array_equal(values, problem.theta):
            problems.append(problem)
        else:  # a prior whose nodes are not needed
            mean, given = dict(zip(names, values.tolist(), strict=True)), problem.prior
            spread = {"covariance": given.covariance} if given.correlated else {"std": dict(given.std)}
            problems.append(problem.replace(prior=GaussianPrior(mean, **spread)))
    share = {"log": 1.0, "worst": 0.0, "cvar": over.share}[over.kind]
    equal = np.ptp(weights) <= 1e-12
    return tuple(problems), Average(np.ones(len(weights)) if equal else weights * len(weights), share)
