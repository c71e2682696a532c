"""The table [model] of a TOML file, with what may stand in it."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import Field, model_validator

from ..basics.messages import listed
from ..basics.toml_messages import fail, toml
from ..basics.toml_tables import Abbreviated, Constant, Number, Positive, Table
from .hydraulic_cylinder import MODELS


class ModelConstant(Constant):
    """A known constant of the model: a bare number or ``{value, unit, description}``."""

    description: str = ""


class QuantityEntry(Abbreviated):
    """A state or an input: a unit, or a table with its natural size and a description too."""

    bare, expected = (str,), 'a unit such as "m/s", or {unit = "m/s", scale = ...}'

    unit: str
    scale: Positive | None = None
    description: str = ""


class ParameterEntry(QuantityEntry):
    """A parameter: as any quantity, with a usual value."""

    nominal: Number | None = None


class OutputEntry(QuantityEntry):
    """An output: as any quantity, with its equation where it has the name of a state but is another."""

    equation: str | None = None


class ModelTable(Table):
    """Which model and its known constants where they differ from the defaults, or a model's equations and quantities.

    `smooth` is that of `HydraulicCylinder`.
    """

    name: str
    smooth: dict[str, Positive] | None = None
    states: dict[str, QuantityEntry] = Field(default_factory=dict)
    inputs: dict[str, QuantityEntry] = Field(default_factory=dict)
    parameters: dict[str, ParameterEntry] = Field(default_factory=dict)
    constants: dict[str, ModelConstant] = Field(default_factory=dict)
    outputs: dict[str, OutputEntry] = Field(default_factory=dict)
    equations: dict[str, str] | None = None
    domain: list[str] = Field(default_factory=list)
    resets: dict[str, dict[str, str]] = Field(default_factory=dict)
    check_units: bool = True

    @model_validator(mode="after")
    def _equations_or_a_known_name(self) -> ModelTable:
        if self.equations is None:
            if self.name not in MODELS:
                fail(f"model.name: expected one of {listed(MODELS)}, given {toml(self.name)}")
            for key in (
                *(kind for kind, given in self.quantities.items() if given),
                *(["domain"] if self.domain else []),
                *(["resets"] if self.resets else []),
            ):
                fail(f"model.{key}: expected only with a table [model.equations], given without")
        elif self.smooth is not None:
            fail("model.smooth: expected only with a built-in model, given with [model.equations]")
        return self

    @property
    def quantities(self) -> dict[str, Mapping[str, QuantityEntry]]:
        """States, inputs, parameters and outputs."""
        return {"states": self.states, "inputs": self.inputs, "parameters": self.parameters, "outputs": self.outputs}
