"""True parameters, and what a rig that has them would measure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..basics.checks import as_float, by_name
from ..basics.messages import shown
from ..basics.quantity import names_of
from ..basics.values import Array, FrozenMapping, IntArray
from ..data.record_trajectory import first_failure
from ..estimation.local_unknowns import LocalUnknowns
from ..information.assumed import Assumed, assumed_of
from ..information.draws import drawn_from_prior
from ..information.problem import DesignProblem
from ..models import Model
from ..noise.draws import memories, readings
from ..noise.models import NoiseOf
from ..noise.sensors import Sensors
from ..points.parameter_checks import sensible
from ..points.points_or_runs import Points, as_runs
from ..points.simulate import simulate
from ..points.status import Status

TRUTH_RTOL = 1e-10
"""Tolerance of the true trajectories."""


class LocalScatter(NamedTuple):
    """How the values of a local parameter scatter about that of the plant: by a standard deviation, or that of the logarithm."""

    std: float
    log: bool = False

    def about(self, mean: Array, z: Array) -> Array:
        """Values (B, n) about means (B, 1), from standard normal numbers (B, n)."""
        return np.asarray(mean * np.exp(self.std * z - self.std**2 / 2) if self.log else mean + self.std * z)


NO_SCATTER: Mapping[str, LocalScatter] = FrozenMapping({})


def local_scatter(problem: DesignProblem, spread: Mapping[str, float], over_prior: bool) -> Mapping[str, LocalScatter]:
    """How local parameters scatter in the data: as `spread` says, else the problem, else the prior where truths are drawn."""
    prior = problem.prior

    def one(name: str, known: float | None) -> LocalScatter:
        if known is not None or not over_prior:
            return LocalScatter(known or 0.0)
        return LocalScatter(float(prior.normal_std[prior.names.index(name)]), name in prior.log)

    return {name: one(name, spread.get(name, of.std)) for name, of in problem.local_parameters.items()}


@dataclass(frozen=True, eq=False)
class Rig:
    """A virtual rig for many true parameters at once.

    Attributes
    ----------
    model : Model
        What makes the data.
    assumed : Assumed or None
        What deviates from one virtual experiment to the next (constants), and from point to point or run to run; None where nothing
        does.
    sensors : Sensors
    local : mapping of name to LocalScatter
        How the values of local parameters scatter.
    """

    model: Model
    assumed: Assumed | None
    sensors: Sensors
    local: Mapping[str, LocalScatter] = NO_SCATTER

    @classmethod
    def of(cls, problem: DesignProblem, truth: Model | None, noise: NoiseOf, local: Mapping[str, LocalScatter] = NO_SCATTER) -> Rig:
        """The rig that the problem describes; a `truth` has exactly its own constants."""
        model, uncertain, varies = (problem.model, problem.uncertain, problem.varies) if truth is None else (truth, None, None)
        starts, assumed = problem.initial_state_std, None
        if uncertain or varies or starts:
            assumed = assumed_of(model, uncertain, varies, starts, problem.shared_starts)
        return cls(model, assumed, Sensors.of(noise, names_of(model.outputs)), local)

    def local_values(self, theta: Array, local: LocalUnknowns, rng: Streams) -> Array:
        """The values (B, n) of local parameters in each group, about those of true parameters (B, p)."""
        z = rng.local.standard_normal((len(theta), len(local.each)))
        values, names = np.empty(z.shape), names_of(self.model.parameters)
        for name in local.local:
            places = local.of_parameter(name)
            values[:, places] = self.local[name].about(theta[:, [names.index(name)]], z[:, places])
        return values

    def of_runs(self, theta: Array, local: LocalUnknowns, values: Array) -> Array:
        """Parameters (B, K, p) of each point or run, with these values (B, n) of local parameters."""
        places, names = local.trajectories[0], names_of(self.model.parameters)
        found = np.repeat(theta[:, None], len(places), axis=1)
        found[:, :, [names.index(name) for name in local.local]] = values[:, places]
        return found

    def measure(self, points: Points, theta: Array, rng: Streams, threads: int) -> tuple[Array, IntArray, Array]:
        """Results of virtual experiments with true parameters (B, p), or (B, K, p) of each point or run.

        Returns
        -------
        y : ndarray, (B, S, n_y)
            Outputs of all samples, NaN where not measured.
        status : ndarray of int, (B,)
            The worst of each experiment.
        nuisance : ndarray, (B, q)
            By how much the constants of each plant deviate, SI units.
        """
        runs = as_runs(points)
        count, n_runs, n_samples = len(theta), len(runs), int(runs.measured.sum())
        white, memory, common, anew = self.deviations(points, count, rng)
        model = self.model
        true = np.repeat(theta, n_runs, axis=0) if theta.ndim == 2 else theta.reshape(-1, theta.shape[-1])
        if self.assumed is not None:
            assumed, model = self.assumed, self.assumed.model
            true = assumed.theta(true)
            true[:, assumed.nuisance] += np.repeat(common, n_runs, axis=0)
            true[:, assumed.columns] += anew
        status = np.full(count * n_runs, Status.not_finite, dtype=np.int32)
        rows = np.flatnonzero(sensible(model, true))
        y = np.zeros((count * n_runs, runs.dt.shape[1], len(self.sensors.std)))
        if len(rows):
            many = np.tile(np.arange(n_runs), count)[rows]
            done = simulate(model, runs[many], true[rows], rtol=TRUTH_RTOL, threads=threads, jumps="cross")
            y[rows], status[rows] = done.y, done.status
        y = y[np.tile(runs.measured, (count, 1))]
        shown = readings(self.sensors, y.reshape(count, n_samples, -1), white, memory)
        shown[:, ~(runs.readings[runs.measured] & self.sensors.measured)] = np.nan
        return shown, first_failure(status.reshape(count, n_runs)), common

    def deviations(self, points: Points, count: int, rng: Streams) -> tuple[Array, Array, Array, Array]:
        """Draw what deviates in the next experiments.

        Standard normal numbers and the noise with a memory (B, S, n_y), constants (B, q), and what is drawn anew in each run.
        """
        runs, n_y = as_runs(points), len(self.sensors.std)
        white = rng.noise.standard_normal((count, int(runs.measured.sum()), n_y))
        memory = np.zeros(white.shape)
        if self.sensors.parts:
            of_runs = memories(self.sensors, np.tile(runs.dt, (count, 1)), rng.memories)
            memory = of_runs[np.tile(runs.measured, (count, 1))].reshape(white.shape)
        if self.assumed is None:
            return white, memory, np.zeros((count, 0)), np.zeros((count * len(runs), 0))
        assumed = self.assumed
        common = assumed.nuisance_std * rng.constants.standard_normal((count, len(assumed.nuisance)))
        return white, memory, common, assumed.std * rng.anew.standard_normal((count * len(runs), len(assumed.columns)))


@dataclass(frozen=True, eq=False)
class Streams:
    """Random numbers of virtual experiments, the same for every design, so that results differ by the designs alone."""

    noise: np.random.Generator
    constants: np.random.Generator
    anew: np.random.Generator
    local: np.random.Generator
    memories: tuple[np.random.Generator, ...]

    @classmethod
    def of(cls, seed: int, outputs: int) -> Streams:
        """Those of so many outputs; each output has its own stream for noise with a memory."""
        noise, constants, anew, *memories = (np.random.default_rng([seed, stream]) for stream in range(1, 4 + outputs))
        return cls(noise, constants, anew, np.random.default_rng([seed, 0, 1]), tuple(memories))

    @property
    def _all(self) -> tuple[np.random.Generator, ...]:
        return self.noise, self.constants, self.anew, self.local, *self.memories

    @property
    def position(self) -> tuple[Mapping[str, Any], ...]:
        """How far they are: a value, from which `at` goes on."""
        return tuple(one.bit_generator.state for one in self._all)

    @classmethod
    def at(cls, position: Sequence[Mapping[str, Any]]) -> Streams:
        """Random numbers that go on from a position."""
        streams = cls.of(0, len(position) - 4)
        for one, state in zip(streams._all, position, strict=True):
            one.bit_generator.state = state
        return streams


def truths_of(problem: DesignProblem, theta: str | Mapping[str, float], count: int, seed: int) -> tuple[Array, int]:
    """True parameters (count, p), and how many draws were left out.

    Raises
    ------
    TypeError, ValueError
        For anything but "prior", "mean" or a mapping of names to values that make sense.
    """
    if isinstance(theta, str) and theta == "prior":
        return drawn_from_prior(problem, count, np.random.default_rng([seed, 0]))
    if not isinstance(theta, Mapping) and not (isinstance(theta, str) and theta == "mean"):
        raise ValueError(f"theta: expected 'prior', 'mean' or a mapping of names to values, given {shown(theta)}")
    values = dict(problem.prior.mean)
    if isinstance(theta, Mapping):
        values |= by_name(theta, values, "theta", as_float)
    for name in (name for name in problem.prior.log if not values[name] > 0):
        raise ValueError(f"theta[{name!r}]: expected a positive value of a log-normal parameter, given {values[name]!r}")
    return np.tile(problem.model.theta(values), (count, 1)), 0
