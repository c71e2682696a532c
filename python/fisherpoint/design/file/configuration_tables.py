"""The tables of the TOML file, each with what may stand in it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields
from math import inf, isfinite
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from pydantic import AfterValidator, ConfigDict, Field, create_model, field_validator, model_validator
from pydantic_core import PydanticCustomError

from ...basics.checks import percentage
from ...basics.messages import listed
from ...basics.options import Key, keys_of
from ...basics.quantity import Quantity
from ...basics.toml_mistakes import fail, toml
from ...basics.toml_tables import Abbreviated, Constant, Count, NotNegative, Number, Positive, Table
from ...basics.units import convert_unit, same_zero
from ...information.local import Local
from ...noise.models import GaussMarkov, Noise
from ...points.settings import COARSEST, FINEST
from ...prior.gaussian import MOST_RELATIVE_STD
from ...prior.rules import DEFAULT_RULE, RULES, Rule
from ..fleet.fleet_settings import FleetSettings
from ..goal.goal import Goal
from ..results.cost import Cost
from ..results.settings import MOST, ExchangeMethod, ExchangeSettings, RunSettings
from .run_keys import RunKeys

Correlation = Annotated[float, Field(gt=-1, lt=1)]


class Std(Constant):
    """Standard deviation of a sensor, a constant or a start: a bare number or ``{value, unit}``."""

    value: Positive


def stds(table: Mapping[str, Std], quantities: Iterable[Quantity]) -> dict[str, float]:
    """Standard deviations in the units of the quantities."""
    units = {quantity.name: quantity.unit for quantity in quantities}
    return {name: convert_unit(entry.value, entry.unit or units[name], units[name], width=True) for name, entry in table.items()}


class ColoredEntry(Table):
    """A part of the noise with a memory."""

    std: Positive
    correlation_time: Positive


class NoiseEntry(Abbreviated):
    """The noise of one output: a standard deviation, or a table."""

    bare, expected = (int, float), "a number or {std = ..., ...}"

    std: NotNegative = 0.0
    unit: str | None = None
    relative: NotNegative = 0.0
    colored: list[ColoredEntry] = Field(default_factory=list)
    resolution: NotNegative = 0.0
    limits: list[float] | None = None

    @field_validator("colored", mode="before")
    @classmethod
    def _one_or_more(cls, given: Any) -> Any:
        return [given] if isinstance(given, dict) else given

    def build(self, unit: str) -> Noise:
        """The noise in the unit of its output."""
        given = self.unit or unit
        colored = [GaussMarkov(convert_unit(one.std, given, unit, width=True), one.correlation_time) for one in self.colored]
        limits = [convert_unit(one, given, unit) if isfinite(one) else None for one in self.limits or (-inf, inf)]
        return Noise(
            convert_unit(self.std, given, unit, width=True),
            relative=self.relative,
            colored=colored,
            resolution=convert_unit(self.resolution, given, unit, width=True),
            limits=tuple(limits),  # type: ignore[arg-type]  # which says how many there must be
        )


class LocalEntry(Abbreviated):
    """Whose a local parameter is: a word, or a table with the spread."""

    bare, expected = (str,), 'a word such as "run" or "plant", or {by = "run", spread = ...}'

    by: Annotated[str, Field(min_length=1)]
    spread: Positive | Literal["estimated"] | None = None
    unit: str | None = None

    def build(self, unit: str) -> Local:
        """The local parameter, its spread in the unit of the parameter."""
        if isinstance(self.spread, str) or self.spread is None:
            return Local(self.by, spread=self.spread)
        return Local(self.by, spread=convert_unit(self.spread, self.unit or unit, unit, width=True))


class PriorEntry(Table):
    """Mean and standard deviation of one parameter before any experiment."""

    mean: Number
    std: Positive | None = None
    relative_std: Positive | None = None
    unit: str | None = None
    log: bool = False

    @field_validator("relative_std")
    @classmethod
    def _a_share(cls, given: float | None) -> float | None:
        return given if given is None else _share(given, MOST_RELATIVE_STD)

    @model_validator(mode="after")
    def _exactly_one_std(self) -> PriorEntry:
        if (self.std is None) == (self.relative_std is None):
            raise PydanticCustomError("expected", "exactly one of std and relative_std")
        if self.mean == 0 and self.relative_std is not None:
            raise PydanticCustomError("expected", "std instead of relative_std, as the mean is 0")
        if self.log and not self.mean > 0:
            raise PydanticCustomError("expected", "a mean > 0 with log = true")
        return self

    def mean_and_std(self, quantity: Quantity) -> tuple[float, float]:
        """Both in the unit of the parameter."""
        given, wanted = self.unit or quantity.unit, quantity.unit
        std = self.std
        if std is None:
            if not same_zero(given, wanted):
                raise ValueError(
                    f"{quantity.name}.relative_std: expected std for a parameter in {wanted} that is given in {given}, "
                    "as a share of the mean is not the same in both"
                )
            std = (self.relative_std or 0.0) * abs(self.mean)
        return convert_unit(self.mean, given, wanted), convert_unit(std, given, wanted, width=True)


def _share(given: float, most: float) -> float:
    if given > most:
        raise PydanticCustomError("expected", f"a share of at most {most:g}, {percentage(given)}")
    return given


Target = Annotated[Positive, AfterValidator(lambda given: _share(given, 1.0))]
"""A relative standard error."""


class BoundsEntry(Abbreviated):
    """Range of one state, input or of dt: a bare pair or ``{bounds, unit}``; equal bounds, or a number, fix the value."""

    bare, expected = (list, int, float), 'a pair [lower, upper], a number, or {bounds = [lower, upper], unit = "..."}'

    bounds: list[Number]
    unit: str | None = None

    @field_validator("bounds", mode="before")
    @classmethod
    def _fixed(cls, given: Any) -> Any:
        return [given, given] if isinstance(given, int | float) and not isinstance(given, bool) else given

    def pair(self, quantity: Quantity) -> tuple[float, float]:
        """Both bounds in the unit of what they are of."""
        lower, upper = convert_unit(self.bounds, self.unit or quantity.unit, quantity.unit)
        return float(lower), float(upper)


class RegionTable(Table):
    """Bounds of every state, every input and dt, by name, and constraints between them."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, BoundsEntry] = Field(init=False)
    constraints: list[str] = Field(default_factory=list)

    @property
    def bounds(self) -> dict[str, BoundsEntry]:
        return self.__pydantic_extra__


