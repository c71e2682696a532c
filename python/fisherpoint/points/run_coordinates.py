"""The free numbers of runs of a region, each between 0 and 1, and the runs that they stand for."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.quantity import names_of
from ..basics.values import Array, FrozenMapping
from ..models import Model
from .profiles import ActuatorClock, Fact, InputProfile
from .run_region import RunRegion
from .runs import Runs

ROUNDING = 1e-9
"""Share by which a step between levels may exceed what an input may change: 0.3 - 0.2 is more than 0.2 - 0.1."""

DECADE = 10.0
"""Bounds of durations that are further apart count logarithmically."""


STEP = 1e-6
"""Step of a number for the slope of a profile."""


class OfProfile(NamedTuple):
    """An input that follows a profile, and where its numbers are."""

    name: str
    where: slice
    profile: InputProfile
    clock: ActuatorClock


class RunCoordinates:
    """The free numbers of a run, each between 0 and 1: starts, then inputs by segment, then durations by segment.

    Attributes
    ----------
    clock : SampleClock, or None
        When outputs are measured; None where the ends of segments are.
    names : tuple of str
        What each is of.
    shared : ndarray of bool, (d,)
        Whether all runs of a design have it alike.
    stepped : ndarray of int, (d,)
        How many levels it has; 0 for any value.
    """

    def __init__(self, region: RunRegion, model: Model) -> None:
        region.check(model, (*model.jumps, *model.kinks))
        self._region, self._model, n = region, model, region.segments
        self.clock = region.clock(model)
        states, inputs = names_of(model.states), names_of(model.inputs)
        self._places: list[tuple[str, str, slice]] = []  # kind, name, and where its numbers are
        self.profiles: list[OfProfile] = []
        names: list[str] = []
        stepped: list[int] = []
        for kind, group in (("state", states), ("input", inputs), ("dt", ("dt",))):
            for name in (name for name in group if name not in region.given):
                lower, upper = region.bounds[name]
                levels = len(region.levels.get(name, ()))
                rests = kind == "state" and region.rest is not None and name in region.rest.found(states)
                if lower == upper or levels == 1 or rests:
                    continue
                count = n if kind != "state" and name not in region.constant else 1
                numbers = [levels] * count
                profile = region.profile_of(name) if kind == "input" else None
                if profile is not None:
                    clock = ActuatorClock(n, region.bounds["dt"][0], region.slew.get(name, np.inf) / (upper - lower))
                    self.profiles.append(
                        OfProfile(name, slice(len(names), len(names) + len(profile.numbers(clock))), profile, clock)
                    )
                    numbers = list(profile.numbers(clock))
                self._places.append((kind, name, slice(len(names), len(names) + len(numbers))))
                names += [name] * len(numbers)
                stepped += numbers
        self.names = tuple(names)
        self.stepped = np.array(stepped, dtype=np.intp)
        self.shared: NDArray[np.bool_] = np.array([name in region.shared for name in names], dtype=bool)

    def __len__(self) -> int:
        return len(self.names)

    @cached_property
    def inputs(self) -> list[tuple[str, slice]]:
        """Inputs whose numbers are values one after the other, of segments or knots, and where these are."""
        fixed = {*self._region.constant, *(one.name for one in self.signals)}
        return [(name, where) for kind, name, where in self._places if kind == "input" and name not in fixed]

    @property
    def signals(self) -> list[OfProfile]:
        """Inputs that follow a profile whose numbers are something else, such as frequencies."""
        return [one for one in self.profiles if not one.profile.in_order]

    @property
    def any_values(self) -> bool:
        """Whether an input may have any values from segment to segment."""
        return not {name for name, _ in self.inputs} <= {one.name for one in self.profiles}

    @property
    def segments(self) -> int:
        """Number of segments of each run."""
        return self._region.segments

    @cached_property
    def input_names(self) -> tuple[str, ...]:
        """Inputs that may vary, from segment to segment or between runs."""
        return tuple(name for kind, name, _ in self._places if kind == "input")

    @cached_property
    def quiet(self) -> Array:
        """Free numbers (d,) at which inputs are those of the rest, or as near to zero as they may be; others are in the middle."""
        z, rest = np.full(len(self), 0.5), self._region.rest
        for kind, name, where in self._places:
            if kind == "input":
                value, (lower, upper) = 0.0 if rest is None else rest.u.get(name, 0.0), self._region.bounds[name]
                levels = np.array(self._region.levels.get(name, ()))
                nearest = (np.argmin(np.abs(levels - value)) + 0.5) / len(levels) if len(levels) else None
                z[where] = np.clip((value - lower) / (upper - lower), 0.0, 1.0) if nearest is None else nearest
        return self.still(z)

    def still(self, z: Array) -> Array:
        """Free numbers (d,) with those of profiles such that inputs are held at the shares of their ranges that stand there."""
        z = z.copy()
        for _, where, profile, clock in self.profiles:
            z[where] = profile.still(float(z[where.start]), clock)
        return z

    def steepness(self, z: Array) -> Array:
        """By which share of its range an input changes at most, over the change of a number of z (K, d); 1 at least.

        Many turns of a chirp lie between both ends of the range of its frequency.
        """
        steep = np.ones(z.shape)
        for one in self.profiles:
            own = z[:, one.where]
            for j in np.flatnonzero(self.stepped[one.where] == 0).tolist():
                beside = np.repeat(own[None], 2, axis=0)
                beside[0, :, j], beside[1, :, j] = np.maximum(own[:, j] - STEP, 0.0), np.minimum(own[:, j] + STEP, 1.0)
                low, high = (one.profile.shares(values, one.clock) for values in beside)
                slope = np.abs(high - low).max(axis=1) / (beside[1, :, j] - beside[0, :, j])
                steep[:, one.where.start + j] = np.maximum(1.0, slope)
        return steep

    def facts(self, z: Array) -> Mapping[str, tuple[Fact, ...]]:
        """The numbers of profiles of one run (d,), by input, in its unit."""
        units = {quantity.name: quantity.unit for quantity in self._model.inputs}
        found: dict[str, tuple[Fact, ...]] = {}
        for one in self.profiles:
            lower, upper = self._region.bounds[one.name]
            ranges = {"level": (lower, upper - lower, units[one.name]), "size": (0.0, upper - lower, units[one.name])}
            facts = [(fact, *ranges.get(fact.unit, (0.0, 1.0, fact.unit))) for fact in one.profile.facts(z[one.where], one.clock)]
            found[one.name] = tuple(Fact(fact.name, low + wide * fact.value, unit) for fact, low, wide, unit in facts)
        return FrozenMapping(found)

    def parts(self, looks: int) -> int:
        """Number of parts of a run at most, each segment of which is divided in so many, and at its samples."""
        return looks * self.segments + (0 if self.clock is None else len(self.clock.instants) + 1)

    def runs(self, z: Array) -> Runs:
        """The runs with free numbers z (K, d), as they are carried out and sampled."""
        return self.sampled(self.held(z))[0]

    def sampled(self, held: Runs, counts: NDArray[np.intp] | None = None) -> tuple[Runs, NDArray[np.intp] | None]:
        """Runs of held segments (K, N) as they are sampled, and which of their parts (K, N) ends each segment; None for its own.

        With `counts` (K,) so many samples are measured, even where a run ends before.
        """
        return (
            (held, None)
            if self.clock is None
            else held.sampled_by(self.clock, self.clock.counts(held.dt) if counts is None else counts)
        )

    def held(self, z: Array) -> Runs:
        """The runs with free numbers z (K, d), by their held segments."""
        region, model, count = self._region, self._model, len(z)
        shape = (count, region.segments)
        values: dict[str, Array] = {}
        for name, (lower, upper) in region.bounds.items():
            # Of a state that is at rest, the middle of its bounds is the guess; others have one value, or are set below.
            one = region.levels[name][0] if len(region.levels.get(name, ())) == 1 else 0.5 * (lower + upper)
            values[name] = np.full((count, 1), one)
        for _, name, where in self._places:
            values[name] = self._value(name, z[:, where])
        for own in self.profiles:
            lower, upper = region.bounds[own.name]
            values[own.name] = np.clip(lower + (upper - lower) * own.profile.shares(z[:, own.where], own.clock), lower, upper)
        x0 = np.column_stack([values[name] for name in names_of(model.states)])
        u = np.empty((*shape, len(model.inputs)))
        dt = np.broadcast_to(values["dt"], shape).copy()
        if region.duration is not None:
            dt = _shortened(dt, region.bounds["dt"][0], region.duration)
        slow = {one.name for one in self.profiles}  # as they are
        for i, name in enumerate(names_of(model.inputs)):
            of = region.given[name].held(dt) if name in region.given else np.broadcast_to(values[name], shape)
            u[:, :, i] = of if name in slow else self._slewed(name, of)
        measured = np.broadcast_to(np.array(region.measured), shape).copy()
        return Runs(x0, u, dt, measured, rest=region.rest, columns=(*names_of(model.states), *names_of(model.inputs)))

    def _value(self, name: str, share: Array) -> Array:
        lower, upper = self._region.bounds[name]
        if name in self._region.levels:
            levels = np.array(self._region.levels[name])
            return np.asarray(levels[np.clip((share * len(levels)).astype(int), 0, len(levels) - 1)])
        if name == "dt" and upper > DECADE * lower:
            return np.asarray(np.clip(lower * (upper / lower) ** share, lower, upper))
        return np.asarray(np.clip(lower + (upper - lower) * share, lower, upper))

    def _slewed(self, name: str, values: Array) -> Array:
        """The values (K, N), as near as the steps from one segment to the next allow; levels where there are some."""
        most = self._region.slew.get(name)
        if most is None:
            return values
        levels = np.array(self._region.levels.get(name, ()))
        slewed = values.copy()
        for n in range(1, values.shape[1]):
            before = slewed[:, n - 1]
            slewed[:, n] = np.clip(values[:, n], before - most, before + most)
            if len(levels):
                slewed[:, n] = _nearest_level(levels, values[:, n], before, most)
        return slewed


def _shortened(dt: Array, lower: float, duration: float) -> Array:
    """Durations (K, N); those that last too long together approach their lower bound by one share of what is above it."""
    above = dt - lower
    excess, left = above.sum(axis=1, keepdims=True), max(duration - dt.shape[1] * lower, 0.0)
    share = np.divide(left, excess, out=np.ones_like(excess), where=excess > left)
    return np.where(share < 1.0, lower + share * above, dt)


def _nearest_level(levels: Array, wanted: Array, before: Array, most: float) -> Array:
    """Return the level nearest to `wanted` (K,), of those (L,) within `most` of the one `before` (K,)."""
    reached = np.abs(levels - before[:, None]) <= most * (1 + ROUNDING)
    distance = np.where(reached, np.abs(levels - wanted[:, None]), np.inf)
    return np.asarray(levels[np.argmin(distance, axis=1)])
