"""Measured outputs of experiment points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..basics.checks import as_index, as_parts, check_alike, check_type
from ..basics.files import write_whole
from ..basics.values import Array
from ..models import Model
from ..points.experiments import Experiments
from .measured_outputs import measured_outputs
from .measurement_files import measurements_csv, read_measurements


@dataclass(frozen=True, eq=False)
class Measurements:
    """The outputs that were measured at K experiment points.

    Parameters
    ----------
    points : Experiments
        The K points; x0 as measured where it was, else as planned. Replicates are points that occur more than once.
    y : array_like, (K, n_y)
        Outputs in the model's order, SI units; NaN where an output was not measured. (K,) is taken for a single output.

    Raises
    ------
    TypeError
        Where `points` are no `Experiments`.
    ValueError
        For a wrong shape, infinite numbers, or no measured number at all.
    """

    points: Experiments
    y: Array

    def __post_init__(self) -> None:
        check_type(self.points, Experiments, "points")
        y = measured_outputs(self.y, len(self.points))
        y.flags.writeable = False
        object.__setattr__(self, "y", y)

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, rows: int | slice | Sequence[int] | NDArray[Any]) -> Measurements:
        """Measurements of the chosen rows, of which one at least must have a number."""
        chosen = as_index(rows, len(self), "data")
        return Measurements(self.points[chosen], self.y[chosen])

    @staticmethod
    def join(parts: Sequence[Measurements]) -> Measurements:
        """Return the measurements of all parts, one after the other."""
        parts = as_parts(parts, Measurements)
        sizes = [(part.points.x0.shape[1], part.points.u.shape[1], part.y.shape[1]) for part in parts]
        check_alike(sizes, "states, inputs and outputs")
        return Measurements(Experiments.join([part.points for part in parts]), np.concatenate([part.y for part in parts]))

    def to_csv(self, path: str | Path, model: Model) -> None:
        """Write the design's CSV with a column ``y_<output>`` for each output, empty where it was not measured.

        Every digit is kept, and the file appears whole or not at all. The starts are written as they are, in the states' columns.
        """
        check_type(model, Model, "model")
        write_whole(path, measurements_csv(self.points, self.y, model))

    @classmethod
    def from_csv(cls, path: str | Path, model: Model) -> Measurements:
        """Read measurements of `model`: the design's CSV with a column ``y_<output>`` for each measured output.

        Outputs may be missing or empty; ``x0_<state>`` is a measured start; headers may have units, as ``p_A [bar]``. See
        docs/how_to/measurements.md for the format, and for what is refused.

        Raises
        ------
        OSError
            Where the file cannot be read.
        ValueError
            Where it is no whole file of this model, or numbers are none, in wrong units or beyond physics; the message names row,
            counted from 1 below the header, and column.
        """
        check_type(model, Model, "model")
        return Measurements(*read_measurements(path, model))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Measurements) and self.points == other.points and np.array_equal(self.y, other.y, equal_nan=True)

    __hash__ = None  # type: ignore[assignment]  # arrays

    def __repr__(self) -> str:
        measured = int(np.isfinite(self.y).sum())
        return f"Measurements({len(self)} points, {self.y.shape[1]} outputs, {measured} of {self.y.size} numbers)"
