"""What experiments cost: for the first one, for each, for its time, and for each change of a setting."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ...basics.checks import as_float, by_name, check_type
from ...basics.quantity import names_of
from ...basics.values import Array, FrozenMapping
from ...models import Model
from ...points.experiments import Experiments


@dataclass(frozen=True, kw_only=True)
class Cost:
    """A linear model of costs, in whatever unit.

    Parameters
    ----------
    fixed : float
        Of any design: setting up.
    per_experiment, per_second : float
        Of every point, and of its duration dt.
    per_change : mapping of state or input to float
        Of each change of its set value from one experiment to the next. The experiments are taken in an order with few changes:
        sorted by the setting that costs most to change, those where it is equal by the next, and so on.
    """

    fixed: float = 0.0
    per_experiment: float = 0.0
    per_second: float = 0.0
    per_change: Mapping[str, float] = field(default_factory=lambda: FrozenMapping({}))

    def __post_init__(self) -> None:
        for name in ("fixed", "per_experiment", "per_second"):
            object.__setattr__(self, name, _at_least_0(getattr(self, name), name))
        object.__setattr__(self, "per_change", by_name(self.per_change, None, "per_change", _at_least_0))

    def check(self, model: Model) -> None:
        """Raise where a setting is none of the model's states and inputs."""
        check_type(model, Model, "model")
        by_name(self.per_change, [name for name in names_of(model.axes) if name != "dt"], "per_change", _at_least_0)

    def of(self, points: Experiments, model: Model) -> float:
        """The cost of a design."""
        self.check(model)
        check_type(points, Experiments, "points")
        changes = 0.0
        if self.per_change and len(points):
            names = sorted(self.per_change, key=lambda name: -self.per_change[name])
            columns = points.table[:, [names_of(model.axes).index(name) for name in names]]
            ordered = columns[np.lexsort(columns.T[::-1])]
            changed: Array = (ordered[1:] != ordered[:-1]).sum(axis=0)
            changes = float(np.dot(changed, [self.per_change[name] for name in names]))
        return self.fixed + self.per_experiment * len(points) + self.per_second * float(points.dt.sum()) + changes


def _at_least_0(value: float, name: str) -> float:
    value = as_float(value, name)
    if not value >= 0 or not np.isfinite(value):
        raise ValueError(f"{name}: expected a cost of 0 or more, given {value:g}")
    return value
