"""Profiles of inputs: held values on the actuator's clock that follow from a few numbers.

A profile maps numbers between 0 and 1 to values of an input at the starts of all segments, as shares of its range. Most maps are
smooth, or linear, so that gradients go through them. Where an input may change by so much only from one segment to the next, the
whole signal is drawn together about its middle, so that it stays what it is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass
from functools import lru_cache
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..basics.checks import as_floats, check_positive_int
from ..basics.messages import shown
from ..basics.values import Array, IntArray


class ActuatorClock(NamedTuple):
    """The n instants, dt apart, in s, at which an input may change, and by which share of its range, `slew`."""

    n: int
    dt: float
    slew: float = np.inf

    @property
    def t(self) -> Array:
        return np.asarray(self.dt * np.arange(self.n))

    @property
    def duration(self) -> float:
        return self.n * self.dt


class Fact(NamedTuple):
    """A number of a profile for its reader: a "level" or a "size" as a share of the input's range, or a value in a unit."""

    name: str
    value: float
    unit: str


@dataclass(frozen=True)
class InputProfile:
    """How the values of an input follow from numbers."""

    in_order: ClassVar[bool] = False
    """Whether the numbers are values over the time of a run, one after the other, as those of all segments are."""

    def check(self, clock: ActuatorClock) -> None:
        """Raise ValueError where the clock has no room for it."""

    def numbers(self, clock: ActuatorClock) -> tuple[int, ...]:
        """The number of levels of each number; 0 for any value."""
        raise NotImplementedError

    def shares(self, z: Array, clock: ActuatorClock) -> Array:
        """Values (K, n) of numbers (K, d), both between 0 and 1."""
        raise NotImplementedError

    def drawn(self, rng: np.random.Generator, clock: ActuatorClock, middle: float) -> Array:
        """Random numbers (d,); `middle` is the share at which the plant is at rest."""
        return rng.random(len(self.numbers(clock)))

    def still(self, share: float, clock: ActuatorClock) -> Array:
        """Numbers (d,) at which the input stays about at a share of its range."""
        return np.full(len(self.numbers(clock)), share)

    def facts(self, z: Array, clock: ActuatorClock) -> list[Fact]:
        """The numbers (d,) in words and units."""
        raise NotImplementedError


@dataclass(frozen=True)
class Held(InputProfile):
    """Any value in every segment, the default."""

    def numbers(self, clock: ActuatorClock) -> tuple[int, ...]:
        return (0,) * clock.n

    def shares(self, z: Array, clock: ActuatorClock) -> Array:
        return slowed(z, clock)

    def facts(self, z: Array, clock: ActuatorClock) -> list[Fact]:
        return []


@dataclass(frozen=True)
class Given(InputProfile):
    """Values that are not designed, such as a load cycle or the temperature around; the region has no bounds of such an input.

    Parameters
    ----------
    values : array_like, (N,) or (T,)
        SI units. One for each segment, or at times.
    t : array_like, (T,), optional
        Times from the start of a run, s. An input is held in each segment at what lies on lines between the values at its start.

    Raises
    ------
    ValueError
        For values that are not finite, and times that do not increase or are not as many.
    """

    values: tuple[float, ...]
    t: tuple[float, ...] | None = None

    def __init__(self, values: ArrayLike, *, t: ArrayLike | None = None) -> None:
        of = as_floats(values, "values")
        times = None if t is None else as_floats(t, "t")
        if of.ndim != 1 or not len(of):
            raise ValueError(f"values: expected one for each segment, or at times, given {shown(values)}")
        if times is not None and (times.shape != of.shape or (np.diff(times) <= 0).any()):
            raise ValueError(f"t: expected increasing times, as many as values, given {shown(t)}")
        object.__setattr__(self, "values", tuple(of.tolist()))
        object.__setattr__(self, "t", None if times is None else tuple(times.tolist()))

    def check_time(self, segments: int, last: float) -> None:
        """Raise where there are values for other segments, or for less than all of the time."""
        if self.t is None and len(self.values) != segments:
            raise ValueError(f"values: expected one for each of {segments} segments, given {len(self.values)}")
        if self.t is not None and (self.t[0] > 0 or self.t[-1] < last * (1 - 1e-9)):
            raise ValueError(
                f"t: expected times from 0 to the start of the last segment, {last:g}, given {self.t[0]:g} to {self.t[-1]:g}"
            )

    def held(self, dt: Array) -> Array:
        """The values in segments with durations dt (K, N)."""
        if self.t is None:
            return np.broadcast_to(np.array(self.values), dt.shape)
        return np.asarray(np.interp(np.cumsum(dt, axis=1) - dt, self.t, self.values))

    def numbers(self, clock: ActuatorClock) -> tuple[int, ...]:
        return ()


