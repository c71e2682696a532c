"""The TOML file of the command line: its schema, how it is read, and the objects that it describes.

Every mistake in a file becomes one :class:`ConfigError` of one line that names the key and what was expected there.
Units are checked, never converted: a file is in the units of the model, which are SI.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel, Field, PrivateAttr, ValidationError, model_validator

import fisherpoint as fp

from .config_messages import ConfigError, choices, describe, fail, toml, unknown_key
from .config_tables import (
    Bounds,
    CampaignTable,
    Constant,
    Correlation,
    DesignTable,
    ModelConstant,
    ModelTable,
    OutputEntry,
    ParameterEntry,
    PriorEntry,
    QuantityEntry,
    RegionTable,
    RuleTable,
    Std,
    Table,
)
from .models import MODELS
from .quantity import as_path
from .toml_data import parse_toml, read_toml

__all__ = ["Config", "ConfigError", "load_config", "load_model", "model_from_toml"]

Validated = TypeVar("Validated", bound=BaseModel)

_PROBLEM_KEYS = {"output_covariance", "parameters", "kinks", "assumed_covariance"}


class ModelFile(Table):
    """A file with a model, whatever else it has."""

    model: ModelTable

    _source: str = PrivateAttr("configuration")
    _model: fp.Model | None = PrivateAttr(None)

    @model_validator(mode="after")
    def _build_model(self) -> ModelFile:
        if self.model.equations is None:
            kind = MODELS[self.model.name]
            _check_table("model.constants", self.model.constants, kind.constant_quantities)
            _check_names("model.smooth", self.model.smooth or (), (*kind.jumps, *kind.kinks))
        try:
            self._model = self.model.build()
        except (ValueError, TypeError) as error:
            key = "model.constants: " if self.model.equations is None else "model."
            fail(key + " ".join(str(error).split()))
        return self

    def build_model(self) -> fp.Model:
        """The model of the file."""
        return self._model or self.model.build()


class Config(ModelFile):
    """A whole configuration file; made by :func:`load_config`."""

    prior: dict[str, PriorEntry]
    prior_correlation: dict[str, Correlation] = Field(default_factory=dict)
    noise_std: dict[str, Std] | None = None
    uncertain: dict[str, Std] = Field(default_factory=dict)
    initial_state_std: dict[str, Std] = Field(default_factory=dict)
    region: RegionTable | None = None
    rule: RuleTable = RuleTable()
    design: DesignTable = DesignTable()
    campaign: CampaignTable = CampaignTable()

    @model_validator(mode="after")
    def _check_against_model(self) -> Config:
        model = self.build_model()
        _check_table("prior", self.prior, model.parameters, missing="{mean = ..., std = ... or relative_std = ...}")
        if self.noise_std is not None:
            _check_table("noise_std", self.noise_std, model.outputs, missing="a number > 0")
        elif self.design.output_covariance == "noise":
            fail('design.output_covariance: expected a table [noise_std] with "noise", given none')
        if self.region is not None:
            _check_table("region", self.region.bounds, model.axes, missing="[lower, upper]", also=("constraints",))
            for name, axis in self.region.bounds.items():
                bounds = axis.bounds
                if len(bounds) != 2 or bounds[0] > bounds[1]:
                    fail(f"region.{name}.bounds: expected [lower, upper] with lower <= upper, given {toml(bounds)}")
        parameters = [quantity.name for quantity in model.parameters]
        seen = set()
        for pair in (self._pair(key, parameters) for key in self.prior_correlation):
            if frozenset(pair) in seen:
                fail(f'prior_correlation."{", ".join(pair)}": expected each pair once, given twice')
            seen.add(frozenset(pair))
        by_name = {"levels": "a whole number, 1 to keep the parameter at its mean", "edges": "a list of ascending numbers"}
        for key, expected in by_name.items():
            given = getattr(self.rule, key)
            if isinstance(given, dict):
                _check_names(f"rule.{key}", given, parameters)
                for name in parameters:
                    if name not in given:
                        fail(f"rule.{key}.{name}: missing; expected {expected}")
        if isinstance(self.campaign.rse, dict):
            _check_names("campaign.rse", self.campaign.rse, self.design.parameters or parameters)
        for name in self.design.parameters or ():
            if name not in parameters:
                fail(f"design.parameters: expected names out of {choices(parameters, name)}, given {toml(name)}")
        _check_table("uncertain", self.uncertain, (*model.constant_quantities, *model.parameters))
        for name in self.uncertain:
            if name in (self.design.parameters or parameters):
                fail(
                    f"uncertain.{name}: expected a constant, or a parameter that is not among design.parameters, given one that is"
                )
        _check_table("initial_state_std", self.initial_state_std, model.states)
        return self

    def build_prior(self) -> fp.GaussianPrior:
        """The prior, in the model's order of parameters."""
        names = [quantity.name for quantity in self.build_model().parameters]
        entries = [self.prior[name] for name in names]
        mean = {name: entry.mean for name, entry in zip(names, entries, strict=True)}
        std = [entry.std if entry.std is not None else (entry.relative_std or 0.0) * abs(entry.mean) for entry in entries]
        log = [name for name, entry in zip(names, entries, strict=True) if entry.log]
        with self._names_key("prior"):
            if not self.prior_correlation:
                return fp.GaussianPrior(mean, std=dict(zip(names, std, strict=True)), log=log)
            covariance = np.diag(np.square(std))
            for key, correlation in self.prior_correlation.items():
                i, j = (names.index(name) for name in self._pair(key, names))
                covariance[i, j] = covariance[j, i] = correlation * std[i] * std[j]
            return fp.GaussianPrior(mean, covariance=covariance, log=log)

    @staticmethod
    def _pair(key: str, parameters: list[str]) -> tuple[str, str]:
        """The two parameters that a key of [prior_correlation] names."""
        names = [name.strip() for name in key.split(",")]
        if len(names) != 2 or names[0] == names[1]:
            fail(f'prior_correlation."{key}": expected two parameters, as in "{parameters[-2]}, {parameters[-1]}"')
        _check_names("prior_correlation", names, parameters)
        return names[0], names[1]

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
            rule = self.rule.build()
        noise_std, uncertain, initial_state_std = (
            {name: entry.value for name, entry in (table or {}).items()}
            for table in (self.noise_std, self.uncertain, self.initial_state_std)
        )
        with self._names_key("design"):
            return fp.DesignProblem(
                model,
                prior,
                region,
                noise_std=noise_std or None,
                rule=rule,
                uncertain=uncertain,
                initial_state_std=initial_state_std,
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
    path = as_path(path, "path")
    config = _validated(Config, read_toml(path), path)
    config._source = str(path)
    return config


def load_model(path: str | Path) -> fp.Model:
    """Read a model from the table [model] of a TOML file, such as `Model.to_toml` writes; other tables are not looked at.

    Raises
    ------
    ConfigError
        If the file cannot be read or the model has a mistake: one line that names the file, the key and the place.
    """
    path = as_path(path, "path")
    data = read_toml(path)
    return _validated(ModelFile, {"model": data["model"]} if "model" in data else {}, path).build_model()


def model_from_toml(text: str) -> fp.Model:
    """The model that `Model.to_toml` wrote."""
    return _validated(ModelFile, parse_toml(text, "model"), "model").build_model()


def _validated(kind: type[Validated], data: dict[str, Any], path: str | Path) -> Validated:
    try:
        return kind.model_validate(data)
    except ValidationError as error:
        raise ConfigError(f"{path}: {describe(error, _keys_of)}") from None


def _keys_of(place: tuple[str, ...]) -> list[str]:
    """The keys that the table at this place may have."""
    if len(place) > 1:
        entries: dict[str, type[BaseModel]] = {"prior": PriorEntry, "region": Bounds}
        entries |= dict.fromkeys(("noise_std", "uncertain", "initial_state_std"), Std)
        in_model: dict[str, type[BaseModel]] = {"constants": ModelConstant, "parameters": ParameterEntry, "outputs": OutputEntry}
        return list(entries.get(place[0], in_model.get(place[1], QuantityEntry)).model_fields)
    tables: dict[str, type[BaseModel]] = {"": Config, "model": ModelTable, "rule": RuleTable, "design": DesignTable}
    tables["campaign"] = CampaignTable
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
