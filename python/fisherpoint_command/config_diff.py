"""What in a file differs from what a campaign was started with, by the keys of the file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import zip_longest
from typing import Any

import fisherpoint as fp
from fisherpoint.basics.messages import listed, shortened
from fisherpoint.basics.result_files import encoded
from fisherpoint.basics.toml_mistakes import toml
from fisherpoint.design.file.configuration_tables import OF_RUNS
from fisherpoint.prior.rules import RULES

OF_DESIGN = ("output_covariance", "parameters", "kinks", "jumps", "rtol", "assumed_covariance", "along")
"""Parts of a problem that the table [design] has."""

Difference = tuple[str, Any, Any]
"""A key of the file, what the campaign was started with, and what the file has."""


def first_difference(given: fp.Campaign, found: fp.Campaign, directory: object) -> tuple[str, str] | None:
    """The key and the text of a message, or None where the file is that of the campaign."""
    changes = list(differences(given, found))
    if not changes:
        return None
    (key, there, here), *others = changes
    text = f"expected {_shown(there)}, what the campaign in {directory} was started with, given {_shown(here)}"
    return key, text + (f" (also: {listed([name for name, _, _ in others])})" if others else "")


def differences(given: fp.Campaign, found: fp.Campaign) -> Iterator[Difference]:
    """All that differs, one key after the other."""
    here, there = _plain(encoded(given.problem)), _plain(encoded(found.problem))
    of_runs = given.problem.region is not None and given.problem.region.kind == "run"
    for path, was, now in _changes(there, here):
        if path[0] != "derived":
            yield _key(path, of_runs), was, now
    for key, now in _settings(given).items():
        was = _settings(found)[key]
        if was != now:
            yield key, was, now


def _plain(data: Any) -> Any:
    """What a file has of an object by names alone, without those of its classes."""
    if not isinstance(data, dict):
        return [_plain(one) for one in data] if isinstance(data, list) else data
    ((kind, content),) = data.items() if "array" not in data else [("array", data["array"])]
    if kind == "mapping":
        return {name: _plain(one) for name, one in content}
    if kind in ("array", "float", "Model"):
        return content
    rules = {rule.__name__: name for name, rule in RULES.items()}
    return {name: _plain(one) for name, one in content.items()} | ({"kind": rules[kind]} if kind in rules else {})


def _settings(campaign: fp.Campaign) -> dict[str, Any]:
    """The settings of a campaign by the keys of the file."""
    settings, goal = vars(campaign.settings), vars(campaign.settings.goal)
    tables = {name: f"runs.{name}" for name in OF_RUNS} | {"n_experiments": "campaign.batch", "n_runs": "campaign.batch"}
    found = {tables.get(name, f"design.{name}"): value for name, value in settings.items() if name not in ("goal", "method")}
    if isinstance(campaign.settings, fp.results.ExchangeSettings):
        found |= {f"design.{'method' if name == 'name' else name}": value for name, value in vars(campaign.settings.method).items()}
    return found | {f"goal.{name}": value for name, value in goal.items()}


def _changes(there: Any, here: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any, Any]]:
    if there == here:
        return
    if isinstance(there, Mapping) and isinstance(here, Mapping):
        for name in dict.fromkeys([*there, *here]):
            yield from _changes(there.get(name), here.get(name), (*path, name))
    elif path[-1:] == ("toml",):
        lines = zip_longest(str(there).splitlines(), str(here).splitlines(), fillvalue="")
        yield path, *next((was, now) for was, now in lines if was != now)
    else:
        yield path, there, here


def _key(path: tuple[str, ...], of_runs: bool) -> str:
    head, *rest = path
    if head in OF_DESIGN:
        return f"design.{head}"
    if head == "model" and rest == ["toml"]:
        return "model"
    if head == "prior" and len(rest) == 2:
        return f"prior.{rest[1]}.{rest[0]}"
    if head == "region" and rest and rest[0] == "bounds":
        return ".".join(["region", *rest[1:]])
    return ".".join(["runs" if head == "region" and of_runs else head, *rest])


def _shown(value: Any) -> str:
    return "nothing" if value is None else shortened(value, 100) if isinstance(value, str) and "=" in value else toml(value)
