"""Mismatches of a configuration's tables with the model, or each other; and the valid tables where not all are."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any

from pydantic import BaseModel, TypeAdapter, ValidationError

from ...basics.messages import listed
from ...basics.quantity import names_of
from ...basics.toml_mistakes import choices, toml
from ...basics.toml_tables import missing_entries, missing_names, wrong_entries, wrong_names
from ...data.labels import LABELS
from ...data.measurement_files import column_names
from ...models import Model
from .configuration_tables import BoundsEntry, LocalEntry, NoiseEntry, PriorEntry, RegionTable, Std

ENTRIES: Mapping[str, type[BaseModel]] = {
    "prior": PriorEntry,
    "noise": NoiseEntry,
    "uncertain": Std,
    "varies": Std,
    "initial_state_std": Std,
    "local": LocalEntry,
    "region": BoundsEntry,
}
"""Tables with an entry for each quantity."""


def valid_tables(config: type[BaseModel], data: Mapping[str, Any]) -> dict[str, Any]:
    """The tables of a file that are valid in themselves, and others keyed by quantity with None for what is wrong in them."""
    found: dict[str, Any] = {}
    for name, field in config.model_fields.items():
        if name not in data:
            if not field.is_required():  # else it is missing, which is reported elsewhere
                found[name] = field.get_default(call_default_factory=True)
            continue
        given = data[name]
        valid = _valid(field.annotation, given)
        if valid is not None:
            found[name] = valid
        elif name in ENTRIES and isinstance(given, dict):
            found[name] = {key: _valid(ENTRIES[name], entry) for key, entry in given.items() if key != "constraints"}
    return found


def _valid(kind: Any, given: Any) -> Any:
    try:
        return TypeAdapter(kind).validate_python(given, strict=True)
    except ValidationError:
        return None


def mistakes_between(tables: Mapping[str, Any], model: Model) -> Iterator[str]:
    """A line for each mistake; tables that are missing here are wrong in themselves, which is reported elsewhere."""
    parameters = list(names_of(model.parameters))
    design, campaign, rule = (tables.get(name) for name in ("design", "campaign", "rule"))
    if (prior := tables.get("prior")) is not None:
        yield from wrong_entries("prior", _units(prior), model.parameters, missing="{mean = ..., std = ... or relative_std = ...}")
    yield from _wrong_pairs("prior_correlation", tables.get("prior_correlation") or {}, parameters, "parameters")
    if (noise := tables.get("noise")) is not None:
        yield from wrong_entries("noise", _units(noise), model.outputs)
        if not noise:
            yield f"noise: expected at least one of {listed(names_of(model.outputs))}, given none"
        outputs = [name for name in names_of(model.outputs) if name in noise]
        yield from _wrong_pairs("noise_correlation", tables.get("noise_correlation") or {}, outputs, "outputs of [noise]")
    elif "noise" in tables and design is not None and design.output_covariance == "noise":
        yield 'design.output_covariance: expected a table [noise] with "noise", given none'
    runs = tables.get("runs")
    yield from _wrong_bounds(tables.get("region"), model, () if runs is None else runs.given)
    if runs is not None:
        yield from wrong_names("runs.profile", runs.profile, names_of(model.inputs))
    if runs is not None and runs.rest is not None:
        yield from wrong_names("runs.rest.u", runs.rest.u, names_of(model.inputs))
        if not (runs.rest.hold or runs.rest.outputs or runs.rest.solve):  # of a rest under control, `Rest` says what is missing
            yield from missing_entries("runs.rest.u", missing_names(runs.rest.u, names_of(model.inputs)), "the input that is held")
    local = tables.get("local") or {}
    yield from wrong_entries("local", _units(local), model.parameters)
    estimated = [name for name in parameters if name not in local]
    if not estimated:
        yield f"local: expected a parameter that is not local, given all of {', '.join(parameters)}"
    if design is not None and design.parameters is not None:
        estimated = design.parameters
        for name in (name for name in estimated if name not in parameters):
            yield f"design.parameters: expected names from {choices(parameters, name)}, given {toml(name)}"
    for label in ("uncertain", "varies"):
        if (given := tables.get(label)) is not None:
            yield from wrong_entries(label, _units(given), (*model.constant_quantities, *model.parameters))
            for name in (name for name in given if name in estimated and design is not None):
                yield f"{label}.{name}: expected a constant, or a parameter that is not among design.parameters, given one that is"
    for name in (name for name in local if name in estimated and design is not None):
        yield f"local.{name}: expected a parameter that is not among design.parameters, given one that is"
    for label in ("uncertain", "varies"):
        for name in (name for name in local if name in (tables.get(label) or ())):
            yield f"local.{name}: expected a name that is not in [{label}], given one that is"
    for name in (name for name in tables.get("varies") or () if name in (tables.get("uncertain") or ())):
        yield f"varies.{name}: expected a name that is not in [uncertain], given one that is"
    if (starts := tables.get("initial_state_std")) is not None:
        yield from wrong_entries("initial_state_std", _units(starts), model.states)
    by_name = {"levels": "a whole number, 1 to keep the parameter at its mean", "edges": "a list of ascending numbers"}
    for key, expected in by_name.items():
        given = getattr(rule, key, None)
        if isinstance(given, dict):
            yield from wrong_names(f"rule.{key}", given, parameters)
            yield from missing_entries(f"rule.{key}", missing_names(given, parameters), expected)
    labels = (*LABELS, *(entry.by for entry in local.values() if entry is not None))
    yield from wrong_names("data", tables.get("data") or (), (*column_names(model), *labels))
    if campaign is not None and isinstance(campaign.targets, dict):
        yield from wrong_names("campaign.targets", campaign.targets, estimated)


def _wrong_bounds(
    region: RegionTable | Mapping[str, BoundsEntry | None] | None, model: Model, given: Collection[str] = ()
) -> Iterator[str]:
    if region is None:
        return
    bounds = region.bounds if isinstance(region, RegionTable) else region
    axes = [axis for axis in model.axes if axis.name not in given]
    yield from wrong_entries("region", _units(bounds), axes, missing="[lower, upper]", also=("constraints",))
    for name, axis in bounds.items():
        if axis is not None and (len(axis.bounds) != 2 or axis.bounds[0] > axis.bounds[1]):
            yield f"region.{name}.bounds: expected [lower, upper] with lower <= upper, given {toml(axis.bounds)}"


def _units(table: Mapping[str, Any]) -> dict[str, str | None]:
    """The units of a table's entries; None where an entry is wrong, or has none."""
    return {name: getattr(entry, "unit", None) for name, entry in table.items()}


def _wrong_pairs(table: str, given: Mapping[str, float], known: list[str], what: str) -> Iterator[str]:
    seen = set()
    for key in given:
        names = pair_of(key)
        if len(names) != 2 or names[0] == names[1]:
            yield f'{table}."{key}": expected two {what}, as in "{", ".join(known[-2:])}"'
            continue
        yield from wrong_names(table, names, known)
        if frozenset(names) in seen:
            yield f'{table}."{", ".join(names)}": expected each pair once, given twice'
        seen.add(frozenset(names))


def pair_of(key: str) -> list[str]:
    """The names in a key of [prior_correlation] or [noise_correlation]."""
    return [name.strip() for name in key.split(",")]
