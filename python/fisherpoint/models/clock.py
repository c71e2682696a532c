"""Time in equations, as t: a clock among the states that the core follows, which nobody else sees.

It begins at zero with each point, run or record, and moves at the rate 1: time is exact, and a switch by time is a jump like any
other.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..basics.quantity import Quantity
from ..basics.values import Array
from ..engine.levels import Kernels

NAMES = "t", "time"
"""What time is called in equations, where no quantity has the name."""


def clock_names(taken: Collection[str]) -> list[str]:
    """What time is called in the equations of a model with quantities of these names; the first is shown."""
    return [name for name in NAMES if name not in taken]


def clock_quantity(name: str) -> Quantity:
    """Time as a state."""
    return Quantity(name, "s", "time since the start")


def with_time(x: Array, t: Any) -> Array:
    """States (..., n_x) with the time t (...) as a further one."""
    return np.concatenate([x, np.broadcast_to(np.asarray(t, dtype=np.float64), x.shape[:-1])[..., np.newaxis]], axis=-1)


@dataclass(frozen=True)
class ClockedCore:
    """A core with a clock as its last state; states that are given without one are those at the start.

    Attributes
    ----------
    whole : core
    n_x : int
        States without the clock.
    """

    whole: Any
    n_x: int

    def started(self, x: Any) -> Array:
        """States with a clock."""
        x = np.asarray(x, dtype=np.float64)
        return x if x.shape[-1] > self.n_x else with_time(x, 0.0)

    def rhs(self, x: Any, u: Any, theta: Any) -> Array:
        rates = np.asarray(self.whole.rhs(self.started(x), u, theta))
        return np.ascontiguousarray(rates.reshape(len(rates), self.n_x + 1)[:, : self.n_x])

    def output(self, x: Any, u: Any, theta: Any) -> Any:
        return self.whole.output(self.started(x), u, theta)

    def output_jacobian(self, x: Any, u: Any, theta: Any) -> Any:
        return self.whole.output_jacobian(self.started(x), u, theta)

    def switching(self, x: Any, u: Any, theta: Any) -> Any:
        return self.whole.switching(self.started(x), u, theta)

    def limits(self, x: Any, u: Any, theta: Any) -> Any:
        return self.whole.limits(self.started(x), u, theta)


@dataclass(frozen=True)
class ClockedKernels:
    """Kernels for a `ClockedCore`: what they return has no clock."""

    kernels: Kernels

    def simulate(self, model: ClockedCore, x0: Any, *given: Any, **options: Any) -> tuple[Any, ...]:
        x, *others = self.kernels.simulate(model.whole, model.started(x0), *given, **options)
        return _states(x), *others

    def sensitivities(self, model: ClockedCore, x0: Any, *given: Any, **options: Any) -> tuple[Any, ...]:
        x, y, dx, *others = self.kernels.sensitivities(model.whole, model.started(x0), *given, **options)
        return _states(x), y, _rows(dx), *others

    def simulate_runs(self, model: ClockedCore, x0: Any, *given: Any, **options: Any) -> tuple[Any, ...]:
        x, *others = self.kernels.simulate_runs(model.whole, model.started(x0), *given, **options)
        return _states(x), *others

    def run_sensitivities(self, model: ClockedCore, x0: Any, *given: Any, **options: Any) -> tuple[Any, ...]:
        s = options.get("s")
        if s is not None and np.size(s):
            s = np.asarray(s)
            options = {**options, "s": np.concatenate([s, np.zeros_like(s[:, :1])], axis=1)}
        x, y, dx, *others = self.kernels.run_sensitivities(model.whole, model.started(x0), *given, **options)
        return _states(x), y, _rows(dx), *others

    def predictive_covariance(self, model: ClockedCore, x0: Any, *given: Any, **options: Any) -> tuple[Any, ...]:
        return self.kernels.predictive_covariance(model.whole, model.started(x0), *given, **options)


def _states(x: Any) -> Array:
    return np.ascontiguousarray(np.asarray(x)[..., :-1])


def _rows(dx: Any) -> Array:
    return np.ascontiguousarray(np.asarray(dx)[..., :-1, :])