@dataclass(frozen=True)
class _Knots(InputProfile):
    knots: int

    LEAST: ClassVar[int] = 2
    in_order: ClassVar[bool] = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "knots", check_positive_int(self.knots, "knots", least=self.LEAST))

    def check(self, clock: ActuatorClock) -> None:
        if self.knots > clock.n:
            raise ValueError(f"knots: expected at most as many as segments, {clock.n}, given {self.knots}")

    def numbers(self, clock: ActuatorClock) -> tuple[int, ...]:
        return (0,) * self.knots

    def weights(self, clock: ActuatorClock) -> Array:
        """By how much each knot counts at each instant, (n, knots)."""
        raise NotImplementedError

    def shares(self, z: Array, clock: ActuatorClock) -> Array:
        return slowed(np.clip(z @ self.weights(clock).T, 0.0, 1.0), clock)


@dataclass(frozen=True)
class Ramps(_Knots):
    """Lines between knots, which are equally far apart: a first-order hold on the actuator's clock.

    Parameters
    ----------
    knots : int
        Number of knots, from the first segment to the last; each is a free number of a run.

    Raises
    ------
    TypeError, ValueError
        For fewer than two knots.
    """

    def weights(self, clock: ActuatorClock) -> Array:
        places = np.linspace(0.0, self.knots - 1.0, clock.n)
        return np.maximum(0.0, 1.0 - np.abs(places[:, None] - np.arange(self.knots)))

    def facts(self, z: Array, clock: ActuatorClock) -> list[Fact]:
        t = np.linspace(0.0, float(clock.t[-1]), self.knots)
        values = np.interp(t, clock.t, self.shares(z[None], clock)[0])
        return [Fact(f"at {time:.4g} s", float(value), "level") for time, value in zip(t, values, strict=True)]


@dataclass(frozen=True)
class Spline(_Knots):
    """A smooth curve with continuous curvature: a cubic B-spline, which stays between the smallest and the largest of its numbers.

    Parameters
    ----------
    knots : int
        Number of coefficients, each a free number of a run, equally far apart but for the ends.

    Raises
    ------
    TypeError, ValueError
        For fewer than four.
    """

    LEAST: ClassVar[int] = 4

    def weights(self, clock: ActuatorClock) -> Array:
        return _b_spline(self.knots, clock.n)

    def facts(self, z: Array, clock: ActuatorClock) -> list[Fact]:
        return [Fact(f"coefficient {k + 1}", float(value), "level") for k, value in enumerate(z)]


@lru_cache(maxsize=16)
def _b_spline(knots: int, n: int) -> Array:
    from scipy.interpolate import BSpline

    inner = np.linspace(0.0, 1.0, knots - 2)
    places = np.concatenate([np.zeros(3), inner, np.ones(3)])
    return np.asarray(BSpline.design_matrix(np.linspace(0.0, 1.0, n), places, 3).toarray())


