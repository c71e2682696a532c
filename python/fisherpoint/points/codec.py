"""Experiment points, runs and regions as what JSON can hold, and back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array
from .experiments import Experiments
from .region import ExperimentRegion
from .rest import Rest
from .run_region import RunRegion
from .runs import Points, Runs


def points_to_json(points: Points) -> dict[str, Any]:
    columns = list(points.columns or ())
    if isinstance(points, Runs):
        arrays = {name: getattr(points, name).tolist() for name in ("x0", "u", "dt", "measured")}
        rests = None if points.rests is None else [_rest_to_json(rest) for rest in points.rests]
        return {"columns": columns, "n_u": points.u.shape[2], **arrays, "rest": rests}
    return {"columns": columns, "x0": points.x0.tolist(), "u": points.u.tolist(), "dt": points.dt.tolist()}


def points_from_json(data: dict[str, Any]) -> Experiments:
    count = len(data["dt"])  # of models without state or input the rows are empty
    x0, u = (np.array(data[name], dtype=np.float64).reshape(count, -1 if count and data[name][0] else 0) for name in ("x0", "u"))
    return Experiments(x0, u, data["dt"], columns=tuple(data["columns"] or ()) or None)


def _rest_to_json(rest: Rest | None) -> dict[str, Any] | None:
    if rest is None:
        return None
    lists = {"states": None if rest.states is None else list(rest.states), "hold": list(rest.hold), "solve": list(rest.solve)}
    return {"u": dict(rest.u), **lists, "outputs": dict(rest.outputs)}


def _rest_from_json(data: dict[str, Any] | None) -> Rest | None:
    return None if data is None else Rest(**data)


def runs_from_json(data: dict[str, Any]) -> Runs:
    dt = np.array(data["dt"], dtype=np.float64)
    u = np.array(data["u"], dtype=np.float64).reshape(*dt.shape, data["n_u"])
    rest = None if data["rest"] is None else [_rest_from_json(one) for one in data["rest"]]
    measured = np.array(data["measured"], dtype=bool)
    x0 = np.array(data["x0"], dtype=np.float64).reshape(len(dt), -1 if len(dt) and data["x0"][0] else 0)
    return Runs(x0, u, dt, measured, rest=rest, columns=tuple(data["columns"]) or None)


def points_or_runs_from_json(data: dict[str, Any]) -> Points:
    return runs_from_json(data) if "measured" in data else points_from_json(data)


def region_to_json(region: ExperimentRegion | RunRegion | None) -> dict[str, Any] | None:
    """A region as JSON has it; functions among the constraints are not kept."""
    if region is None:
        return None
    bounds = {name: list(pair) for name, pair in region.bounds.items()}
    if isinstance(region, ExperimentRegion):
        return {"bounds": bounds, "constraints": [c if isinstance(c, str) else None for c in region.constraints]}
    data = {name: getattr(region, name) for name in ("segments", "duration", "samples")}
    data |= {name: list(getattr(region, name)) for name in ("constant", "shared", "measured")}
    data["rest"] = _rest_to_json(region.rest)
    return {"bounds": bounds, **data, "levels": {k: list(v) for k, v in region.levels.items()}, "slew": dict(region.slew)}


def region_from_json(data: dict[str, Any] | None) -> ExperimentRegion | RunRegion | None:
    if data is None:
        return None
    if "segments" not in data:
        return ExperimentRegion(data["bounds"], [_not_saved if c is None else c for c in data["constraints"]])
    options = {name: data[name] for name in ("constant", "shared", "levels", "slew", "duration", "measured", "samples")}
    return RunRegion(data["bounds"], data["segments"], rest=_rest_from_json(data["rest"]), **options)


def _not_saved(columns: Mapping[str, Array]) -> NDArray[np.bool_]:
    raise ValueError("constraint: expected the function that this design was made with, given none: functions are not saved")
