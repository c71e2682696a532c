"""The region in which experiment points may lie."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..basics.checks import (
    as_generator,
    as_sequence,
    check_flag,
    check_mapping,
    check_names,
    check_positive_int,
    check_type,
)
from ..basics.messages import shown
from ..basics.quantity import names_of
from ..basics.values import Array, FrozenMapping
from ..models import Model
from .bounds import in_units_of, pair, read_bounds, with_units
from .constraints import Constraint, parse_constraint
from .experiments import Experiments

MOST_DRAWN = 10**7
"""Points of one call of `ExperimentRegion.draw`."""

NEAREST = 1e4
"""The width of the region over the shortest typical step of `ExperimentRegion.draw_near`."""

EDGE, LONGEST = 0.3, 0.8
"""How often `ExperimentRegion.draw_at_edges` puts a number on its lower bound, on its upper bound and next to zero; and dt on its
longest."""

AT_REST = 0.2
"""Share of the points that it puts next to zero in all numbers that can be zero: at rest, with what is shut."""

NEXT_TO_ZERO = 0.1, 1e-4
"""How far from zero that is, as shares of the region's width, every order of magnitude alike."""

ASIDE = 0.3
"""Distance by which points of `draw_near` that go on in a direction leave it, as a share of how far they go."""


class ExperimentRegion:
    """A box in start state, input and duration, cut by constraints.

    Parameters
    ----------
    bounds : mapping of name to (lower, upper), or with a unit
        One pair for every state, every input and ``"dt"``, SI units; equal bounds fix the value. A model without state has no dt.
        (lower, upper, unit), or (value, unit), is converted to the model's unit.
    constraints : sequence of str or callable
        Each a comparison such as ``"p_A + p_B < 2.5e7"``, or a function that takes a mapping of name to array (K,) and returns a
        boolean array (K,). A point must satisfy all. Numbers are in the model's units, whatever those of the bounds.

    Attributes
    ----------
    bounds : mapping of name to (lower, upper)
    units : mapping of name to str
        Units of the bounds that are still to be converted; none in a `DesignProblem`, which knows the model.

    Raises
    ------
    ValueError
        Where bounds are not finite or upside down, or a duration may be zero or less.
    """

    kind: ClassVar[str] = "point"
    """Word for one of what it is a region of."""

    shared: ClassVar[tuple[str, ...]] = ()
    """Names of what all points have alike, as `RunRegion` has it: none."""

    def __init__(self, bounds: Mapping[str, Sequence[Any]], constraints: Iterable[Constraint] = ()) -> None:
        given = check_mapping(bounds, "region", "(lower, upper)")
        self.bounds: Mapping[str, tuple[float, float]]
        self.units: Mapping[str, str]
        self.bounds, self.units = read_bounds(given, pair)
        if "dt" in self.bounds and not self.bounds["dt"][0] > 0:
            raise ValueError(f"region['dt']: expected positive durations in s, given the lower bound {self.bounds['dt'][0]:g}")
        if isinstance(constraints, str) or callable(constraints):
            constraints = (constraints,)
        self.constraints: tuple[Constraint, ...] = as_sequence(constraints, "constraints", "texts and functions")
        for constraint in self.constraints:
            if not isinstance(constraint, str) and not callable(constraint):
                raise TypeError(f"constraints: expected texts and functions, given {shown(constraint)}")
        self._holds: list[Callable[[Mapping[str, Array]], NDArray[np.bool_]]] = [
            parse_constraint(c, self.bounds) if isinstance(c, str) else c for c in self.constraints
        ]

    def _arguments(self) -> dict[str, Any]:
        """Functions among the constraints are None, as no file can hold them."""
        return {"bounds": self.bounds, "constraints": [one if isinstance(one, str) else None for one in self.constraints]}

    @classmethod
    def _made(cls, bounds: Any, constraints: Any) -> ExperimentRegion:
        return cls(bounds, [_not_saved if one is None else one for one in constraints])

    def check(self, model: Model, crossed: Collection[str] = ()) -> None:
        """Raise unless the region bounds exactly what a point of `model` consists of, and some point may be one.

        Points may start on the surfaces that are `crossed`.
        """
        check_type(model, Model, "model")
        if model.updates or model.late_outputs:
            what = "updates" if model.updates else "late outputs"
            raise ValueError(f"region: expected a RunRegion for a model with {what}, given one of points for {model.name}")
        check_names(self.bounds, names_of(model.axes), "region")
        refuse_fixed_on_surface(self.bounds, model, crossed)

    def in_units_of(self, model: Model) -> ExperimentRegion:
        """The region with all bounds in the units of a model."""
        check_type(model, Model, "model")
        if not self.units:
            return self
        return ExperimentRegion(in_units_of(self.bounds, self.units, model.axes), self.constraints)

    def box(self, model: Model) -> tuple[Array, Array]:
        """The lower and the upper bounds, (d,) each, in the order and the units of the model's axes."""
        bounds = self.in_units_of(model).bounds
        lower, upper = np.array([bounds[name] for name in names_of(model.axes)]).T
        return lower, upper

    def draw(self, model: Model, count: int, *, seed: int | np.random.Generator = 0, decades: bool = False) -> Experiments:
        """Draw points uniformly from the box; the constraints are not looked at.

        Parameters
        ----------
        model : Model
        count : int
            Number of points.
        seed : int or numpy.random.Generator
            The same integer gives the same points; a generator gives others each time.
        decades : bool
            Whether durations that span more than a decade are drawn logarithmically, so that none of these is left out.

        Raises
        ------
        TypeError, ValueError
            For a model that the region is not of, and a count or a seed that is none.
        """
        check_type(model, Model, "model")
        check_names(self.bounds, names_of(model.axes), "region")
        decades = check_flag(decades, "decades")
        count = check_positive_int(count, "count", 0, MOST_DRAWN)
        rng = as_generator(seed)
        lower, upper = self.box(model)
        share = rng.random((count, len(lower)))
        table = lower + (upper - lower) * share
        if decades and model.states and upper[-1] > 10.001 * lower[-1]:
            table[:, -1] = lower[-1] * (upper[-1] / lower[-1]) ** share[:, -1]
        return Experiments.of_table(model, np.clip(table, lower, upper))

    def draw_at_edges(self, model: Model, count: int, *, seed: int | np.random.Generator = 0) -> Experiments:
        """Draw points with most numbers on their bounds or next to zero; the constraints are not checked.

        The most informative points mostly start there: from rest, with a valve that is shut or wide open, under full pressure.
        Uniform draws are hardly ever near such a corner in several numbers at once.
        """
        rng = as_generator(seed)
        lower, upper = self.box(model)
        width, share = upper - lower, rng.random((count, len(lower)))
        table = lower + width * share
        farthest, nearest = NEXT_TO_ZERO
        distance = width * farthest * (nearest / farthest) ** share * rng.choice([-1.0, 1.0], share.shape)
        kind = rng.random(share.shape)
        has_zero = (lower < 0) & (upper > 0)
        kind[(rng.random((count, 1)) < AT_REST) & has_zero] = 1.0
        near_zero = (kind > 1 - EDGE) & has_zero
        table = np.select([kind < EDGE, kind < 2 * EDGE, near_zero], [np.broadcast_to(lower, share.shape), upper, distance], table)
        if model.states:
            table[:, -1] = np.where(kind[:, -1] < LONGEST, upper[-1], lower[-1] + width[-1] * share[:, -1])
        return Experiments.of_table(model, np.clip(table, lower, upper))

    def draw_near(
        self, model: Model, points: Experiments, steps: Array | None = None, *, seed: int | np.random.Generator = 0
    ) -> Experiments:
        """Draw a point near each given one: some coordinates are moved, and those that would leave the box stay on its bounds.

        How far is drawn too, from the width of the box to a `NEAREST`-th of it, every order of magnitude alike: a search that draws
        often comes as close to an optimum as it can use, without a schedule of steps. Where `steps` (K, d) are given that are not
        zero, a point goes about so far in about this direction: a search may continue in the direction of its last steps, as along
        a limit that bends.
        """
        rng = as_generator(seed)
        lower, upper = self.box(model)
        table = points.table[:, : len(lower)].copy()
        free = np.flatnonzero(upper > lower)
        if len(table) and len(free):
            width = (upper - lower)[free]
            reach = NEAREST ** -rng.random((len(table), 1))
            moved = rng.random((len(table), len(free))) < 0.5
            moved[np.arange(len(table)), rng.integers(len(free), size=len(table))] = True
            change = np.where(moved, reach * width * rng.standard_normal(moved.shape), 0.0)
            if steps is not None:
                on = steps[:, free]
                far = np.abs(on / width).max(axis=1, keepdims=True)
                aside = np.where(moved, ASIDE * far * width * rng.standard_normal(moved.shape), 0.0)
                change = np.where(far > 0, np.exp(rng.standard_normal((len(table), 1))) * (on + aside), change)
            table[:, free] = np.clip(table[:, free] + change, lower[free], upper[free])
        return Experiments.of_table(model, table)

    def satisfied(self, model: Model, points: Experiments) -> NDArray[np.bool_]:
        """Return which points satisfy all constraints, (K,)."""
        check_type(model, Model, "model")
        check_type(points, Experiments, "points")
        names = names_of(model.axes)
        columns = dict(zip(names, points.table.T[: len(names)], strict=True))
        result = np.ones(len(points), dtype=bool)
        for constraint, holds in zip(self.constraints, self._holds, strict=True):
            given = holds(FrozenMapping(columns))
            try:
                mask = np.asarray(given)
            except (TypeError, ValueError, RuntimeError):
                mask = np.array(None)
            if mask.shape != result.shape or mask.dtype != np.bool_:
                raise ValueError(
                    f"constraint {shown(constraint)}: expected a boolean array of shape {result.shape}, given {shown(given)}"
                )
            result &= mask
        return result

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ExperimentRegion) and self._identity() == other._identity()

    def __hash__(self) -> int:
        return hash(self._identity())

    def _identity(self) -> tuple[object, ...]:
        return self.bounds, self.units, self.constraints

    def __reduce__(self) -> tuple[object, ...]:
        return (ExperimentRegion, (with_units(self.bounds, self.units), self.constraints))

    def __repr__(self) -> str:
        return f"ExperimentRegion({with_units(self.bounds, self.units)!r}, constraints={list(self.constraints)!r})"


def refuse_fixed_on_surface(bounds: Mapping[str, tuple[float, float]], model: Model, crossed: Collection[str]) -> None:
    """Raise where bounds fix a state, or an input, at zero on a surface of that name that is not `crossed`."""
    for kind, zeros in (("switching surface", (*model.jumps, *model.kinks)), ("pole", model.poles)):
        for zero in zeros:
            if bounds.get(zero) == (0.0, 0.0) and zero not in crossed:
                raise ValueError(f"region[{zero!r}]: expected bounds off the {kind} {zero} = 0, given (0, 0)")


def _not_saved(columns: Mapping[str, Array]) -> NDArray[np.bool_]:
    raise ValueError("constraint: expected the function that this design was made with, given none: functions are not saved")
