"""Noise that is known: of the sensors, with the share of what is assumed and not exact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..basics.values import Array
from ..data.measurements import Measurements
from ..data.record import Record
from ..models import Model
from ..points.status import Status
from ..prior.rules import Rule


@dataclass(frozen=True, eq=False)
class KnownNoise:
    """R of the sensors, or R_k = R + G_k P G_k^T of every sample where constants or starts are uncertain.

    Attributes
    ----------
    model : Model
    parts : sequence of Measurements or Record
    sensors : ndarray, (n_y, n_y)
        R.
    uncertain, initial_state_std : mapping of name to float, or None
        As `estimate` takes them.
    rule : Rule or None
        Takes the share by (16) instead of tangents.
    rtol : float
    threads : int
    """

    model: Model
    parts: tuple[Measurements | Record, ...]
    sensors: Array
    uncertain: Mapping[str, float] | None
    initial_state_std: Mapping[str, float] | None
    rule: Rule | None
    rtol: float
    threads: int

    @property
    def assumed(self) -> bool:
        """Whether there is more than the sensors' noise."""
        return bool(self.uncertain or self.initial_state_std)

    def covariance(self, theta: Array) -> Array:
        """(n_y, n_y), or (N, n_y, n_y) where something is assumed, at the parameters (p,)."""
        if not self.assumed:
            return self.sensors
        from ..information.assumed import assumed_covariance

        shares = []
        for part in self.parts:
            if not isinstance(part, Measurements):
                label = "uncertain" if self.uncertain else "initial_state_std"
                raise ValueError(f"{label}: expected measurements of points, given a record; there, estimate what is uncertain")
            share, status = assumed_covariance(
                self.model,
                part.points,
                theta,
                uncertain=self.uncertain,
                initial_state_std=self.initial_state_std,
                rtol=self.rtol,
                threads=self.threads,
                jumps="cross",
                rule=self.rule,
            )
            if status.any():
                k = int(np.argmax(status != Status.ok))
                raise ValueError(f"points: expected trajectories that are ok, given points[{k}] ({Status(status[k]).name})")
            shares.append(share)
        return self.sensors + np.concatenate(shares)
