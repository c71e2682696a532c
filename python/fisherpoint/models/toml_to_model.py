"""From the table [model] of a TOML file to the model: what may stand in the table, and how it is read."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from pydantic import Field, PrivateAttr, model_validator

from ..basics.checks import as_path
from ..basics.messages import listed, shortened, shown
from ..basics.quantity import Quantity
from ..basics.toml_mistakes import fail, fail_of, toml
from ..basics.toml_reader import parse_toml, read_toml
from ..basics.toml_tables import Abbreviated, Constant, Number, Positive, Table, validated, wrong_entries, wrong_names
from ..basics.units import convert_unit
from .base import Model
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
    definitions: dict[str, str] = Field(default_factory=dict)
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
                *(key for key in ("definitions", "domain", "resets") if getattr(self, key)),
            ):
                fail(f"model.{key}: expected only with a table [model.equations], given without")
        elif self.smooth is not None:
            fail("model.smooth: expected only with a built-in model, given with [model.equations]")
        return self

    @property
    def quantities(self) -> dict[str, Mapping[str, QuantityEntry]]:
        """States, inputs, parameters and outputs."""
        return {"states": self.states, "inputs": self.inputs, "parameters": self.parameters, "outputs": self.outputs}


class ModelFile(Table):
    """A file with a model, whatever else it has."""

    model: ModelTable

    _source: str = PrivateAttr("configuration")
    _model: Model | None = PrivateAttr(None)

    @model_validator(mode="after")
    def _build_model(self) -> ModelFile:
        if self.model.equations is None:
            kind = MODELS[self.model.name]
            fail_of(
                wrong_entries(
                    "model.constants", {name: one.unit for name, one in self.model.constants.items()}, kind.constant_quantities
                )
            )
            fail_of(wrong_names("model.smooth", self.model.smooth or (), (*kind.jumps, *kind.kinks)))
        try:
            self._model = _built(self.model)
        except (ValueError, TypeError) as error:
            key = "model.constants: " if self.model.equations is None else "model."
            fail(key + " ".join(str(error).split()))
        return self

    def build_model(self) -> Model:
        """The model of the file."""
        return self._model or _built(self.model)

    def warn_of_units(self, stacklevel: int = 2) -> None:
        """Warn of equations whose units do not fit, unless the file says that this is meant."""
        if self.model.equations is not None and self.model.check_units:
            from .symbolic import SymbolicModel  # which needs SymPy

            model = self.build_model()
            if isinstance(model, SymbolicModel):
                model.warn_of_units(stacklevel + 1)


def load_model(path: str | Path) -> Model:
    """Read a model from the table [model] of a TOML file, such as `Model.to_toml` writes; other tables are not looked at.

    Raises
    ------
    ConfigError
        If the file cannot be read or the model has a mistake: one line that names the file, the key and the place.
    """
    path = as_path(path, "path")
    data = read_toml(path)
    file = validated(ModelFile, {"model": data["model"]} if "model" in data else {}, path)
    file.warn_of_units(stacklevel=3)
    return file.build_model()


def model_from_toml(text: str) -> Model:
    """The model that `Model.to_toml` wrote."""
    return validated(ModelFile, parse_toml(text, "model"), "model").build_model()


def _built(table: ModelTable) -> Model:
    if table.equations is not None:
        return _of_equations(table)
    kind = MODELS[table.name]
    units = {quantity.name: quantity.unit for quantity in kind.constant_quantities}
    values = {name: convert_unit(entry.value, entry.unit or units[name], units[name]) for name, entry in table.constants.items()}
    return kind(smooth=table.smooth, **values)


def _of_equations(table: ModelTable) -> Model:
    """The model of a table [model] with equations.

    Raises
    ------
    ValueError
        One line that names the key below [model].
    """
    from .symbolic import SymbolicModel  # which needs SymPy

    described = {
        kind: {name: Quantity(name, entry.unit, entry.description, scale=entry.scale) for name, entry in entries.items()}
        for kind, entries in table.quantities.items()
    }
    constants = {
        name: (entry.value, Quantity(name, entry.unit or "1", entry.description)) for name, entry in table.constants.items()
    }
    nominal = {name: entry.nominal for name, entry in table.parameters.items() if entry.nominal is not None}
    f, g = _equations(table)
    kinds = (described[kind] for kind in ("states", "inputs", "parameters", "outputs"))
    return SymbolicModel(
        f,
        g,
        *kinds,
        constants=constants,
        domain=table.domain,
        name=table.name,
        nominal=nominal,
        resets=table.resets,
        definitions=table.definitions,
        check_units=False,
    )


def _equations(table: ModelTable) -> tuple[list[str], list[str]]:
    equations, states, outputs = table.equations or {}, table.states, table.outputs
    expected = list(dict.fromkeys([*states, *outputs]))
    for name in equations:
        if name not in expected:
            raise ValueError(
                f"equations.{shortened(name)}: expected an equation for each of {listed(expected)}; given one for {shown(name)}"
            )
    for name in expected:
        if name not in equations and (name in states or name not in table.inputs):
            what = f"the rate of {name}" if name in states else name
            raise ValueError(f"equations.{name}: expected {what} as a text, given none")
    for name, output in outputs.items():
        if output.equation is not None and name not in states:
            raise ValueError(f"outputs.{name}.equation: expected only for an output with the name of a state, given {shown(name)}")
    # Without an equation, an output with the name of a state or an input is that.
    g = [entry.equation or (name if name in states else equations.get(name, name)) for name, entry in outputs.items()]
    return [equations[name] for name in states], g
