"""The TOML file of a problem: its schema, how it is read, and the objects that it describes.

All mistakes in a file become one :class:`ConfigError`, with a line for each that names the key and what was expected there.
Numbers that are given in another unit than the model's are converted to that; those without a unit are in the model's.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, Field, ValidationError, model_validator

from ...basics.checks import as_path
from ...basics.options import keys_of, options_of
from ...basics.quantity import names_of
from ...basics.toml_mistakes import MOST_LINES, ConfigError, describe, fail_of, misplaced_key, toml
from ...basics.toml_reader import read_toml
from ...information.local import RECORD, RUN
from ...information.problem import DesignProblem
from ...models.toml_to_model import ModelFile
from ...noise.models import Noise, NoiseModel, NoiseOf
from ...points.experiments import Experiments
from ...points.region import ExperimentRegion
from ...points.run_region import RunRegion
from ...prior.gaussian import GaussianPrior
from ...prior.rules import Rule
from ..fleet.fleet_settings import plant_names
from ..goal.goal import Goal
from ..results.cost import Cost
from ..results.settings import ExchangeMethod, ExchangeSettings, RunSettings
from .configuration_checks import mistakes_between, pair_of, valid_tables
from .configuration_tables import (
    OF_RUNS,
    OF_SEARCH,
    CampaignTable,
    Correlation,
    CostTable,
    DesignTable,
    FleetTable,
    GoalTable,
    LocalEntry,
    NoiseEntry,
    PriorEntry,
    ProblemKeys,
    RegionTable,
    RuleTable,
    RunsTable,
    Std,
    stds,
)

__all__ = ["Config", "ConfigError", "load_config", "load_problem"]

_PROBLEM_KEYS = set(ProblemKeys.model_fields)
_OF_METHOD = set(keys_of(ExchangeMethod))
_SHARED = {one.name for one in options_of(RunSettings)} & set(OF_SEARCH)


class Config(ModelFile):
    """A whole configuration file; made by :func:`load_config`."""

    prior: dict[str, PriorEntry]
    prior_correlation: dict[str, Correlation] = Field(default_factory=dict)
    noise: dict[str, NoiseEntry] | None = None
    noise_correlation: dict[str, Correlation] = Field(default_factory=dict)
    uncertain: dict[str, Std] = Field(default_factory=dict)
    varies: dict[str, Std] = Field(default_factory=dict)
    initial_state_std: dict[str, Std] = Field(default_factory=dict)
    local: dict[str, LocalEntry] = Field(default_factory=dict)
    region: RegionTable | None = None
    runs: RunsTable | None = None
    rule: RuleTable = RuleTable()
    goal: GoalTable = GoalTable()
    design: DesignTable = DesignTable()
    cost: CostTable | None = None
    campaign: CampaignTable = CampaignTable()
    fleet: FleetTable | None = None
    data: dict[str, str] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _check_against_model(self) -> Config:
        fail_of(mistakes_between(vars(self), self.build_model()))
        return self

    def build_prior(self) -> GaussianPrior:
        """The prior, in the model's order of parameters."""
        quantities = self.build_model().parameters
        names = list(names_of(quantities))
        entries = [self.prior[name] for name in names]
        with self._names_key("prior"):
            both = [entry.mean_and_std(quantity) for entry, quantity in zip(entries, quantities, strict=True)]
        mean, std = {name: mean for name, (mean, _) in zip(names, both, strict=True)}, [std for _, std in both]
        log = [name for name, entry in zip(names, entries, strict=True) if entry.log]
        with self._names_key("prior"):
            if not self.prior_correlation:
                return GaussianPrior(mean, std=dict(zip(names, std, strict=True)), log=log)
            covariance = np.diag(np.square(std))
            for key, correlation in self.prior_correlation.items():
                i, j = (names.index(name) for name in pair_of(key))
                covariance[i, j] = covariance[j, i] = correlation * std[i] * std[j]
            return GaussianPrior(mean, covariance=covariance, log=log)

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
        rule = self._build_rule()
        known = (*model.constant_quantities, *model.parameters)
        uncertain, varies = stds(self.uncertain, known), stds(self.varies, known)
        with self._names_key("design"):
            return DesignProblem(
                model,
                prior,
                region,
                noise=self._build_noise(),
                rule=rule,
                uncertain=uncertain,
                varies=varies,
                initial_state_std=stds(self.initial_state_std, model.states),
                local={q.name: self.local[q.name].build(q.unit) for q in model.parameters if q.name in self.local},
                **self.design.model_dump(include=_PROBLEM_KEYS, exclude_none=True),
            )

    @property
    def labels(self) -> tuple[str, ...]:
        """Columns of data that have labels, as local parameters need them."""
        return tuple(dict.fromkeys(entry.by for entry in self.local.values() if entry.by not in (RUN, RECORD)))

    def _build_noise(self) -> NoiseOf | None:
        units = {quantity.name: quantity.unit for quantity in self.build_model().outputs}
        built: dict[str, float | Noise] = {}
        for name, entry in (self.noise or {}).items():
            with self._names_key(f"noise.{name}"):
                built[name] = entry.build(units[name])
        if not self.noise_correlation:
            return built or None
        with self._names_key("noise_correlation"):
            return NoiseModel(built, correlation=self.noise_correlation)

    def _build_rule(self) -> Rule:
        with self._names_key("rule"):
            return self.rule.build()

    def _region(self) -> ExperimentRegion | RunRegion | None:
        if self.region is None:
            return None
        axes = [axis for axis in self.build_model().axes if self.runs is None or axis.name not in self.runs.given]
        bounds = {axis.name: self.region.bounds[axis.name].pair(axis) for axis in axes}
        if self.runs is None:
            with self._names_key("region"):
                return ExperimentRegion(bounds, constraints=self.region.constraints)
        if self.region.constraints:
            raise self.error("region.constraints", "expected only for points, given beside [runs]")
        with self._names_key("runs"):
            model = self.build_model()
            return RunRegion(bounds, **self.runs.options(model)).in_units_of(model)

    def _check_values(self) -> None:
        """Raise what the library refuses, of all tables together."""
        lines: list[str] = []
        for build in (self.build_prior, self._build_noise, self._build_rule, self._region, self.exchange_settings, self.build_cost):
            try:
                build()
            except ConfigError as error:
                lines += error.lines
        if lines:
            raise ConfigError(*lines)

    def crossings(self) -> dict[str, Any]:
        """Keyword arguments for :func:`fisherpoint.simulate`: whether kinks and jumps are crossed, where the file says it."""
        return self.design.model_dump(include={"kinks", "jumps"}, exclude_none=True)

    def build_goal(self) -> Goal:
        """What the design is to be good for."""
        with self._names_key("goal"):
            return Goal.from_table(self.goal.model_dump(exclude_none=True), self._conditions)

    def _conditions(self, name: str) -> Experiments:
        path = Path(self._source).parent / name
        try:
            return Experiments.from_csv(path, self.build_model())
        except OSError as error:
            raise ValueError(f"conditions: expected a file of points, {path} cannot be read: {error.strerror}") from error

    def exchange_settings(self) -> dict[str, Any]:
        """Keyword arguments for :func:`fisherpoint.exchange`; what the file leaves out is left to its defaults."""
        settings = self.design.model_dump(exclude=_PROBLEM_KEYS | _OF_METHOD, exclude_none=True)
        of_method = self.design.model_dump(include=_OF_METHOD, exclude_none=True)
        with self._names_key("design"):
            method = ExchangeMethod(settings.pop("method", ExchangeMethod.name), **of_method)
        return settings | {"goal": self.build_goal(), "method": method}

    def run_settings(self) -> dict[str, Any]:
        """Keyword arguments for :func:`fisherpoint.design_runs`; what the file leaves out is left to its defaults."""
        given = {} if self.runs is None else self.runs.model_dump(include=set(OF_RUNS), exclude_none=True)
        return given | self.design.model_dump(include=_SHARED, exclude_none=True) | {"goal": self.build_goal()}

    def fleet_settings(self) -> dict[str, Any]:
        """Keyword arguments for :func:`fisherpoint.design_fleet`; what the file leaves out is left to its defaults."""
        if self.fleet is None:
            raise self.error("fleet", "missing; expected a table with plants")
        of_runs = self.runs is not None
        given = self.design.model_dump(include=set(OF_SEARCH), exclude_none=True)
        of_region = {} if self.runs is None else self.runs.model_dump(include=set(OF_RUNS), exclude_none=True)
        size = "n_runs" if of_runs else "n_experiments"
        known = {size, "seed", "n_candidates", *(() if of_runs else ("max_iterations",))}
        for table, keys in (("design", given), ("runs", of_region)):
            for name in (name for name in keys if name not in known):
                raise self.error(f"{table}.{name}", f"expected none beside [fleet], given {toml(keys[name])}")
        with self._names_key("fleet"):
            plant_names(self.fleet.plants)
        default = RunSettings.n_runs if of_runs else ExchangeSettings.n_experiments
        found = {"size": default} | {"size" if name == size else name: value for name, value in {**given, **of_region}.items()}
        return self.fleet.model_dump(exclude_none=True) | found | {"goal": self.build_goal()}

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
            raise ConfigError(f"{self._source}: {_in_file(key, ' '.join(str(error).split()))}") from error


