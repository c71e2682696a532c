"""What may vary in runs: starts, inputs and durations of segments, and which of their ends are measured."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..basics.checks import as_floats, as_positive, by_name, check_mapping, check_names, check_positive_int, check_type, names_among
from ..basics.messages import shown
from ..basics.quantity import names_of
from ..basics.units import converted
from ..basics.values import Array, FrozenMapping
from ..models import Model
from .bounds import in_units_of, pair_or_number, read_bounds, split_unit, units_in, with_units
from .region import refuse_fixed_on_surface
from .rest import Rest
from .runs import Runs, as_flags

MOST_SEGMENTS = 10_000

ROUNDING = 1e-9
"""Share by which a step between levels may exceed what an input may change: 0.3 - 0.2 is more than 0.2 - 0.1."""

DECADE = 10.0
"""Bounds of durations that are further apart count logarithmically."""


class RunRegion:
    """Runs of N segments: a box for the start, for the inputs of every segment, and for the segments' durations.

    Parameters
    ----------
    bounds : mapping of name to (lower, upper) or float, or with a unit
        Of every state at the start, every input, and ``"dt"``, the duration of each segment, s; SI units. A number, or equal
        bounds, fix the value. (lower, upper, unit), or (value, unit), is converted to the model's unit.
    segments : int
        N.
    constant : sequence of str
        Inputs, or ``"dt"``, that stay the same over a run.
    shared : sequence of str
        States at the start, constant inputs, or ``"dt"``, that all runs of a design have alike.
    levels : mapping of input to sequence of float, optional
        The only values that an input may take, within its bounds; with a unit as the last entry, [0, 0.5, 1, "kW"], they are
        converted to the model's.
    slew : mapping of input to float, optional
        The most that an input may change from one segment to the next; (0.2, "kW") is converted. Of an input with levels, each is
        the nearest one to the wanted value that is no farther from the one before.
    duration : float, optional
        The longest that a run may last, s. Where its segments would last longer, all of them keep the same share of what they have
        above the lower bound of ``"dt"``.
    measured : array_like of bool, (N,), optional
        Segments at whose ends outputs may be measured. Default: all.
    rest : Rest, optional
        Runs start at rest. The middle of the bounds of the states that are found there is the guess, and has the totals that a
        closed system keeps; states that are held vary within theirs.
    samples : int, optional
        The design takes the best so many of these of each run. Default: all.

    Raises
    ------
    TypeError, ValueError
        For bounds that are not finite or upside down, a duration that may be zero, levels outside the bounds, no segment, no
        sample, and unknown names.
    """

    kind: ClassVar[str] = "run"
    """Word for one of what it is a region of."""

    def __init__(
        self,
        bounds: Mapping[str, Sequence[Any] | float],
        segments: int,
        *,
        constant: Sequence[str] = (),
        shared: Sequence[str] = (),
        levels: Mapping[str, Sequence[Any]] | None = None,
        slew: Mapping[str, Any] | None = None,
        duration: float | None = None,
        measured: ArrayLike | None = None,
        samples: int | None = None,
        rest: Rest | None = None,
    ) -> None:
        self.bounds: Mapping[str, tuple[float, float]]
        self.units: Mapping[str, str]
        self.bounds, self.units = read_bounds(check_mapping(bounds, "region", "(lower, upper) or a number"), pair_or_number)
        if "dt" not in self.bounds:
            raise ValueError("region: expected bounds of 'dt', the duration of a segment in s, given none")
        if not self.bounds["dt"][0] > 0:
            raise ValueError(f"region['dt']: expected positive durations in s, given the lower bound {self.bounds['dt'][0]:g}")
        self.segments = check_positive_int(segments, "segments", most=MOST_SEGMENTS)
        names = tuple(self.bounds)
        self.constant = names_among(constant, names, "constant")
        self.shared = names_among(shared, names, "shared")
        given: Mapping[str, tuple[float, ...]] = by_name(levels, names, "levels", _levels)
        self._level_units, self._slew_units = units_in(levels, "levels"), units_in(slew, "slew")
        # Those with a unit are compared when both are in the model's.
        known = {name: values for name, values in given.items() if not (name in self.units or name in self._level_units)}
        within = {name: _within(values, *self.bounds[name], f"levels[{name!r}]") for name, values in known.items()}
        self.levels: Mapping[str, tuple[float, ...]] = FrozenMapping({**given, **within})
        self.slew: Mapping[str, float] = by_name(slew, names, "slew", _change)
        self.duration = None if duration is None else as_positive(duration, "duration", "duration in s")
        if self.duration is not None and self.duration < self.segments * self.bounds["dt"][0] * (1 - 1e-12):
            least = self.segments * self.bounds["dt"][0]
            raise ValueError(
                f"duration: expected at least that of {self.segments} shortest segments, {least:g} s, given {duration:g}"
            )
        flags = np.ones(self.segments, dtype=bool) if measured is None else as_flags(measured)
        if flags.shape != (self.segments,):
            raise ValueError(f"measured: expected {self.segments} flags, given {shown(measured)}")
        if not flags.any():
            raise ValueError("measured: expected at least one measured segment, given none")
        if rest is not None:
            check_type(rest, Rest, "rest")
        self.rest = rest
        self.measured: tuple[bool, ...] = tuple(flags.tolist())
        self.samples = None if samples is None else check_positive_int(samples, "samples", most=int(flags.sum()))

    def _arguments(self) -> dict[str, Any]:
        names = ("bounds", "segments", "constant", "shared", "levels", "slew", "duration", "measured", "samples", "rest")
        return {name: getattr(self, name) for name in names}

    def check(self, model: Model, crossed: Collection[str] = ()) -> None:
        """Raise unless the region bounds exactly what a run of `model` consists of.

        Runs may start on the surfaces that are `crossed`.
        """
        check_type(model, Model, "model")
        if not model.states:
            raise ValueError(f"model: expected one with states for runs, given {model.name}")
        check_names(self.bounds, names_of(model.axes), "region")
        inputs, states = names_of(model.inputs), names_of(model.states)
        for label, given, known in (
            ("constant", self.constant, (*inputs, "dt")),
            ("levels", self.levels, inputs),
            ("slew", self.slew, inputs),
            ("shared", self.shared, (*states, *(name for name in self.constant))),
        ):
            for name in (name for name in given if name not in known):
                raise ValueError(f"{label}: expected names among {', '.join(known) or 'none'}; given {name!r}")
        if self.rest is not None:
            self.rest.check(model)
        # An input on a surface is for some segments only.
        refuse_fixed_on_surface({name: self.bounds[name] for name in states}, model, crossed)

    def in_units_of(self, model: Model) -> RunRegion:
        """The region with all bounds in the units of a model."""
        check_type(model, Model, "model")
        if not (self.units or self._level_units or self._slew_units):
            return self
        units = {quantity.name: quantity.unit for quantity in model.inputs}
        levels, slew = dict(self.levels), dict(self.slew)
        for name in (name for name in self._level_units if name in units):
            here = f"levels[{shown(name)}]"
            levels[name] = tuple(converted(np.array(levels[name]), self._level_units[name], units[name], here).tolist())
        for name in (name for name in self._slew_units if name in units):
            here = f"slew[{shown(name)}]"
            slew[name] = float(converted(np.array(slew[name]), self._slew_units[name], units[name], here, width=True))
        return RunRegion(
            in_units_of(self.bounds, self.units, model.axes),
            self.segments,
            constant=self.constant,
            shared=self.shared,
            levels=levels,
            slew=slew,
            duration=self.duration,
            measured=self.measured,
            samples=self.samples,
            rest=self.rest,
        )

    def _identity(self) -> tuple[object, ...]:
        held = self.bounds, self.units, self.segments, self.constant, self.shared, self.levels, self.slew
        return (*held, self._level_units, self._slew_units, self.duration, self.measured, self.samples, self.rest)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, RunRegion) and self._identity() == other._identity()

    def __hash__(self) -> int:
        return hash(self._identity())

    def __repr__(self) -> str:
        return f"RunRegion({with_units(self.bounds, self.units)!r}, segments={self.segments})"

    def coordinates(self, model: Model) -> RunCoordinates:
        """The free numbers of a run of `model`."""
        self.check(model, (*model.jumps, *model.kinks))
        return RunCoordinates(self, model)


class RunCoordinates:
    """The free numbers of a run, each between 0 and 1: starts, then inputs by segment, then durations by segment.

    Attributes
    ----------
    names : tuple of str
        What each is of.
    segment : ndarray, (d,)
        From which segment on it has an effect; 0 of starts and of what stays the same over a run.
    shared : ndarray of bool, (d,)
        Whether all runs of a design have it alike.
    stepped : ndarray of int, (d,)
        How many levels it has; 0 for any value.
    """

    def __init__(self, region: RunRegion, model: Model) -> None:
        self._region, self._model, n = region, model, region.segments
        states, inputs = names_of(model.states), names_of(model.inputs)
        self._places: list[tuple[str, str, slice]] = []  # kind, name, and where its numbers are
        names: list[str] = []
        segment: list[int] = []
        stepped: list[int] = []
        for kind, group in (("state", states), ("input", inputs), ("dt", ("dt",))):
            for name in group:
                lower, upper = region.bounds[name]
                levels = len(region.levels.get(name, ()))
                rests = kind == "state" and region.rest is not None and name in region.rest.found(states)
                if lower == upper or levels == 1 or rests:
                    continue
                count = n if kind != "state" and name not in region.constant else 1
                self._places.append((kind, name, slice(len(names), len(names) + count)))
                names += [name] * count
                segment += list(range(count))
                stepped += [levels] * count
        self.names = tuple(names)
        self.segment, self.stepped = np.array(segment, dtype=np.intp), np.array(stepped, dtype=np.intp)
        self.shared: NDArray[np.bool_] = np.array([name in region.shared for name in names], dtype=bool)

    def __len__(self) -> int:
        return len(self.names)

    @cached_property
    def inputs(self) -> list[tuple[str, slice]]:
        """Inputs that may change from segment to segment, and where their numbers are."""
        places = ((name, where) for kind, name, where in self._places if kind == "input")
        return [(name, where) for name, where in places if where.stop - where.start == self._region.segments]

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
        return z

    def runs(self, z: Array) -> Runs:
        """The runs with free numbers z (K, d)."""
        region, model, count = self._region, self._model, len(z)
        shape = (count, region.segments)
        values: dict[str, Array] = {}
        for name, (lower, upper) in region.bounds.items():
            # Of a state that is at rest, the middle of its bounds is the guess; others have one value, or are set below.
            one = region.levels[name][0] if len(region.levels.get(name, ())) == 1 else 0.5 * (lower + upper)
            values[name] = np.full((count, 1), one)
        for _, name, where in self._places:
            values[name] = self._value(name, z[:, where])
        x0 = np.column_stack([values[name] for name in names_of(model.states)])
        u = np.empty((*shape, len(model.inputs)))
        for i, name in enumerate(names_of(model.inputs)):
            u[:, :, i] = self._slewed(name, np.broadcast_to(values[name], shape))
        dt = np.broadcast_to(values["dt"], shape).copy()
        if region.duration is not None:
            dt = _shortened(dt, region.bounds["dt"][0], region.duration)
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


def _levels(given: Any, label: str) -> tuple[float, ...]:
    given, _ = split_unit(given)
    array = as_floats(given, label)
    if array.ndim != 1 or not len(array):
        raise ValueError(f"{label}: expected a sequence of values, at least one, given {shown(given)}")
    return tuple(sorted(set(array.tolist())))


def _within(levels: tuple[float, ...], lower: float, upper: float, label: str) -> tuple[float, ...]:
    """Levels within their bounds; what is beyond them by rounding, as of converted units, is on them."""
    rounding = 1e-12 * max(abs(lower), abs(upper))
    if min(levels) < lower - rounding or max(levels) > upper + rounding:
        raise ValueError(f"{label}: expected values within {lower:g} and {upper:g}, given {shown(list(levels))}")
    return tuple(sorted({min(max(level, lower), upper) for level in levels}))


def _change(given: Any, label: str) -> float:
    number, unit = split_unit(given)
    if unit is not None and len(number) != 1:
        raise ValueError(f"{label}: expected a number, or (number, unit), given {shown(given)}")
    return as_positive(number if unit is None else number[0], label)
