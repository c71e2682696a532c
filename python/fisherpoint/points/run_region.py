"""What may vary in runs: starts, inputs and durations of segments, and which of their ends are measured."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from ..basics.checks import (
    as_floats,
    as_positive,
    by_name,
    check_known,
    check_mapping,
    check_names,
    check_positive_int,
    check_type,
    names_among,
)
from ..basics.messages import shown
from ..basics.quantity import names_of
from ..basics.units import converted
from ..basics.values import FrozenMapping
from ..models import Model
from .bounds import in_units_of, pair_or_number, read_bounds, split_unit, units_in, with_units
from .profile_kinds import PROFILES
from .profiles import ActuatorClock, Given, Held, InputProfile
from .region import refuse_fixed_on_surface
from .rest import Rest
from .run_checks import as_flags
from .sample_clock import Every, SampleClock, as_every

MOST_SEGMENTS = 10_000

_OPTIONS = ("constant", "shared", "levels", "slew", "duration", "measured", "samples", "rest", "sample_every", "profile")


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
    sample_every : float, (float, unit), text such as "1 ms", or (S,), or a mapping of output to these, optional
        The period at which all outputs are measured instead, s: at all of its multiples up to the end of a run, whatever the
        segments are. Or a table of instants from the start, s, which may end with a unit; those behind the end of a shorter run are
        left out. Of a mapping each output has its own; outputs that it does not name are not measured.
    profile : InputProfile, or mapping of input to InputProfile, optional
        How the values of all inputs, or of some, follow from a few numbers: `Ramps`, `Spline`, `Multisine`, `Chirp` or `PRBS`;
        `Held` is the default, a number for each segment. The bounds of ``"dt"`` must be one value then, the actuator's clock.
        Inputs that are `Given` are not designed, and have no bounds.

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
        sample_every: Any = None,
        profile: InputProfile | Mapping[str, InputProfile] | None = None,
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
        values: Mapping[str, tuple[float, ...]] = by_name(levels, names, "levels", _levels)
        self._level_units, self._slew_units = units_in(levels, "levels"), units_in(slew, "slew")
        # Those with a unit are compared when both are in the model's.
        known = {name: of for name, of in values.items() if not (name in self.units or name in self._level_units)}
        within = {name: _within(of, *self.bounds[name], f"levels[{name!r}]") for name, of in known.items()}
        self.levels: Mapping[str, tuple[float, ...]] = FrozenMapping({**values, **within})
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
        self.sample_every: Every | None = None if sample_every is None else self._every(sample_every)
        self.profile = self._profiles(profile, names)

    def _every(self, given: Any) -> Every:
        for name, beside in (("measured", not all(self.measured)), ("samples", self.samples is not None)):
            if beside:
                raise ValueError(f"{name}: expected none beside sample_every, which measures at instants of its own, given some")
        return as_every(given, "sample_every", self.segments * self.bounds["dt"][0], self.longest)

    def _profiles(self, given: Any, names: tuple[str, ...]) -> InputProfile | Mapping[str, InputProfile] | None:
        """Profiles that are not `Held`, each of which has room on the clock."""
        if given is None or isinstance(given, Held):
            return None
        if not isinstance(given, Mapping):
            if isinstance(given, Given):
                raise ValueError("profile: expected a mapping of input to what is given, given it for all inputs")
            return self._profile(given, "profile")
        profiles: Mapping[str, InputProfile] = by_name(given, None, "profile", self._profile)
        for name, profile in profiles.items():
            if isinstance(profile, Given) == (name in names):
                expected = (
                    "no bounds in the region of an input that is given"
                    if name in names
                    else "bounds in the region, or Given values"
                )
                raise ValueError(f"profile[{name!r}]: expected {expected}, given {'some' if name in names else 'none'}")
            for label, others in (("constant", self.constant), ("levels", self.levels)):
                if profile != Held() and name in others:
                    raise ValueError(f"{label}: expected no input with a profile, given {name!r}")
        return FrozenMapping({name: profile for name, profile in profiles.items() if profile != Held()}) or None

    def _profile(self, profile: Any, label: str) -> InputProfile:
        if not isinstance(profile, InputProfile):
            kinds = ", ".join(kind.__name__ for kind in PROFILES.values())
            raise TypeError(f"{label}: expected one of {kinds}, given {type(profile).__name__}")
        lower, upper = self.bounds["dt"]
        try:
            if isinstance(profile, Given):
                profile.check_time(self.segments, self.longest - lower)
            elif profile != Held():
                profile.check(ActuatorClock(self.segments, lower))
        except ValueError as error:
            raise ValueError(f"{label}.{error}") from error
        if lower < upper and not isinstance(profile, Given | Held):
            raise ValueError(f"{label}: expected one value of region['dt'], the actuator's clock, given {lower:g} to {upper:g}")
        return profile

    @property
    def given(self) -> Mapping[str, Given]:
        """Inputs that are not designed, and their values."""
        profiles = self.profile if isinstance(self.profile, Mapping) else {}
        return {name: profile for name, profile in profiles.items() if isinstance(profile, Given)}

    def profile_of(self, name: str) -> InputProfile | None:
        """The profile of an input; None where any values are held."""
        if self.profile is None or name in self.constant or name in self.levels:
            return None
        return self.profile.get(name) if isinstance(self.profile, Mapping) else self.profile

    def clock(self, model: Model) -> SampleClock | None:
        """When outputs of a model are measured, up to the end of the longest run; None where the ends of segments are."""
        return None if self.sample_every is None else SampleClock.of(self.sample_every, self.longest, names_of(model.outputs))

    def sampling(self, every: Every) -> RunRegion:
        """Return this region with other periods, s, or tables of samples."""
        return RunRegion(**self._arguments() | {"sample_every": every})

    @property
    def longest(self) -> float:
        """The longest that a run may last, s."""
        most = self.segments * self.bounds["dt"][1]
        return most if self.duration is None else min(most, self.duration)

    def _arguments(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in ("bounds", "segments", *_OPTIONS)}

    def check(self, model: Model, crossed: Collection[str] = ()) -> None:
        """Raise unless the region bounds exactly what a run of `model` consists of.

        Runs may start on the surfaces that are `crossed`.
        """
        check_type(model, Model, "model")
        if not model.states:
            raise ValueError(f"model: expected one with states for runs, given {model.name}")
        inputs, states = names_of(model.inputs), names_of(model.states)
        check_known(self.given, inputs, "profile")
        if isinstance(self.sample_every, Mapping):
            check_known(self.sample_every, names_of(model.outputs), "sample_every", "names of outputs,")
        check_names(self.bounds, [name for name in names_of(model.axes) if name not in self.given], "region")
        for label, given, known in (
            ("constant", self.constant, (*inputs, "dt")),
            ("levels", self.levels, inputs),
            ("profile", self.profile if isinstance(self.profile, Mapping) else (), inputs),
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
            **{name: getattr(self, name) for name in _OPTIONS} | {"levels": levels, "slew": slew},
        )

    def _identity(self) -> tuple[object, ...]:
        return self.units, self._level_units, self._slew_units, *self._arguments().values()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, RunRegion) and self._identity() == other._identity()

    def __hash__(self) -> int:
        return hash(self._identity())

    def __repr__(self) -> str:
        every = self.sample_every
        often = "" if every is None else f", sample_every={dict(every) if isinstance(every, Mapping) else every!r}"
        profile = "" if self.profile is None else f", profile={self.profile!r}"
        return f"RunRegion({with_units(self.bounds, self.units)!r}, segments={self.segments}{often}{profile})"


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
