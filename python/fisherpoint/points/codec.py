"""Experiment points as what JSON can hold, and back."""

from __future__ import annotations

from typing import Any

import numpy as np

from .experiments import Experiments


def points_to_json(points: Experiments) -> dict[str, Any]:
    columns = list(points.columns or ())
    return {"columns": columns, "x0": points.x0.tolist(), "u": points.u.tolist(), "dt": points.dt.tolist()}


def points_from_json(data: dict[str, Any]) -> Experiments:
    count = len(data["dt"])  # of models without state or input the rows are empty
    x0, u = (np.array(data[name], dtype=np.float64).reshape(count, -1 if count and data[name][0] else 0) for name in ("x0", "u"))
    return Experiments(x0, u, data["dt"], columns=tuple(data["columns"] or ()) or None)