class RuleTable(Table):
    """How expectations over the prior are taken; without a kind, levels, span and edges are those of the paper's grid."""

    kind: Literal["tensor_grid", "gauss_hermite", "sparse_gauss_hermite", "sobol", "unscented", "linearized"] | None = None
    levels: Count | dict[str, Count] | None = None
    span: Positive | None = None
    edges: list[Number] | dict[str, list[Number]] | None = None
    level: Count | None = None
    n: Count | None = None
    seed: Annotated[int, Field(ge=0)] | None = None

    @model_validator(mode="after")
    def _keys_of_the_kind(self) -> RuleTable:
        given = self.model_dump(exclude={"kind"}, exclude_none=True)
        if given and self.rule_class is None:
            fail(f"rule.kind: missing; expected one of {listed(RULES)}")
        for key in given:
            kinds = [f'"{kind}"' for kind, rule in RULES.items() if key in _arguments(rule)]
            if self.rule_class is not None and key not in _arguments(self.rule_class):
                fail(f"rule.{key}: expected only with kind = {' or '.join(kinds)}, given {toml(self.kind)}")
        return self

    @property
    def rule_class(self) -> type[Rule] | None:
        """None for the library's default."""
        if self.kind is None and (self.levels, self.span, self.edges) != (None, None, None):
            return RULES["tensor_grid"]
        return None if self.kind is None else RULES[self.kind]

    def build(self) -> Rule:
        """The rule."""
        arguments = self.model_dump(exclude={"kind"}, exclude_none=True)
        return DEFAULT_RULE if self.rule_class is None else self.rule_class(**arguments)


