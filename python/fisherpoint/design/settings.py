"""The settings of searches for points and for runs, and their limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, fields
from typing import Any, TypeVar

from ..basics.checks import (
    LARGEST_INT,
    as_float,
    as_positive,
    as_probability,
    as_sequence,
    as_std,
    by_name,
    check_choice,
    check_flag,
    check_name,
    check_positive_int,
    check_type,
)
from ..information.output_covariance import needs_covariances
from ..information.problem import DesignProblem
from ..points.codec import points_from_json, points_to_json
from ..points.experiments import Experiments
from .optimality.goal import CRITERIA
from .over_prior import OverPrior

Kind = TypeVar("Kind")
METHODS = ("paper", "auto")
SINGULAR = ("estimable", "error")
"""What is done where not all parameters can be determined: a design for those that can, or an error."""

MOST_ITERATIONS = {"paper": 200, "auto": 800}
"""Iterations of a search by its method, where no other number is given; "auto" ends earlier where nothing gains any more."""
_LEAST = {"n_experiments": 1, "n_candidates": 1, "max_iterations": 0, "seed": 0, "patience": 1, "max_redraws": 0}
MOST = {"n_experiments": 10**6, "n_candidates": 10**6, "max_iterations": 10**9, "patience": 10**9, "max_redraws": 10**6}
MOST_OF_RUNS = {"n_runs": 1000, "n_starts": 10_000, "n_candidates": 10**6}


@dataclass(frozen=True, kw_only=True)
class ExchangeSettings:
    """The arguments of `exchange` that decide its result, and their defaults; without `max_iterations` it is that of the method."""

    n_experiments: int = 12
    n_candidates: int = 50
    max_iterations: int = None  # type: ignore[assignment]  # a number once there is a method
    seed: int = 0
    patience: int | None = None
    time_limit: float | None = None
    max_redraws: int = 1
    references: bool = True
    screen: bool = True
    local: float = 0.5
    method: str = "auto"
    singular: str = "estimable"
    over: OverPrior | None = None
    criterion: str = "D"
    of: str | tuple[str, ...] | None = None
    conditions: Experiments | None = None
    scale: Mapping[str, float] | None = None
    confidence: float | None = None
    prior_information: bool = False

    def __post_init__(self) -> None:
        set_field = object.__setattr__
        check_choice(self.method, METHODS, "method")
        if self.max_iterations is None:
            set_field(self, "max_iterations", MOST_ITERATIONS[self.method])
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
        check_choice(self.singular, SINGULAR, "singular")
        _check_kind_of_over(self.over)
        _check_what_is_asked(self)
        if self.confidence is not None:
            set_field(self, "confidence", as_probability(self.confidence, "confidence"))


def _check_what_is_asked(settings: ExchangeSettings | RunSettings) -> None:
    """Check the criterion and what it needs by their kinds, each by itself."""
    set_field = object.__setattr__
    check_choice(settings.criterion, CRITERIA, "criterion")
    if settings.of is not None and not isinstance(settings.of, str):
        set_field(settings, "of", tuple(check_name(one, "of") for one in as_sequence(settings.of, "of", "names")))
    if settings.conditions is not None:
        check_type(settings.conditions, Experiments, "conditions")
    if settings.scale is not None:
        set_field(settings, "scale", by_name(settings.scale, None, "scale", as_std))
    set_field(settings, "prior_information", check_flag(settings.prior_information, "prior_information"))


def _check_kind_of_over(over: object) -> None:
    if over is not None and not isinstance(over, OverPrior):
        raise TypeError(f"over: expected an OverPrior or None, given {type(over).__name__}")


def searched_by(method: str, problem: DesignProblem) -> str:
    """The method of a search: "auto" is that of the paper where D needs every point's covariance, or trajectories cost much."""
    costly = needs_covariances(str(problem.output_covariance)) or not problem.model.in_core
    return "paper" if costly else method


def most_iterations(given: int | None, method: str, problem: DesignProblem) -> int:
    """The largest number of iterations that is given, or that of the method."""
    if given is not None:
        return given
    return MOST_ITERATIONS[searched_by(check_choice(method, METHODS, "method"), problem)]


def check_goal(settings: ExchangeSettings, problem: DesignProblem) -> None:
    """Raise where the settings ask for a goal that no search has: one other than log det F at the prior mean."""
    kind, method = str(problem.output_covariance), searched_by(settings.method, problem)
    if settings.confidence is not None and method != "auto":
        raise ValueError(
            'confidence: expected method = "auto", output_covariance = "noise" or "region" and a model of equations, '
            f"given method {settings.method!r}, output_covariance {kind!r} and a {type(problem.model).__name__}"
        )
    if method == "auto" and kind == "noise":
        return
    goals = {
        "over": settings.over is not None,
        f"criterion {settings.criterion!r}": settings.criterion != "D",
        "prior_information": settings.prior_information,
    }
    for name, given in goals.items():
        if given:
            raise ValueError(
                f'{name}: expected method = "auto", output_covariance = "noise" and a model of equations, '
                f"given method {settings.method!r}, output_covariance {kind!r} and a {type(problem.model).__name__}"
            )


@dataclass(frozen=True)
class RunSettings:
    """The arguments of `design_runs` that decide its result."""

    n_runs: int
    n_starts: int
    n_candidates: int
    seed: int
    confidence: float | None
    time_limit: float | None
    _: KW_ONLY
    over: OverPrior | None = None
    singular: str = "estimable"
    criterion: str = "D"
    of: str | tuple[str, ...] | None = None
    conditions: Experiments | None = None
    scale: Mapping[str, float] | None = None
    prior_information: bool = False

    def __post_init__(self) -> None:
        set_field = object.__setattr__
        for name, most in MOST_OF_RUNS.items():
            set_field(self, name, check_positive_int(getattr(self, name), name, most=most))
        set_field(self, "seed", check_positive_int(self.seed, "seed", 0))
        if self.confidence is not None:
            set_field(self, "confidence", as_probability(self.confidence, "confidence"))
        if self.time_limit is not None:
            set_field(self, "time_limit", as_positive(self.time_limit, "time_limit", "time in s"))
        check_choice(self.singular, SINGULAR, "singular")
        _check_kind_of_over(self.over)
        _check_what_is_asked(self)


def settings_to_json(settings: ExchangeSettings | RunSettings) -> dict[str, Any]:
    """The arguments of the class as JSON has them."""
    data, over, conditions = dict(vars(settings)), getattr(settings, "over", None), getattr(settings, "conditions", None)
    if over is not None:
        data["over"] = over.to_json()
    if conditions is not None:
        data["conditions"] = points_to_json(conditions)
    if data.get("scale") is not None:
        data["scale"] = dict(data["scale"])
    return data


def settings_from_json(kind: type[Kind], data: Mapping[str, Any]) -> Kind:
    """What `settings_to_json` wrote, with every entry: a default would stand for what was lost."""
    read = dict(data)
    for missing in (one.name for one in fields(kind) if one.name not in read):  # type: ignore[arg-type]
        raise ValueError(f"settings: expected an entry {missing!r}, given none")
    if read.get("over") is not None:
        read["over"] = OverPrior.from_json(read["over"])
    if read.get("conditions") is not None:
        read["conditions"] = points_from_json(read["conditions"])
    return kind(**read)
