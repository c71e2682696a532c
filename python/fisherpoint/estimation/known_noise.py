"""Noise that is known: of the sensors, with the share of what is drawn anew in each point or run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..basics.values import Array
from ..data.measurements import Measurements
from ..data.record import Record
from ..information.assumed import assumed_covariance, assumed_of
from ..models import Model
from ..points.broken_limits import refuse_failures
from ..points.experiments import Experiments
from ..points.runs import Runs
from ..points.settings import Integration
from ..prior.rules import LinearizedRule, Rule
from .sensor_noise import SensorNoise
from .weighting import RunMoves, WeightedResiduals, run_moves


@dataclass(frozen=True, eq=False)
class KnownNoise:
    """R of the sensors, or R_k = R + H_k P H_k^T of every point, and of every run, where something is drawn anew in each.

    Attributes
    ----------
    model : Model
    parts : sequence of Measurements or Record
    sensors : ndarray, (n_y, n_y)
        R.
    noise : SensorNoise or None
        Of sensors that are more than white.
    varies, initial_state_std : mapping of name to float, or None
        As `estimate` takes them.
    rule : Rule or None
        Takes the share by (16) instead of tangents.
    rtol : float
    threads : int
    """

    model: Model
    parts: tuple[Measurements | Record, ...]
    sensors: Array
    noise: SensorNoise | None
    varies: Mapping[str, float] | None
    initial_state_std: Mapping[str, float] | None
    rule: Rule | None
    rtol: float
    threads: int

    @property
    def assumed(self) -> bool:
        """Whether there is more than the sensors' noise."""
        return bool(self.varies or self.initial_state_std)

    @property
    def changes(self) -> bool:
        """Whether weights change with the parameters."""
        return self.assumed or (self.noise is not None and self.noise.changes)

    def weighed(self, residuals: WeightedResiduals, z: Array) -> WeightedResiduals:
        """The residuals in units of the noise that there is at coordinates z (P,)."""
        values = residuals.unknowns.values(z[None])
        noise, sensors = self.noise, self.sensors
        if noise is not None:
            noise = noise.at(residuals.observed.respond(values).y[0]) if noise.changes else noise
            sensors = noise.covariance
        if not self.assumed:
            return residuals.weighed(sensors, (), noise)
        shape = self.sensors.shape
        shares, moves = [np.zeros((0, *shape))], list[RunMoves]()
        for part, theta in zip(self.parts, residuals.observed.of_sets(values), strict=True):
            if not isinstance(part, Measurements):
                label = "varies" if self.varies else "initial_state_std"
                raise ValueError(
                    f"{label}: expected measurements of points or runs, given a record: estimate its start, and what has one value "
                    "in it"
                )
            points = part.runs.points
            if points is None:
                moves += self._of_runs(part, theta, sum(map(len, shares)))
                shares.append(np.zeros((len(part.samples), *shape)))
            else:
                shares.append(self._of_points(points, theta))
        return residuals.weighed(sensors + np.concatenate(shares), moves, noise)

    def _of_points(self, points: Experiments, theta: Array) -> Array:
        share, status = assumed_covariance(
            self.model,
            points,
            theta,
            varies=self.varies,
            initial_state_std=self.initial_state_std,
            rtol=self.rtol,
            threads=self.threads,
            jumps="cross",
            rule=self.rule,
        )
        settings = Integration(self.rtol, threads=self.threads)
        refuse_failures(self.model, Runs.of_points(points), theta, settings, status)
        return share

    def _of_runs(self, data: Measurements, theta: Array, first: int) -> list[RunMoves]:
        if self.rule is not None and not isinstance(self.rule, LinearizedRule):
            raise ValueError(f"rule: expected tangents, None, for runs, given {self.rule}")
        assumed = assumed_of(self.model, None, self.varies, self.initial_state_std)
        return list(run_moves(assumed, data, theta, Integration(self.rtol, threads=self.threads), first))
