"""A virtual rig: a model with true parameters; experiments show its outputs with noise."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from ..basics.checks import as_std_or_zero, by_name, check_positive_int, check_type
from ..basics.messages import with_counts
from ..basics.quantity import names_of
from ..basics.values import FrozenMapping
from ..models import Model
from ..noise.draws import memories, readings
from ..noise.models import NoiseOf, as_noise_or_zero, checked_noise
from ..noise.sensors import Sensors
from ..points.points_or_runs import Points, as_runs
from ..points.rest_starts import checked_starts
from ..points.schedule import inputs_before
from ..points.settings import check_rtol
from ..points.simulate import simulate
from ..points.status import Status, failures_of
from ..show.numbers import counted
from .measurements import Measurements

MAX_POINTS = 10**8
"""Experiments of one call of `VirtualRig.measure`; more count as a slip."""


class VirtualRig:
    """A rig that is a simulation: y = g(x(dt), u, theta) + v, v normal with standard deviations `noise`, (4), or as `Noise` says.

    Parameters
    ----------
    model : Model
    theta : mapping by name, or array_like (p,)
        The true parameters, SI units.
    noise : mapping of output name to float or Noise, or NoiseModel
        The sensor noise, SI units: a number is the standard deviation of white noise, 0 for a sensor without. Outputs that are left
        out are not measured. What has a memory begins anew in each point or run.
    initial_state_std : mapping of state name to float, optional
        By how much true starts deviate from the planned ones, which alone are recorded; states left out start as planned.
    seed : int
        The same seed and the same calls give the same data, to the last bit, on any number of threads.
    rtol : float
        Tolerance of the simulated truth, which must be finer than that of what is estimated from it.

    Attributes
    ----------
    failures : mapping of status name to int
        Trajectories of all calls that did not reach their end, and so gave no data, or those of the way there.

    Raises
    ------
    ValueError
        For unknown names, negative standard deviations, and parameters without sense.
    """

    def __init__(
        self,
        model: Model,
        theta: Mapping[str, float] | ArrayLike,
        noise: NoiseOf,
        *,
        initial_state_std: Mapping[str, float] | None = None,
        seed: int = 0,
        rtol: float = 1e-10,
    ) -> None:
        check_type(model, Model, "model")
        self.model, self.rtol = model, check_rtol(rtol)
        self.theta = model.theta(theta)
        if self.theta.ndim != 1:
            raise ValueError(f"theta: expected shape ({len(model.parameters)},), given {self.theta.shape}")
        outputs, states = names_of(model.outputs), names_of(model.states)
        self._sensors = Sensors.of(checked_noise(noise, outputs, as_noise_or_zero), outputs)
        deviations = by_name(initial_state_std, states, "initial_state_std", as_std_or_zero)
        self._start_std = np.array([deviations.get(name, 0.0) for name in states])
        # Streams of their own: whether starts deviate, and what noise outputs have, does not change the noise of the others.
        seeds = np.random.SeedSequence(check_positive_int(seed, "seed", 0)).spawn(2 + len(outputs))
        self._noise, self._starts, *self._memories = (np.random.default_rng(one) for one in seeds)
        self._failures: Counter[str] = Counter()

    @property
    def failures(self) -> Mapping[str, int]:
        return FrozenMapping(self._failures)

    def measure(self, points: Points, *, repeats: int = 1) -> Measurements:
        """Carry out all points, or runs, one after the other, and that `repeats` times.

        The start of a run deviates once; every sample has noise of its own.

        Returns
        -------
        Measurements
            len(points) times `repeats` points or runs. Where the trajectory did not reach its end, a point is not measured, and a
            run up to the last segment that was completed, as on a rig that records until it stops; not at all where it overflows.
            A warning says how often that was, and why.

        Raises
        ------
        ValueError
            Where nothing is measured, as no trajectory gets as far, and for points that do not fit the model.
        """
        runs, n_x = as_runs(points), len(self.model.states)
        times = check_positive_int(repeats, "repeats", most=MAX_POINTS // max(points.dt.size, 1))
        rows = np.tile(np.arange(len(points)), times)
        planned, runs = points[rows], runs[rows]
        deviation = self._start_std * self._starts.standard_normal((len(runs), n_x))
        white = self._noise.standard_normal((*runs.dt.shape, len(self.model.outputs)))
        memory = memories(self._sensors, runs.dt, self._memories)
        if runs.x0.shape[1] != n_x:
            raise ValueError(f"x0: expected shape (K, {n_x}), given {runs.x0.shape}")
        x0 = checked_starts(self.model, runs, self.theta, deviation) + deviation
        before = inputs_before(self.model, runs) if self.model.delays else None  # which a rest has, and known starts have not
        done = simulate(self.model, runs.starting(x0, before), self.theta, rtol=self.rtol, jumps="cross")
        completed = np.arange(runs.dt.shape[1]) < done.reached[:, None]
        there = runs.readings & (completed & (done.status != Status.not_finite)[:, None])[:, :, None]
        counts = failures_of(done.status)
        self._failures += counts
        reasons = with_counts(counts)
        if not there.any():
            given = reasons or f"no {points.kind}s"
            raise ValueError(f"points: expected at least one whose trajectory reaches a sample, given none: {given}")
        if counts:
            warnings.warn(
                f"{sum(counts.values())} of {counted(len(runs), points.kind)} are not measured to their ends: {reasons}",
                RuntimeWarning,
                stacklevel=2,
            )
        y = readings(self._sensors, np.where(there, done.y, 0.0), white, memory)
        y = np.where(there & self._sensors.measured, y, np.nan)
        return Measurements(planned, y.reshape(*planned.dt.shape, -1))

    def __repr__(self) -> str:
        measured = [name for name, there in zip(names_of(self.model.outputs), self._sensors.measured, strict=True) if there]
        return f"VirtualRig({self.model.name}, measures {', '.join(measured)})"
