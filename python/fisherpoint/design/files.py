"""A design as a directory of files, from which it can be repeated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..basics.checks import as_float, by_name, check_positive_int, check_type
from ..basics.csv_table import CsvTable
from ..basics.declared import check_declared
from ..basics.quantity import names_of
from ..basics.stop_reason import StopReason
from ..basics.values import FrozenMapping
from ..engine.versions import versions
from ..information.codec import (
    evaluation_from_json,
    evaluation_to_json,
    log_det_from_json,
    number_to_json,
    problem_from_json,
    problem_to_json,
)
from ..points.codec import points_from_json, points_to_json
from .efficiency import Efficiency
from .found import FoundDesign, TraceRecord
from .scenario_values import scenario_values_from_json, scenario_values_to_json
from .settings import ExchangeSettings, read_settings, settings_json

FORMAT = "fisherpoint design"
FORMAT_VERSION = 2  # 1 had no checksum
PLAIN = ("drawn", "accepted", "seconds")
"""Fields of a design that JSON has as they are."""


def design_to_json(design: FoundDesign) -> dict[str, Any]:
    efficiency = design.efficiency and {
        name: str(value) if isinstance(value, float) and not np.isfinite(value) else value  # "-inf" of a singular design
        for name, value in asdict(design.efficiency).items()
    }
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "versions": versions(),
        "problem": problem_to_json(design.problem),
        "settings": settings_json(design.settings),
        "points": points_to_json(design.points),
        "evaluation": evaluation_to_json(design.evaluation),
        "under_noise": evaluation_to_json(design.under_noise),
        "scenarios": scenario_values_to_json(design.scenarios),
        "efficiency": efficiency,
        "trace": [{**asdict(record), "log_det": number_to_json(record.log_det)} for record in design.trace],
        "rejected": dict(design.rejected),
        "stop_reason": design.stop_reason,
        **{name: getattr(design, name) for name in (*PLAIN, "n_previous", "n_kept")},
        "previous_left_out": dict(design.previous_left_out),
        "not_told": [dict(direction) for direction in design.not_told],
        "ridge": design.ridge,
    }


def design_from_json(data: dict[str, Any]) -> dict[str, Any]:
    """The fields of a design."""
    points = data["points"]
    n_previous = check_positive_int(data.get("n_previous", 0), "n_previous", 0)  # older files do not have it
    n_points = n_previous + len(points["dt"])
    evaluation = evaluation_from_json(data["evaluation"], n_points)
    if evaluation is None:
        raise KeyError("evaluation")
    settings, rejected = read_settings(data["settings"]), dict(data["rejected"])
    check_type(settings, ExchangeSettings, "settings")
    if len(points["dt"]) != settings.n_experiments:
        raise ValueError(f"points: expected n_experiments = {settings.n_experiments} points, given {len(points['dt'])}")
    for name, count in {**rejected, "drawn": data["drawn"], "accepted": data["accepted"]}.items():
        check_positive_int(count, name, 0)
    if data["drawn"] != data["accepted"] + sum(rejected.values()):
        raise ValueError(f"drawn: expected the sum of accepted and rejected, given {data['drawn']}")
    efficiency: Any = data["efficiency"] and {
        name: float(value) if isinstance(value, str) else value for name, value in data["efficiency"].items()
    }
    if efficiency and "noise_optimum" in efficiency:  # a file from before the bound
        found = {"best_found": efficiency.pop("noise_optimum"), "vs_best": efficiency.pop("vs_optimum")}
        efficiency = efficiency | found | {"at_most": None, "at_least": None, "n_candidates": 0}
    fields = dict(
        problem=problem_from_json(data["problem"]),
        settings=settings,
        points=points_from_json(points),
        evaluation=evaluation,
        under_noise=evaluation_from_json(data["under_noise"], n_points),
        scenarios=scenario_values_from_json(data.get("scenarios"), evaluation.parameters),
        efficiency=efficiency and Efficiency(**efficiency),
        trace=tuple(TraceRecord(**{**record, "log_det": log_det_from_json(record["log_det"])}) for record in data["trace"]),
        rejected=FrozenMapping(rejected),
        stop_reason=StopReason(data["stop_reason"]),
        n_previous=n_previous,
        n_kept=check_positive_int(data.get("n_kept", 0), "n_kept", 0, len(points["dt"])),
        previous_left_out=by_name(data.get("previous_left_out"), None, "previous_left_out", partial(check_positive_int, least=0)),
        not_told=tuple(_directions(data.get("not_told", ()), evaluation.parameters)),  # older files have neither
        ridge=as_float(data.get("ridge", 0.0), "ridge"),
        **{name: data[name] for name in PLAIN},
    )
    design = FoundDesign(**fields)
    check_declared(design)
    _ = design.criterion  # raises where the settings of the criterion do not fit
    return fields


def _directions(given: Any, names: tuple[str, ...]) -> Iterator[Mapping[str, float]]:
    for one in given:
        yield by_name(one, names, "not_told", as_float)


def has_points_of(design: FoundDesign, path: Path) -> bool:
    """Whether a table has a design's points, whatever columns were filled in and to as many digits as spreadsheets keep."""
    axes = design.problem.model.axes
    try:
        table = CsvTable(path)
        table.read_decimal_commas(names_of(axes))
        points = np.column_stack([table.complete(quantity) for quantity in axes])
    except (OSError, ValueError, KeyError):
        return False
    own = design.points.table[:, : len(axes)]
    return points.shape == own.shape and np.allclose(points, own, rtol=1e-12, atol=0.0)
