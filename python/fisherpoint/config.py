"""The TOML file of the command line: its schema, how it is read, and the objects that it describes.

Every mistake in a file becomes one :class:`ConfigError` of one line that names the key and what was expected there.
Units are checked, never converted: a file is in the units of the model, which are SI.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, ValidationError, model_validator
from pydantic_core import PydanticCustomError

import fisherpoint as fp

from .config_messages import ConfigError, describe, fail, listed, toml, unknown_key
from .models import MODELS

__all__ = ["Config", "ConfigError", "load_config"]

Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Count = Annotated[int, Field(ge=1)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


class Constant(_Table):
    """A known constant of the model: a bare number or ``{value, unit}``."""

    value: Number
    unit: str | None = None

    @model_validator(mode="before")
    @classmethod
    def _bare_number(cls, given: Any) -> Any:
        if _is_number(given):
            return {"value": given}
        if not isinstance(given, dict):
            raise PydanticCustomError("expected", 'a number or {value = ..., unit = "..."}')
        return given


class NoiseStd(Constant):
    """Standard deviation of one sensor: a bare number or ``{value, unit}``."""

    value: Positive


class PriorEntry(_Table):
    """Mean and standard deviation of one parameter before any experiment."""

    mean: Number
    std: Positive | None = None
    relative_std: Positive | None = None
    unit: str | None = None

    @model_validator(mode="after")
    def _exactly_one_std(self) -> PriorEntry:
        if (self.std is None) == (self.relative_std is None):
            raise PydanticCustomError("expected", "exactly one of std and relative_std")
        return self


class Bounds(_Table):
    """Range of one state, input or of dt: a bare pair or ``{bounds, unit}``; equal bounds fix the value."""

    bounds: list[Number]
    unit: str | None = None

    @model_validator(mode="before")
    @classmethod
    def _bare_pair(cls, given: Any) -> Any:
        if isinstance(given, list):
            return {"bounds": given}
        if not isinstance(given, dict):
            raise PydanticCustomError("expected", 'a pair [lower, upper] or {bounds = [lower, upper], unit = "..."}')
        return given


class ModelTable(_Table):
    """Which model, and its known constants where they differ from the defaults."""

    name: str
    constants: dict[str, Constant] = {}


class RegionTable(_Table):
    """Bounds of every state, every input and dt, by name, and constraints between them."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Bounds] = Field(init=False)
    constraints: list[str] = []

    @property
    def bounds(self) -> dict[str, Bounds]:
        return self.__pydantic_extra__


class RuleTable(_Table):
    """The grid over the prior, (11)-(13)."""

    kind: Literal["tensor_grid"] = "tensor_grid"
    levels: Count | dict[str, Count] | None = None
    span: Positive | None = None


class DesignTable(_Table):
    """What is optimised and for how long; what is left out takes the library's default."""

    n_experiments: Count | None = None
    n_candidates: Count | None = None
    max_iterations: Count | None = None
    seed: Annotated[int, Field(ge=0)] | None = None
    patience: Count | None = None
    time_limit: Positive | None = None
    output_covariance: Literal["noise", "region", "pooled", "pointwise"] | None = None
    parameters: Annotated[list[str], Field(min_length=1)] | None = None
    kinks: Literal["cross", "exclude"] | None = None


_PROBLEM_KEYS = {"output_covariance", "parameters", "kinks"}


