"""Experiment points and runs as what JSON can hold, and back."""

from __future__ import annotations

from typing import Any

import numpy as np

from .experiments import Experiments
from .runs import Runs


def points_to_json(points: Experiments) -> dict[str, Any]:
    return _columns(points) | {"x0": points.x0.tolist(), "u": points.u.tolist(), "dt": points.dt.tolist()}


def points_from_json(data: dict[str, Any]) -> Experiments:
    count = len(data["dt"])  # of models without state or input the rows are empty
    x0, u = (np.array(data[name], dtype=np.float64).reshape(count, -1 if count and data[name][0] else 0) for name in ("x0", "u"))
    return Experiments(x0, u, data["dt"], columns=tuple(data["columns"] or ()) or None)


def runs_to_json(runs: Runs) -> dict[str, Any]:
    numbers = {"x0": runs.x0.tolist(), "u": runs.u.tolist(), "dt": runs.dt.tolist()}
    return _columns(runs) | numbers | {"measured": runs.measured.tolist()}


def runs_from_json(data: dict[str, Any]) -> Runs:
    dt = np.array(data["dt"], dtype=np.float64)
    u = np.array(data["u"], dtype=np.float64).reshape(*dt.shape, -1 if np.size(data["u"]) else 0)
    return Runs(data["x0"], u, dt, np.array(data["measured"], dtype=bool), columns=tuple(data["columns"]) or None)


def _columns(points: Experiments | Runs) -> dict[str, Any]:
    return {"columns": list(points.columns or ())}
