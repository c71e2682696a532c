"""States that the core follows and nobody else sees: what latches remember, and the clock."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..basics.values import Array
from ..engine.levels import Kernels


@dataclass(frozen=True)
class HiddenCore:
    """A core with further states behind the model's own; states that are given without them are those at the start.

    Attributes
    ----------
    whole : core
    n_x : int
        States of the model.
    starts : tuple of float
        The values of the others at the start.
    """

    whole: Any
    n_x: int
    starts: tuple[float, ...]

    def started(self, x: Any) -> Array:
        """States with the hidden ones."""
        states: Array = np.asarray(x, dtype=np.float64)
        if states.shape[-1] > self.n_x:
            return states
        hidden = np.broadcast_to(self.starts, (*states.shape[:-1], len(self.starts)))
        return np.concatenate([states, hidden], axis=-1)

    def rhs(self, x: Any, u: Any, theta: Any) -> Array:
        rates = np.asarray(self.whole.rhs(self.started(x), u, theta))
        return np.ascontiguousarray(rates.reshape(len(rates), self.n_x + len(self.starts))[:, : self.n_x])

    def updated(self, x: Any, u: Any, theta: Any, which: Any) -> Any:
        return self.whole.updated(self.started(x), u, theta, which)

    def output(self, x: Any, u: Any, theta: Any) -> Any:
        return self.whole.output(self.started(x), u, theta)

    def output_jacobian(self, x: Any, u: Any, theta: Any) -> Any:
        return self.whole.output_jacobian(self.started(x), u, theta)

    def switching(self, x: Any, u: Any, theta: Any) -> Any:
        return self.whole.switching(self.started(x), u, theta)

    def limits(self, x: Any, u: Any, theta: Any) -> Any:
        return self.whole.limits(self.started(x), u, theta)


@dataclass(frozen=True)
class HiddenKernels:
    """Kernels for a `HiddenCore`: what they return has the model's own states alone."""

    kernels: Kernels

    def simulate(self, model: HiddenCore, x0: Any, *given: Any, **options: Any) -> tuple[Any, ...]:
        x, *others = self.kernels.simulate(model.whole, model.started(x0), *given, **options)
        return _states(model, x), *others

    def sensitivities(self, model: HiddenCore, x0: Any, *given: Any, **options: Any) -> tuple[Any, ...]:
        x, y, dx, *others = self.kernels.sensitivities(model.whole, model.started(x0), *given, **options)
        return _states(model, x), y, _rows(model, dx), *others

    def simulate_runs(self, model: HiddenCore, x0: Any, *given: Any, **options: Any) -> tuple[Any, ...]:
        x, *others = self.kernels.simulate_runs(model.whole, model.started(x0), *given, **options)
        return _states(model, x), *others

    def run_sensitivities(self, model: HiddenCore, x0: Any, *given: Any, **options: Any) -> tuple[Any, ...]:
        s = options.get("s")
        if s is not None and np.size(s):
            s = np.asarray(s)
            none = np.zeros((len(s), len(model.starts), s.shape[2]))
            options = {**options, "s": np.concatenate([s, none], axis=1)}
        x, y, dx, *others = self.kernels.run_sensitivities(model.whole, model.started(x0), *given, **options)
        return _states(model, x), y, _rows(model, dx), *others

    def predictive_covariance(self, model: HiddenCore, x0: Any, *given: Any, **options: Any) -> tuple[Any, ...]:
        return self.kernels.predictive_covariance(model.whole, model.started(x0), *given, **options)


def _states(model: HiddenCore, x: Any) -> Array:
    return np.ascontiguousarray(np.asarray(x)[..., : model.n_x])


def _rows(model: HiddenCore, dx: Any) -> Array:
    dx = np.asarray(dx)
    return np.ascontiguousarray(dx[..., : model.n_x, :]) if dx.size else dx