def load_config(path: str | Path) -> Config:
    """Read and check a TOML file.

    Parameters
    ----------
    path
        The file; see ``examples/cylinder.toml`` for a commented one.

    Raises
    ------
    ConfigError
        If the file cannot be read, is not TOML, or has unknown keys, wrong units, bounds upside down, missing parameters,
        ...: a line for each mistake, with the file, the key and what was expected; they are in its `lines` too.
    """
    path = as_path(path, "path")
    data = read_toml(path)
    try:
        config = Config.model_validate(data)
    except ValidationError as error:
        # What does not fit the model is looked for by pydantic only where each table is valid in itself.
        lines = dict.fromkeys(
            [*describe(error, partial(misplaced_key, Config)), *islice(mistakes_of_valid_tables(data), MOST_LINES)]
        )
        raise ConfigError(*(f"{path}: {line}" for line in islice(lines, MOST_LINES))) from None
    config._source = str(path)
    config._check_values()
    config.warn_of_units(stacklevel=3)
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
        Where the file cannot be read, or has mistakes: a line for each, with the file, the key and what was expected.
    """
    return load_config(path).problem()


def mistakes_of_valid_tables(data: Mapping[str, Any]) -> Iterable[str]:
    """What does not fit the model in the tables that are valid in themselves, of a file with others that are not."""
    if "model" not in data:
        return []
    try:
        model = ModelFile.model_validate({"model": data["model"]}).build_model()
    except ValidationError as error:
        return describe(error, partial(misplaced_key, Config))
    return mistakes_between(valid_tables(Config, data), model)


def _in_file(key: str, message: str) -> str:
    """What the library says of a value of the table `key`, by the key of the file."""
    if key == "runs" and message.startswith("rest."):
        return f"runs.{message}"
    found = _OF_LIBRARY.fullmatch(message)
    if found is not None:
        name, entry, part, said = found.groups()
        entry = f"{entry}.{part}" if entry and part else entry
        if name == key and entry:
            return f"{key}.{entry}: {said}"
        if key == "prior" and entry:
            return f"{key}.{entry}.{name}: {said}"
        if key.startswith("noise.") and name in NoiseEntry.model_fields:
            return f"{key}.{name}: {said}"
        if key in _TABLES and name in _TABLES[key].model_fields:
            return f"{key}.{name}{f'.{entry}' if entry else ''}: {said}"
    return f"{key}: {message}"


_OF_LIBRARY = re.compile(r"(\w+)(?:\['(.*?)'\])?(?:\.(\w+))?: (.*)")
_TABLES: dict[str, type[BaseModel]] = {
    "runs": RunsTable,
    "rule": RuleTable,
    "goal": GoalTable,
    "design": DesignTable,
    "cost": CostTable,
    "campaign": CampaignTable,
    "fleet": FleetTable,
}
