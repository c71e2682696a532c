"""A virtual rig: a model with true parameters; experiments show its outputs with noise."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from ..basics.checks import as_std_or_zero, by_name, check_positive_int, check_type
from ..basics.quantity import names_of
from ..basics.values import FrozenMapping
from ..models import Model
from ..points.experiments import Experiments
from ..points.rest_starts import checked_starts
from ..points.runs import Runs
from ..points.settings import check_rtol
from ..points.status import Status, failures_of
from ..points.trajectories import simulate
from .measurements import Measurements

MAX_POINTS = 10**8
"""Experiments of one call of `VirtualRig.measure`; more count as a slip."""


class VirtualRig:
    """A rig that is a simulation: y = g(x(dt), u, theta) + v, v normal with standard deviations `noise_std`, (4).

    Parameters
    ----------
    model : Model
    theta : mapping by name, or array_like (p,)
        The true parameters, SI units.
    noise_std : mapping of output name to float
        Standard deviations of the sensor noise, SI units; 0 for a sensor without noise. Outputs left out are not measured.
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
        noise_std: Mapping[str, float],
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
        noise = by_name(noise_std, outputs, "noise_std", as_std_or_zero)
        self._noise_std = np.array([noise.get(name, np.nan) for name in outputs])
        if np.isnan(self._noise_std).all():
            raise ValueError("noise_std: expected at least one output that is measured, given none")
        deviations = by_name(initial_state_std, states, "initial_state_std", as_std_or_zero)
        self._start_std = np.array([deviations.get(name, 0.0) for name in states])
        # Streams of their own: whether starts deviate, and which outputs are measured, does not change the noise of the others.
        seeds = np.random.SeedSequence(check_positive_int(seed, "seed", 0)).spawn(2)
        self._noise, self._starts = (np.random.default_rng(one) for one in seeds)
        self._failures: Counter[str] = Counter()

    @property
    def failures(self) -> Mapping[str, int]:
        return FrozenMapping(self._failures)

    def measure(self, points: Experiments | Runs, *, repeats: int = 1) -> Measurements:
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
        if not isinstance(points, Experiments | Runs):
            raise TypeError(f"points: expected Experiments or Runs, given {type(points).__name__}")
        times = check_positive_int(repeats, "repeats", most=MAX_POINTS // max(points.dt.size, 1))
        planned = points[np.tile(np.arange(len(points)), times)]
        deviation = self._start_std * self._starts.standard_normal((len(planned), len(self.model.states)))
        noise = self._noise_std * self._noise.standard_normal((*planned.dt.shape, len(self.model.outputs)))
        if planned.x0.shape[1] != len(self.model.states):
            raise ValueError(f"x0: expected shape (K, {len(self.model.states)}), given {planned.x0.shape}")
        if isinstance(planned, Runs):
            x0 = checked_starts(self.model, planned, self.theta, deviation) + deviation
            along = simulate(self.model, planned.starting(x0), self.theta, rtol=self.rtol, jumps="cross")
            completed = np.arange(planned.dt.shape[1]) < along.reached[:, None]
            there = planned.measured & completed & (along.status != Status.not_finite)[:, None]
            y, status = along.y, along.status
        else:
            done = simulate(self.model, planned.starting(planned.x0 + deviation), self.theta, rtol=self.rtol, jumps="cross")
            there = done.status == Status.ok
            y, status = done.y, done.status
        counts = failures_of(status)
        self._failures += counts
        reasons = ", ".join(f"{name} {count}" for name, count in counts.items())
        of_runs = isinstance(planned, Runs)
        if not there.any():
            far, none = ("a sample", "no runs") if of_runs else ("its end", "no points")
            raise ValueError(f"points: expected at least one whose trajectory reaches {far}, given none: {reasons or none}")
        if counts:
            warnings.warn(
                f"{sum(counts.values())} of {len(planned)} "
                f"{'runs are not measured to their ends' if of_runs else 'points are not measured'}: {reasons}",
                RuntimeWarning,
                stacklevel=2,
            )
        return Measurements(planned, np.where(there[..., None], y + noise, np.nan))

    def __repr__(self) -> str:
        measured = [name for name, std in zip(names_of(self.model.outputs), self._noise_std, strict=True) if not np.isnan(std)]
        return f"VirtualRig({self.model.name}, measures {', '.join(measured)})"
