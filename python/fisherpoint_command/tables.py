"""Files of records and measurements, with the names that their columns have."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

import fisherpoint as fp
from fisherpoint.basics.quantity import names_of
from fisherpoint.basics.table import DataTable
from fisherpoint.basics.toml_tables import wrong_names
from fisherpoint.data.labels import LABELS
from fisherpoint.data.measurement_files import column_names
from fisherpoint.design.file.configuration import Config, ConfigError
from fisherpoint.points.run_files import time_name

from .runs import read_points


class DataFiles:
    """How the files with data are read: by the columns that the TOML file and the options name, else by names of their own."""

    def __init__(self, config: Config, options: Iterable[str] | None, files: Iterable[Path] | None) -> None:
        columns = dict(config.data)
        if options and not files:
            raise ConfigError("--column: expected beside a file with data, given without")
        for given in options or ():
            name, _, column = (part.strip() for part in given.partition("="))
            if not (name and column):
                raise ConfigError(f"--column: expected NAME=COLUMN, given {given}")
            columns[name] = column
        self.labels = config.labels
        if wrong := [*wrong_names("--column", columns, (*column_names(config.build_model()), *LABELS, *self.labels))]:
            raise ConfigError(*wrong)
        self.columns: Mapping[str, str] | None = columns or None

    def measurements(self, path: Path, model: fp.Model) -> fp.Measurements:
        """Measurements of points or of runs."""
        return fp.Measurements.from_table(path, model, columns=self.columns, labels=self.labels)

    def data(self, path: Path, model: fp.Model) -> fp.Measurements | fp.Record:
        """Measurements of points or runs, or a record where the file has a column of times.

        A column t of a model that has such a state or output is one of times where the file has no durations.
        """
        table = DataTable(path, self.columns)
        time, names = time_name(names_of(model.inputs)), table.names
        axes = {quantity.name for quantity in (*model.axes, *model.outputs)}
        without_durations = bool(model.states) and "dt" not in names
        if time in names and (without_durations or (time == "t" and time not in axes)):
            states = {quantity.name for quantity in model.states} - {"T"}
            if "T" in axes.difference(names) and ("T" in {q.name for q in model.inputs} or states | {"dt"} & set(names)):
                raise ValueError("expected the column T of the model, given t, which is the time of a record")
            return fp.Record.from_table(table, model, labels=self.labels)
        return fp.Measurements.from_table(table, model, labels=self.labels)

    def previous(self, path: Path, model: fp.Model) -> fp.Experiments | fp.Runs | fp.Measurements:
        """Measurements where the file has a column of an output, else points or runs that are planned, by names of their own."""
        own: DataTable | None = None
        with suppress(ValueError):
            own = DataTable(path)
        planned = own is not None and set(names_of(model.axes)) <= set(own.names)
        if self.columns is not None and not planned:
            return self.measurements(path, model)
        if own is not None and any(name.startswith("y_") for name in own.names):
            return fp.Measurements.from_table(own, model, labels=self.labels)
        return read_points(path, model)