@dataclass(frozen=True)
class PRBS(InputProfile):
    """A pseudorandom binary sequence of greatest length, between two levels.

    Its numbers are both levels, for how many segments a bit is held, and where in the sequence the run begins.

    Parameters
    ----------
    order : int
        Length of the shift register: the sequence has 2^order - 1 bits.
    hold : tuple of int, optional
        The fewest and the most segments for which a bit is held. Default: from one to a tenth of them.

    Raises
    ------
    TypeError, ValueError
        For an order outside 2 to 15, and segments that are none or upside down.
    """

    order: int = 7
    _: KW_ONLY
    hold: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "order", check_positive_int(self.order, "order", least=2, most=15))
        if self.hold is not None:
            least, most = pair_of(self.hold, "hold", lambda one: check_positive_int(one, "hold"))
            object.__setattr__(self, "hold", (least, most))

    def _holds(self, clock: ActuatorClock) -> IntArray:
        least, most = self.hold or (1, max(1, clock.n // 10))
        return np.unique(np.rint(np.geomspace(least, most, min(most - least + 1, 12))).astype(np.int32))

    def check(self, clock: ActuatorClock) -> None:
        if self.hold is not None and self.hold[1] > clock.n:
            raise ValueError(f"hold: expected at most as many segments as a run has, {clock.n}, given {self.hold[1]}")

    def numbers(self, clock: ActuatorClock) -> tuple[int, ...]:
        return 0, 0, len(self._holds(clock)), 2**self.order - 1

    def shares(self, z: Array, clock: ActuatorClock) -> Array:
        holds = self._holds(clock)[level_of(z[:, 2], self.numbers(clock)[2])]
        first = level_of(z[:, 3], self.numbers(clock)[3])
        place = (np.arange(clock.n) // holds[:, None] + first[:, None]) % (2**self.order - 1)
        bits = _bits(self.order)[place]
        return slowed(np.where(bits, z[:, 1:2], z[:, :1]), clock)

    def drawn(self, rng: np.random.Generator, clock: ActuatorClock, middle: float) -> Array:
        z = rng.random(4)
        if rng.random() < 0.7:
            size = rng.choice([1.0, rng.random()]) * min(middle, 1 - middle)
            z[:2] = middle - size, middle + size
        return z

    def still(self, share: float, clock: ActuatorClock) -> Array:
        return np.array([share, share, 0.0, 0.0])

    def facts(self, z: Array, clock: ActuatorClock) -> list[Fact]:
        levels = self.numbers(clock)
        bits = self.shares(z[None], clock)[0]
        hold = int(self._holds(clock)[level_of(z[2], levels[2])])
        return [
            Fact("lowest level", float(bits.min()), "level"),
            Fact("highest level", float(bits.max()), "level"),
            Fact("time of a bit", hold * clock.dt, "s"),
            Fact("first bit of the sequence", float(level_of(z[3], levels[3])), ""),
        ]


@lru_cache(maxsize=16)
def _bits(order: int) -> NDArray[np.bool_]:
    from scipy.signal import max_len_seq

    return np.asarray(max_len_seq(order)[0], dtype=bool)


def level_of(z: ArrayLike, levels: int) -> IntArray:
    """Which of so many levels numbers between 0 and 1 stand for."""
    return np.asarray(np.clip((np.asarray(z) * levels).astype(np.int32), 0, levels - 1))


def slowed(values: Array, clock: ActuatorClock) -> Array:
    """Values (K, n) drawn together about their mean, so far as they may change by so much only from one to the next."""
    middle = values.mean(axis=1, keepdims=True)
    return np.asarray(middle + slowing(values, clock) * (values - middle))


def slowing(values: Array, clock: ActuatorClock) -> Array:
    """The share (K, 1) of signals (K, n) that is left so that they change by so much only."""
    fastest = np.abs(np.diff(values, axis=1)).max(axis=1, initial=0.0, keepdims=True)
    return np.asarray(np.minimum(1.0, clock.slew / np.maximum(fastest, 1e-300)))


def pair_of(given: object, name: str, check: Callable[[object], int] | Callable[[object], float]) -> tuple[float, float]:
    """Two numbers in order."""
    if not isinstance(given, tuple | list) or len(given) != 2:
        raise TypeError(f"{name}: expected a pair (least, most), given {shown(given)}")
    least, most = (check(one) for one in given)
    if most < least:
        raise ValueError(f"{name}: expected the least first, given {least:g} and {most:g}")
    return least, most
