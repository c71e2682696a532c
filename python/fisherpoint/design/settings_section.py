"""The settings of a search in words, for the page of a result; those with their usual value are left out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..points.experiments import Experiments
from ..show.numbers import number, percent
from ..show.section import Section
from .settings import ExchangeSettings, RunSettings

OF_POINTS: dict[str, tuple[str, Any]] = {
    "n_experiments": ("points", None),
    "method": ("method of the search", "auto"),
    "criterion": ("criterion", "D"),
    "of": ("criterion of", None),
    "conditions": ("points at which the criterion predicts", None),
    "scale": ("scale of the parameters", None),
    "over": ("criterion over the prior", None),
    "prior_information": ("the prior's information counts", False),
    "singular": ("where parameters are left open", "estimable"),
    "confidence": ("share of the plants that must be able to run all points", None),
    "n_candidates": ("candidates of a draw", 50),
    "max_iterations": ("iterations, at most", None),
    "patience": ("ends after iterations without an exchange", None),
    "time_limit": ("time limit", None),
    "max_redraws": ("further draws where no candidate helps, at most", 1),
    "references": ("compared with random designs and bounds", True),
    "screen": ("candidates are ordered by a cheaper rule first", True),
    "local": ("candidates near the points, as a share of the others", 0.5),
    "seed": ("seed", None),
}
OF_RUNS: dict[str, tuple[str, Any]] = {
    "n_runs": ("runs", None),
    "criterion": ("criterion", "D"),
    "of": ("criterion of", None),
    "conditions": ("points at which the criterion predicts", None),
    "scale": ("scale of the parameters", None),
    "over": ("criterion over the prior", None),
    "prior_information": ("the prior's information counts", False),
    "singular": ("where parameters are left open", "estimable"),
    "confidence": ("share of the plants that must be able to run all runs", None),
    "n_starts": ("starts of the search", None),
    "n_candidates": ("random runs to begin with", 500),
    "time_limit": ("time limit", None),
    "seed": ("seed", None),
}
"""What each setting is called, and the usual value, with which it is left out."""


def settings_section(settings: ExchangeSettings | RunSettings) -> Section:
    """The settings of a search."""
    words = OF_RUNS if isinstance(settings, RunSettings) else OF_POINTS
    given = vars(settings)
    # What has no words yet is named as in Python.
    named = words | {name: (name.replace("_", " "), None) for name in given if name not in words}
    rows = [(text, _said(name, given[name])) for name, (text, usual) in named.items() if given[name] not in (None, usual)]
    return Section("Search", (), rows)


def _said(name: str, value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{number(value)} s" if name == "time_limit" else percent(value)
    if isinstance(value, Experiments):
        return str(len(value))
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {number(one)}" for key, one in value.items())
    return ", ".join(map(str, value)) if isinstance(value, tuple) else str(value)
