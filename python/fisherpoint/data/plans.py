"""Points and runs that are planned, with the plant or day of each: measurements without their numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..basics.checks import as_path
from ..basics.quantity import names_of
from ..basics.table import DataTable
from ..basics.values import FrozenMapping
from ..models import Model
from ..points.experiments import Experiments
from ..points.points_or_runs import Points, as_runs
from ..points.run_files import RUN, SEGMENT
from ..points.runs import Runs
from .labels import label_columns, labels_of_table
from .measurement_files import column_names
from .measurements import Measurements


def planned(points: Points, outputs: int, labels: Mapping[str, Any] = FrozenMapping({})) -> Measurements:
    """Points or runs as if all of them had been measured, with zeros, so that they have labels."""
    runs = as_runs(points)
    y = np.where(runs.readings, np.zeros(outputs), np.nan)
    return Measurements(points, y.reshape(*points.dt.shape, outputs), labels=labels)


def read_plan(path: str | Path, model: Model, labels: Sequence[str] = ()) -> Points | Measurements:
    """Read points, or runs where the file has a row for every segment of one; where it has labels, with these.

    Parameters
    ----------
    path, model
    labels : sequence of str
        Columns that have labels, beside those that `Measurements.from_table` knows.

    Raises
    ------
    OSError, ValueError
        As `Experiments.from_csv` and `Runs.from_csv`.
    """
    table, names = DataTable(as_path(path, "path")), names_of(model.axes)
    words = [name for name in label_columns(labels, column_names(model)) if name in table]
    of_runs = {RUN.name, SEGMENT.name} <= set(table.names) - set(names)
    points: Points = (Runs if of_runs else Experiments)._of_table(table, model, words)
    if not words:
        return points
    first = as_runs(points).dt.nonzero()[1] == 0 if of_runs else None
    return planned(points, len(model.outputs), labels_of_table(table, words, first))
