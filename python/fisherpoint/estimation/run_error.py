"""Errors drawn anew in each run: they move all samples of the run at once, beside the noise that each has of its own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..basics.values import Array
from ..data.measurements import Measurements
from ..information.assumed import Assumed
from ..information.common_error import CommonError
from ..information.run_tangents import moves_of_runs
from ..points.settings import Integration
from ..points.status import Status


@dataclass(frozen=True, eq=False)
class RunError:
    """The common error of one run.

    Attributes
    ----------
    first : int
        Number of the run's first sample among all.
    moved : ndarray, (n, n_y, q)
        By how much its n samples move with a standard deviation of each cause, in units of the noise; zero where not measured.
    """

    first: int
    moved: Array

    @property
    def rows(self) -> slice:
        return slice(self.first, self.first + len(self.moved))

    @cached_property
    def _common(self) -> CommonError:
        return CommonError.of(self.moved.reshape(-1, self.moved.shape[2]))

    @property
    def variances(self) -> Array:
        """Variances of the samples in units of those of the noise, (n, n_y)."""
        return self._common.variances.reshape(self.moved.shape[:2])

    def whitened(self, rows: Array) -> Array:
        """Whiten rows (B, n, n_y, ...), in units of the noise: multiply by R_k^-1/2."""
        white = self._common.whitened(rows.reshape(len(rows), -1, int(np.prod(rows.shape[3:]))))
        return white.reshape(rows.shape)


def run_errors(
    assumed: Assumed, data: Measurements, theta: Array, settings: Integration, std: Array, first: int = 0
) -> Iterator[RunError]:
    """The errors of measured runs, whose first sample has the number `first`; std (n_y,) is that of the noise.

    Raises
    ------
    ValueError
        Where a trajectory is not ok.
    """
    runs = data.runs
    moved, status = moves_of_runs(assumed, runs, theta, settings)
    if status.any():
        k = int(np.argmax(status != Status.ok))
        raise ValueError(f"runs: expected trajectories that are ok, given runs[{k}] ({Status(status[k]).name})")
    moved = np.where(np.isfinite(data.run_outputs)[..., None], moved / std[:, None], 0.0)
    for of_run, there in zip(moved, runs.measured, strict=True):
        yield RunError(first, of_run[there])
        first += int(there.sum())