class Config(_Table):
    """A whole configuration file; made by :func:`load_config`."""

    model: ModelTable
    prior: dict[str, PriorEntry]
    noise_std: dict[str, NoiseStd] | None = None
    region: RegionTable | None = None
    rule: RuleTable = RuleTable()
    design: DesignTable = DesignTable()

    _source: str = PrivateAttr("configuration")

    @model_validator(mode="after")
    def _check_against_model(self) -> Config:
        if self.model.name not in MODELS:
            fail(f"model.name: expected one of {listed(MODELS)}, given {toml(self.model.name)}")
        model = MODELS[self.model.name]()
        _check_table("model.constants", self.model.constants, model.constant_quantities)
        _check_table("prior", self.prior, model.parameters, missing="{mean = ..., std = ... or relative_std = ...}")
        if self.noise_std is not None:
            _check_table("noise_std", self.noise_std, model.outputs, missing="a number > 0")
        elif self.design.output_covariance == "noise":
            fail('design.output_covariance: expected a table [noise_std] with "noise", given none')
        if self.region is not None:
            axes = (*model.states, *model.inputs, fp.Quantity("dt", "s", "duration"))
            _check_table("region", self.region.bounds, axes, missing="[lower, upper]", also=("constraints",))
            for name, axis in self.region.bounds.items():
                pair = axis.bounds
                if len(pair) != 2 or pair[0] > pair[1]:
                    fail(f"region.{name}.bounds: expected [lower, upper] with lower <= upper, given {toml(pair)}")
        parameters = [quantity.name for quantity in model.parameters]
        if isinstance(self.rule.levels, dict):
            _check_names("rule.levels", self.rule.levels, parameters)
            for name in parameters:
                if name not in self.rule.levels:
                    fail(f"rule.levels.{name}: missing; expected a whole number, 1 to keep the parameter at its mean")
        for name in self.design.parameters or ():
            if name not in parameters:
                fail(f"design.parameters: expected names out of {listed(parameters, name)}, given {toml(name)}")
        return self

    def build_model(self) -> fp.HydraulicCylinder:
        """The model with the file's constants."""
        with self._names_key("model.constants"):
            return MODELS[self.model.name](**{name: entry.value for name, entry in self.model.constants.items()})

    def build_prior(self) -> fp.GaussianPrior:
        """The prior, in the model's order of parameters."""
        names = [quantity.name for quantity in MODELS[self.model.name]().parameters]
        entries = {name: self.prior[name] for name in names}
        with self._names_key("prior"):
            return fp.GaussianPrior(
                mean={name: entry.mean for name, entry in entries.items()},
                std={
                    name: entry.std if entry.std is not None else (entry.relative_std or 0.0) * abs(entry.mean)
                    for name, entry in entries.items()
                },
            )

    def problem(self) -> fp.DesignProblem:
        """The design problem that the file describes.

        Returns
        -------
        fisherpoint.DesignProblem
            Its region is None where the file has no ``[region]``: such a problem can be evaluated, not optimised.

        Raises
        ------
        ConfigError
            If the library refuses a value; the message names the table.
        """
        model, prior, region = self.build_model(), self.build_prior(), None
        if self.region is not None:
            bounds = {name: (axis.bounds[0], axis.bounds[1]) for name, axis in self.region.bounds.items()}
            with self._names_key("region"):
                region = fp.ExperimentRegion(bounds, constraints=self.region.constraints)
        with self._names_key("rule"):
            rule = fp.TensorGrid(**self.rule.model_dump(exclude={"kind"}, exclude_none=True))
        noise_std = None if self.noise_std is None else {name: entry.value for name, entry in self.noise_std.items()}
        with self._names_key("design"):
            return fp.DesignProblem(
                model,
                prior,
                region,
                noise_std=noise_std,
                rule=rule,
                **self.design.model_dump(include=_PROBLEM_KEYS, exclude_none=True),
            )

    def exchange_settings(self) -> dict[str, Any]:
        """Keyword arguments for :func:`fisherpoint.exchange`; what the file leaves out is left to its defaults."""
        return self.design.model_dump(exclude=_PROBLEM_KEYS, exclude_none=True)

    def error(self, key: str, text: str) -> ConfigError:
        """A :class:`ConfigError` about `key` of this file."""
        return ConfigError(f"{self._source}: {key}: {text}")

    @contextmanager
    def _names_key(self, key: str) -> Iterator[None]:
        try:
            yield
        except (ValueError, TypeError) as error:
            raise self.error(key, " ".join(str(error).split())) from error


def load_config(path: str | Path) -> Config:
    """Read and check a TOML file.

    Parameters
    ----------
    path
        The file; see ``examples/cylinder.toml`` for a commented one.

    Raises
    ------
    ConfigError
        If the file cannot be read, is not TOML, or has an unknown key, a wrong unit, a bound upside down, a missing
        parameter, ...: one line that names the file, the key and what was expected.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ConfigError(f"{path}: expected a TOML file, found no such file") from None
    except IsADirectoryError:
        raise ConfigError(f"{path}: expected a TOML file, given a directory") from None
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: expected a TOML file in UTF-8, given other bytes") from None
    except OSError as error:
        raise ConfigError(f"{path}: expected a readable TOML file, given: {error.strerror}") from error
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path}: not valid TOML: {error}") from None
    try:
        config = Config.model_validate(data)
    except ValidationError as error:
        raise ConfigError(f"{path}: {describe(error, _keys_of)}") from None
    config._source = str(path)
    return config


def _keys_of(place: tuple[str, ...]) -> list[str]:
    """The keys that the table at this place may have."""
    if len(place) > 1:
        entries: dict[str, type[BaseModel]] = {
            "prior": PriorEntry,
            "noise_std": NoiseStd,
            "region": Bounds,
            "model": Constant,
        }
        return list(entries[place[0]].model_fields)
    tables: dict[str, type[BaseModel]] = {"": Config, "model": ModelTable, "rule": RuleTable, "design": DesignTable}
    return list(tables["".join(place)].model_fields)


def _check_names(table: str, given: Iterable[str], expected: Iterable[str]) -> None:
    expected = list(expected)
    for name in given:
        if name not in expected:
            fail(unknown_key(table, name, expected))


def _check_table(
    table: str,
    given: Mapping[str, Constant | PriorEntry | Bounds],
    quantities: Iterable[fp.Quantity],
    missing: str = "",
    also: tuple[str, ...] = (),
) -> None:
    """Check names, units and, where `missing` says what is expected, completeness of a table keyed by quantity."""
    units = {quantity.name: quantity.unit for quantity in quantities}
    _check_names(table, given, [*units, *also])
    for name, unit in units.items():
        entry = given.get(name)
        if entry is None:
            if missing:
                fail(f"{table}.{name}: missing; expected {missing}" + (f" in {unit}" if unit != "1" else ""))
        elif entry.unit is not None and entry.unit != unit:
            fail(f"{table}.{name}.unit: expected {toml(unit)}, given {toml(entry.unit)}")