def _arguments(rule: type[Rule]) -> list[str]:
    return [field.name for field in fields(rule)]


class ProblemKeys(Table):
    """The keys of [design] that are of the problem: what is estimated, and how trajectories are computed."""

    output_covariance: Literal["noise", "region", "pooled", "pointwise"] | None = None
    parameters: Annotated[list[str], Field(min_length=1)] | None = None
    kinks: Literal["cross", "exclude"] | None = None
    jumps: Literal["cross", "exclude"] | None = None
    rtol: Annotated[float, Field(ge=FINEST, le=COARSEST)] | None = None
    assumed_covariance: Literal["tangents", "predictive"] | None = None
    along: list[str] | None = None


class FleetKeys(Table):
    """Several plants that share some parameters: how many, or what they are called."""

    plants: Count | Annotated[list[str], Field(min_length=1)]


OF_GOAL, OF_SEARCH, OF_FLEET = keys_of(Goal), keys_of(ExchangeSettings, ExchangeMethod), keys_of(FleetSettings)
OF_RUNS = {name: key for name, key in keys_of(RunSettings).items() if name not in OF_SEARCH}
"""The keys of options in the tables [goal], [design], [fleet] and [runs]."""


def _with_keys(name: str, base: type[Table], given: Mapping[str, Key]) -> type[Table]:
    """A table with these keys too."""
    keys: dict[str, Any] = {label: (_annotated(key) | None, None) for label, key in given.items()}
    return create_model(name, __base__=base, **keys)


def _annotated(key: Key) -> Any:
    """The type of a key with its limits, as pydantic has it."""
    if key.choices:
        return Literal[key.choices]
    limits = {"ge": key.least, "le": key.most, "gt": key.above, "lt": key.below}
    number: dict[str, Any] = {name: limit for name, limit in limits.items() if limit is not None}
    if key.kind in (float, dict[str, float]):
        number["allow_inf_nan"] = False
    if key.kind == dict[str, float]:
        return dict[str, Annotated[float, Field(**number)]]
    return Annotated[key.kind, Field(**number)] if number else key.kind


if TYPE_CHECKING:  # what is known of them before the program runs
    GoalTable: TypeAlias = Table
    DesignTable: TypeAlias = ProblemKeys
    RunsTable: TypeAlias = RunKeys
    FleetTable: TypeAlias = FleetKeys
else:  # what is left out takes the library's default
    GoalTable = _with_keys("GoalTable", Table, OF_GOAL)
    DesignTable = _with_keys("DesignTable", ProblemKeys, OF_SEARCH)
    RunsTable = _with_keys("RunsTable", RunKeys, OF_RUNS)
    FleetTable = _with_keys("FleetTable", FleetKeys, OF_FLEET)


class CostTable(Table):
    """What experiments cost, in whatever unit."""

    fixed: NotNegative | None = None
    per_experiment: NotNegative | None = None
    per_second: NotNegative | None = None
    per_change: dict[str, NotNegative] | None = None

    def build(self) -> Cost:
        """The costs."""
        return Cost(**self.model_dump(exclude_none=True))


class CampaignTable(Table):
    """A campaign: how many points a batch has, and the relative standard errors to reach, one for all or by parameter."""

    batch: Annotated[int, Field(ge=1, le=MOST["n_experiments"])] | None = None
    targets: Target | dict[str, Target] | None = None

    @model_validator(mode="before")
    @classmethod
    def _old_name(cls, given: Any) -> Any:
        if isinstance(given, dict) and "rse" in given:
            fail("campaign.rse: expected campaign.targets, which is the name of this key now")
        return given
