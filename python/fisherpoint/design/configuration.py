"""The TOML file of a problem: its schema, how it is read, and the objects that it describes.

Every mistake in a file becomes one :class:`ConfigError` of one line that names the key and what was expected there.
Units are checked, never converted: a file is in the units of the model, which are SI.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, Field, model_validator

from ..basics.checks import as_path
from ..basics.toml_data import read_toml
from ..basics.toml_messages import ConfigError, choices, fail, toml
from ..basics.toml_tables import check_names, check_table, validated
from ..information.problem import DesignProblem
from ..models.toml import ModelFile, keys_of
from ..points.region import ExperimentRegion
from ..points.run_region import RunRegion
from ..prior.gaussian import GaussianPrior
from .configuration_tables import (
    Bounds,
    CampaignTable,
    Correlation,
    CostTable,
    DesignTable,
    PriorEntry,
    RegionTable,
    RuleTable,
    RunsTable,
    Std,
)
from .cost import Cost

__all__ = ["Config", "ConfigError", "load_config", "load_problem"]

_PROBLEM_KEYS = {"output_covariance", "parameters", "kinks", "jumps", "assumed_covariance", "along"}


class Config(ModelFile):
    """A whole configuration file; made by :func:`load_config`."""

    prior: dict[str, PriorEntry]
    prior_correlation: dict[str, Correlation] = Field(default_factory=dict)
    noise_std: dict[str, Std] | None = None
    uncertain: dict[str, Std] = Field(default_factory=dict)
    initial_state_std: dict[str, Std] = Field(default_factory=dict)
    region: RegionTable | None = None
    runs: RunsTable | None = None
    rule: RuleTable = RuleTable()
    design: DesignTable = DesignTable()
    cost: CostTable | None = None
    campaign: CampaignTable = CampaignTable()

    @model_validator(mode="after")
    def _check_against_model(self) -> Config:
        model = self.build_model()
        check_table("prior", self.prior, model.parameters, missing="{mean = ..., std = ... or relative_std = ...}")
        if self.noise_std is not None:
            check_table("noise_std", self.noise_std, model.outputs, missing="a number > 0")
        elif self.design.output_covariance == "noise":
            fail('design.output_covariance: expected a table [noise_std] with "noise", given none')
        if self.region is not None:
            check_table("region", self.region.bounds, model.axes, missing="[lower, upper]", also=("constraints",))
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
                check_names(f"rule.{key}", given, parameters)
                for name in parameters:
                    if name not in given:
                        fail(f"rule.{key}.{name}: missing; expected {expected}")
        if isinstance(self.campaign.targets, dict):
            check_names("campaign.targets", self.campaign.targets, self.design.parameters or parameters)
        for name in self.design.parameters or ():
            if name not in parameters:
                fail(f"design.parameters: expected names from {choices(parameters, name)}, given {toml(name)}")
        check_table("uncertain", self.uncertain, (*model.constant_quantities, *model.parameters))
        for name in self.uncertain:
            if name in (self.design.parameters or parameters):
                fail(
                    f"uncertain.{name}: expected a constant, or a parameter that is not among design.parameters, given one that is"
                )
        check_table("initial_state_std", self.initial_state_std, model.states)
        return self

    def build_prior(self) -> GaussianPrior:
        """The prior, in the model's order of parameters."""
        names = [quantity.name for quantity in self.build_model().parameters]
        entries = [self.prior[name] for name in names]
        mean = {name: entry.mean for name, entry in zip(names, entries, strict=True)}
        std = [entry.std if entry.std is not None else (entry.relative_std or 0.0) * abs(entry.mean) for entry in entries]
        log = [name for name, entry in zip(names, entries, strict=True) if entry.log]
        with self._names_key("prior"):
            if not self.prior_correlation:
                return GaussianPrior(mean, std=dict(zip(names, std, strict=True)), log=log)
            covariance = np.diag(np.square(std))
            for key, correlation in self.prior_correlation.items():
                i, j = (names.index(name) for name in self._pair(key, names))
                covariance[i, j] = covariance[j, i] = correlation * std[i] * std[j]
            return GaussianPrior(mean, covariance=covariance, log=log)

    @staticmethod
    def _pair(key: str, parameters: list[str]) -> tuple[str, str]:
        """The two parameters that a key of [prior_correlation] names."""
        names = [name.strip() for name in key.split(",")]
        if len(names) != 2 or names[0] == names[1]:
            fail(f'prior_correlation."{key}": expected two parameters, as in "{parameters[-2]}, {parameters[-1]}"')
        check_names("prior_correlation", names, parameters)
        return names[0], names[1]

    def problem(self) -> DesignProblem:
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
        model, prior, region = self.build_model(), self.build_prior(), self._region()
        with self._names_key("rule"):
            rule = self.rule.build()
        noise_std, uncertain, initial_state_std = (
            {name: entry.value for name, entry in (table or {}).items()}
            for table in (self.noise_std, self.uncertain, self.initial_state_std)
        )
        with self._names_key("design"):
            return DesignProblem(
                model,
                prior,
                region,
                noise_std=noise_std or None,
                rule=rule,
                uncertain=uncertain,
                initial_state_std=initial_state_std,
                **self.design.model_dump(include=_PROBLEM_KEYS, exclude_none=True),
            )

    def _region(self) -> ExperimentRegion | RunRegion | None:
        if self.region is None:
            return None
        bounds = {name: (axis.bounds[0], axis.bounds[1]) for name, axis in self.region.bounds.items()}
        if self.runs is None:
            with self._names_key("region"):
                return ExperimentRegion(bounds, constraints=self.region.constraints)
        if self.region.constraints:
            raise self.error("region.constraints", "expected only for points, given beside [runs]")
        with self._names_key("runs"):
            return RunRegion(bounds, **self.runs.options())

    def crossings(self) -> dict[str, Any]:
        """Keyword arguments for :func:`fisherpoint.simulate`: whether kinks and jumps are crossed, where the file says it."""
        return self.design.model_dump(include={"kinks", "jumps"}, exclude_none=True)

    def exchange_settings(self) -> dict[str, Any]:
        """Keyword arguments for :func:`fisherpoint.exchange`; what the file leaves out is left to its defaults."""
        settings = self.design.model_dump(exclude=_PROBLEM_KEYS | {"over", "scenarios", "share"}, exclude_none=True)
        with self._names_key("design"):
            over = self.design.over_prior()
        return settings if over is None else settings | {"over": over}

    def run_settings(self) -> dict[str, Any]:
        """Keyword arguments for :func:`fisherpoint.design_runs`; what the file leaves out is left to its defaults."""
        search = {} if self.runs is None else self.runs.search()
        return search | self.design.model_dump(include={"n_candidates", "seed", "time_limit"}, exclude_none=True)

    def build_cost(self) -> Cost | None:
        """What experiments cost, where the file says it."""
        if self.cost is None:
            return None
        with self._names_key("cost"):
            cost = self.cost.build()
            cost.check(self.build_model())
            return cost

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
    config = validated(Config, read_toml(path), path, _keys_of)
    config._source = str(path)
    return config


def load_problem(path: str | Path) -> DesignProblem:
    """Read a design problem from a TOML file, as the command line does; its tables [design] and [campaign] are checked too.

    Parameters
    ----------
    path : path
        The file, such as ``examples/cylinder.toml``.

    Returns
    -------
    DesignProblem
        Its region is None where the file has no ``[region]``: such a problem can be evaluated, not optimised.

    Raises
    ------
    ConfigError
        Where the file cannot be read, or has a mistake: one line that names the file, the key and what was expected.
    """
    return load_config(path).problem()


def _keys_of(place: tuple[str, ...]) -> list[str]:
    """The keys that the table at this place may have."""
    if place[:1] == ("model",):
        return keys_of(place)
    if len(place) > 1:
        entries: dict[str, type[BaseModel]] = {"prior": PriorEntry, "region": Bounds}
        return list(entries.get(place[0], Std).model_fields)
    tables: dict[str, type[BaseModel]] = {
        "": Config,
        "runs": RunsTable,
        "rule": RuleTable,
        "design": DesignTable,
        "cost": CostTable,
        "campaign": CampaignTable,
    }
    return list(tables["".join(place)].model_fields)
