"""The table of runs of the TOML file: how many segments, what may vary, when outputs are measured, which profiles inputs follow."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from inspect import signature
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator
from pydantic_core import PydanticCustomError

from ...basics.quantity import Quantity
from ...basics.toml_mistakes import fail, toml
from ...basics.toml_tables import Abbreviated, Constant, Count, Number, Positive, Table
from ...basics.units import convert_unit
from ...models import Model
from ...points.profile_kinds import PROFILES
from ...points.profiles import InputProfile
from ...points.rest import Rest


class Levels(Abbreviated):
    """The only values of an input: a bare list or ``{values, unit}``."""

    bare, expected = (list,), 'a list of numbers or {values = [...], unit = "..."}'

    values: Annotated[list[Number], Field(min_length=1)]
    unit: str | None = None


class Change(Constant):
    """The most that an input may change: a bare number or ``{value, unit}``."""

    value: Positive


class Instants(Abbreviated):
    """When an output is measured: a period, s, a list of instants, s, or ``{value, unit}``."""

    bare, expected = (int, float, list), 'a number, a list of numbers, or {value = ..., unit = "..."}'

    value: Positive | list[Positive]
    unit: str | None = None

    @property
    def given(self) -> Any:
        """As `RunRegion` takes it."""
        values = self.value if isinstance(self.value, list) else [self.value]
        return [*values, self.unit] if self.unit else self.value


class RestTable(Table):
    """How runs start at rest, as `Rest` has it: held inputs, and what else is given or found."""

    u: dict[str, Constant] = Field(default_factory=dict)
    states: list[str] | None = None
    hold: list[str] = Field(default_factory=list)
    outputs: dict[str, Constant] = Field(default_factory=dict)
    solve: list[str] = Field(default_factory=list)

    def build(self, model: Model) -> Rest:
        """The rest, in the units of a model."""
        u, outputs = (_in_units(of, by) for of, by in ((self.u, model.inputs), (self.outputs, model.outputs)))
        rest = Rest(u, states=self.states, hold=self.hold, outputs=outputs, solve=self.solve)
        rest.check(model)
        return rest


def _in_units(table: Mapping[str, Constant], quantities: Iterable[Quantity]) -> dict[str, float]:
    """Values in the units of the quantities; those of other names as they are."""
    units = {quantity.name: quantity.unit for quantity in quantities}
    known = {name: (entry.unit or units.get(name, "1"), units.get(name, entry.unit or "1")) for name, entry in table.items()}
    return {name: convert_unit(entry.value, *known[name]) for name, entry in table.items()}


class ProfileTable(Table):
    """How the values of an input follow from a few numbers, as the class of its kind has it."""

    kind: Literal["held", "ramps", "spline", "multisine", "chirp", "prbs", "given"]
    knots: Count | None = None
    harmonics: Count | list[Count] | None = None
    bandwidth: list[Positive] | None = None
    crest: Positive | None = None
    sweep: Literal["linear", "logarithmic"] | None = None
    order: Count | None = None
    hold: list[Count] | None = None
    values: list[Number] | None = None
    t: list[Number] | None = None

    @model_validator(mode="after")
    def _keys_of_the_kind(self) -> ProfileTable:
        taken = signature(PROFILES[self.kind]).parameters
        for key in self.model_dump(exclude={"kind"}, exclude_none=True):
            if key not in taken:
                fail(f"{key}: expected only for another kind of profile, given with kind = {toml(self.kind)}")
        for key in (key for key, of in taken.items() if of.default is of.empty and getattr(self, key) is None):
            fail(f"{key}: missing, for kind = {toml(self.kind)}")
        return self

    def build(self, name: str) -> InputProfile:
        """The profile of an input."""
        given = self.model_dump(exclude={"kind"}, exclude_none=True)
        try:
            return PROFILES[self.kind](**{key: tuple(of) if isinstance(of, list) else of for key, of in given.items()})
        except (TypeError, ValueError) as error:
            raise ValueError(f"profile['{name}'].{error}") from error


class RunKeys(Table):
    """Runs of several segments instead of points: how many, of what length, and what of them may vary."""

    segments: Count
    constant: list[str] = Field(default_factory=list)
    shared: list[str] = Field(default_factory=list)
    levels: dict[str, Levels] = Field(default_factory=dict)
    slew: dict[str, Change] = Field(default_factory=dict)
    duration: Positive | None = None
    lead_in: Annotated[int, Field(ge=0)] = 0
    samples: Count | None = None
    sample_every: Annotated[dict[str, Instants], Field(min_length=1)] | None = None  # "" for all outputs
    rest: RestTable | None = None
    profile: dict[str, ProfileTable] = Field(default_factory=dict)

    @field_validator("sample_every", mode="before")
    @classmethod
    def _of_all_or_each(cls, given: Any) -> Any:
        """Instants by themselves are those of all outputs."""
        if not isinstance(given, int | float | list | dict) or isinstance(given, bool):
            raise PydanticCustomError("expected", f"{Instants.expected}, or these for each output by name")
        return given if isinstance(given, dict) and set(given) - set(Instants.model_fields) else {"": given}

    @property
    def given(self) -> list[str]:
        """Inputs that are not designed."""
        return [name for name, table in self.profile.items() if table.kind == "given"]

    @model_validator(mode="after")
    def _something_is_measured(self) -> RunKeys:
        if self.lead_in >= self.segments:
            fail(f"runs.lead_in: expected fewer than all {self.segments} segments, given {self.lead_in}")
        if self.lead_in and self.sample_every is not None:
            fail(f"runs.lead_in: expected none beside runs.sample_every, given {self.lead_in}")
        return self

    def options(self, model: Model) -> dict[str, Any]:
        """Keyword arguments for `RunRegion`."""
        given = self.model_dump(include={"segments", "constant", "shared", "duration", "samples"})
        given["levels"] = {name: [*of.values, of.unit] if of.unit else of.values for name, of in self.levels.items()}
        given["slew"] = {name: _with_unit(of) for name, of in self.slew.items()}
        if self.sample_every is not None:
            every = {name: of.given for name, of in self.sample_every.items()}
            given["sample_every"] = every.get("", every)
        given["profile"] = {name: table.build(name) for name, table in self.profile.items()}
        rest = None if self.rest is None else self.rest.build(model)
        return given | {"measured": [n >= self.lead_in for n in range(self.segments)], "rest": rest}


def _with_unit(given: Constant) -> Any:
    return (given.value, given.unit) if given.unit else given.value
