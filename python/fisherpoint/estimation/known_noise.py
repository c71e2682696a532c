"""Noise that is known: of the sensors, with the share of what is drawn anew in each point or run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
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
from .weighting import RunError, run_errors


@dataclass(frozen=True, eq=False)
class KnownNoise:
    """R of the sensors, or R_k = R + H_k P H_k^T of every point, and of every run, where something is drawn anew in each.

    Attributes
    ----------
    model : Model
    parts : sequence of Measurements or Record
    sensors : ndarray, (n_y, n_y)
        R.
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
    varies: Mapping[str, float] | None
    initial_state_std: Mapping[str, float] | None
    rule: Rule | None
    rtol: float
    threads: int

    @property
    def assumed(self) -> bool:
        """Whether there is more than the sensors' noise."""
        return bool(self.varies or self.initial_state_std)

    def at(self, theta: Array) -> tuple[Array, tuple[RunError, ...]]:
        """Covariances of samples (n_y, n_y), or (N, n_y, n_y) where something is assumed, and of runs, at parameters (p,)."""
        if not self.assumed:
            return self.sensors, ()
        shares, common = [np.zeros((0, *self.sensors.shape))], list[RunError]()
        for part in self.parts:
            if not isinstance(part, Measurements):
                label = "varies" if self.varies else "initial_state_std"
                raise ValueError(
                    f"{label}: expected measurements of points or runs, given a record: estimate its start, and what has one value "
                    "in it"
                )
            points = part.runs.points
            if points is None:
                common += self._of_runs(part, theta, sum(map(len, shares)))
                shares.append(np.zeros((len(part.samples), *self.sensors.shape)))
            else:
                shares.append(self._of_points(points, theta))
        return self.sensors + np.concatenate(shares), tuple(common)

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

    def _of_runs(self, data: Measurements, theta: Array, first: int) -> Iterator[RunError]:
        if self.rule is not None and not isinstance(self.rule, LinearizedRule):
            raise ValueError(f"rule: expected tangents, None, for runs, given {self.rule}")
        assumed = assumed_of(self.model, None, self.varies, self.initial_state_std)
        settings = Integration(self.rtol, threads=self.threads)
        return run_errors(assumed, data, theta, settings, np.sqrt(np.diag(self.sensors)), first)
