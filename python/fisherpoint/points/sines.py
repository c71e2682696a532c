"""Multisines and chirps: profiles of inputs with frequencies, amplitudes and phases.

A signal swings about an offset. Where it would leave the bounds of its input, or change faster than the input may, it is made
smaller as a whole, so that no other frequencies appear.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any

import numpy as np

from ..basics.checks import as_positive, check_choice, check_positive_int
from ..basics.messages import shown
from ..basics.values import Array, IntArray
from .profiles import ActuatorClock, Fact, InputProfile, pair_of, slowing

PER_PERIOD = 4
"""Segments of the shortest period by default."""

TURN = 2 * np.pi


@dataclass(frozen=True)
class _Swings(InputProfile):
    """A signal about an offset; its first number is that."""

    bandwidth: tuple[float, float] | None = None

    def _check_bandwidth(self) -> None:
        if self.bandwidth is not None:
            least, most = pair_of(self.bandwidth, "bandwidth", lambda one: as_positive(one, "bandwidth", "frequency in Hz"))
            object.__setattr__(self, "bandwidth", (least, most))

    def band(self, clock: ActuatorClock) -> tuple[float, float]:
        """The lowest and the highest frequency, Hz."""
        return self.bandwidth or (1 / clock.duration, max(1 / clock.duration, 1 / (PER_PERIOD * clock.dt)))

    def check(self, clock: ActuatorClock) -> None:
        (_, high), most = self.band(clock), 0.5 / clock.dt
        if high > most * (1 + 1e-9):
            raise ValueError(f"bandwidth: expected frequencies up to {most:g} Hz, half of the actuator's, given {high:g}")

    def swing(self, z: Array, clock: ActuatorClock) -> Array:
        """The signal (K, n) about its offset; from -1 to 1 it fits between the offset and the nearer bound."""
        raise NotImplementedError

    def size(self, z: Array, swing: Array, clock: ActuatorClock) -> Array:
        """By how much of the range the signal moves the input, (K, 1), where it is 1."""
        room = np.minimum(z[:, :1], 1 - z[:, :1])
        size = room / np.maximum(1.0, np.abs(swing).max(axis=1, keepdims=True))
        return np.asarray(size * slowing(size * swing, clock))

    def shares(self, z: Array, clock: ActuatorClock) -> Array:
        swing = self.swing(z, clock)
        return np.asarray(np.clip(z[:, :1] + self.size(z, swing, clock) * swing, 0.0, 1.0))

    def offset(self, rng: np.random.Generator, middle: float) -> float:
        """A random offset, mostly where the plant is at rest, or in the middle."""
        return float(rng.choice([middle if 0.1 < middle < 0.9 else 0.5, 0.5, rng.uniform(0.2, 0.8)]))


@dataclass(frozen=True)
class Multisine(_Swings):
    """A sum of harmonics of one frequency, each with an amplitude and a phase.

    Its numbers are the offset, the lowest frequency, and amplitudes and phases.

    Parameters
    ----------
    harmonics : int or sequence of int
        How many, 1, 2, ... times the frequency; or which, such as the odd ones (1, 3, 5).
    bandwidth : (float, float), optional
        Within which all harmonics are, Hz. Default: from one period in a run to four segments for each period.
    crest : float, optional
        The largest crest factor: peak over root mean square of a whole period about its mean. Where amplitudes and phases have a
        larger one, they move towards equal amplitudes with Schroeder's phases.

    Raises
    ------
    TypeError, ValueError
        For harmonics that are none or repeated, frequencies that are not positive or upside down, and a crest factor below that of
        equal amplitudes.
    """

    bandwidth: tuple[float, float] | None = None
    harmonics: int | tuple[int, ...] = 5
    crest: float | None = None

    def __init__(
        self, harmonics: int | Sequence[int] = 5, *, bandwidth: Sequence[float] | None = None, crest: float | None = None
    ) -> None:
        for name, value in (("harmonics", _harmonics(harmonics)), ("bandwidth", bandwidth), ("crest", crest)):
            object.__setattr__(self, name, value)
        self._check_bandwidth()
        if crest is not None:
            object.__setattr__(self, "crest", as_positive(crest, "crest", "crest factor"))
            least = float(self._crest(np.ones((1, len(self.orders))), _schroeder(len(self.orders))[None])[0])
            if self.crest is not None and self.crest < least * (1 + 1e-6):
                raise ValueError(f"crest: expected at least {least:.3g}, that of equal amplitudes, given {self.crest:g}")

    @property
    def orders(self) -> IntArray:
        """Which harmonics there are, (m,)."""
        return np.array(range(1, self.harmonics + 1) if isinstance(self.harmonics, int) else self.harmonics, dtype=np.int32)

    def _fundamental(self, clock: ActuatorClock) -> tuple[float, float]:
        low, high = self.band(clock)
        return low / self.orders.min(), high / self.orders.max()

    def check(self, clock: ActuatorClock) -> None:
        super().check(clock)
        low, high = self._fundamental(clock)
        if low > high * (1 + 1e-9):
            (least, most), first, last = self.band(clock), self.orders.min(), self.orders.max()
            raise ValueError(f"bandwidth: expected room for harmonics {first} to {last}, given {least:g} to {most:g} Hz")

    def numbers(self, clock: ActuatorClock) -> tuple[int, ...]:
        return (0,) * (2 + 2 * len(self.orders))

    def _frequency(self, z: Array, clock: ActuatorClock) -> Array:
        low, high = self._fundamental(clock)
        return np.asarray(low * (max(high, low) / low) ** z[:, 1])

    def _parts(self, z: Array) -> tuple[Array, Array]:
        """Amplitudes and phases (K, m), such that the crest factor is small enough."""
        m = len(self.orders)
        amplitudes, phases = z[:, 2 : 2 + m], TURN * turns_of(z[:, 2 + m :])
        if self.crest is None:
            return amplitudes, phases
        amplitudes, phases = amplitudes.copy(), phases.copy()
        high = np.flatnonzero(self._crest(amplitudes, phases) > self.crest)
        if len(high):
            size = amplitudes[high].max(axis=1, keepdims=True)
            moves = size - amplitudes[high], np.remainder(_schroeder(m) - phases[high] + np.pi, TURN) - np.pi
            least, most = np.zeros((len(high), 1)), np.ones((len(high), 1))
            for _ in range(30):  # the share of the way that is needed
                way = 0.5 * (least + most)
                enough = (self._crest(amplitudes[high] + way * moves[0], phases[high] + way * moves[1]) <= self.crest)[:, None]
                least, most = np.where(enough, least, way), np.where(enough, way, most)
            amplitudes[high] += most * moves[0]
            phases[high] += most * moves[1]
        return amplitudes, phases

    def _crest(self, amplitudes: Array, phases: Array) -> Array:
        """Crest factors (K,) of a whole period; 0 where there is no signal."""
        turns = np.arange(32 * int(self.orders.max())) / (32 * self.orders.max())
        x = (amplitudes[:, :, None] * np.cos(TURN * self.orders[:, None] * turns + phases[:, :, None])).sum(axis=1)
        mean_square = np.square(x).mean(axis=1)
        return np.asarray(np.abs(x).max(axis=1) / np.sqrt(np.where(mean_square > 1e-24, mean_square, np.inf)))

    def swing(self, z: Array, clock: ActuatorClock) -> Array:
        amplitudes, phases = self._parts(z)
        turns = (self._frequency(z, clock)[:, None] * self.orders)[:, :, None] * clock.t
        return np.asarray((amplitudes[:, :, None] * np.cos(TURN * turns + phases[:, :, None])).sum(axis=1))

    def drawn(self, rng: np.random.Generator, clock: ActuatorClock, middle: float) -> Array:
        m = len(self.orders)
        amplitudes = (np.ones(m), self.orders.min() / self.orders, rng.random(m))[int(rng.integers(3))]
        phases = _schroeder(m) / TURN % 1.0 if rng.random() < 0.25 else rng.random(m)
        size = rng.choice([1.0, rng.uniform(0.3, 1.0)])
        return np.concatenate([[self.offset(rng, middle), rng.random()], size * amplitudes, 0.25 + phases / 2])

    def still(self, share: float, clock: ActuatorClock) -> Array:
        m = len(self.orders)
        return np.concatenate([[share, 0.5], np.zeros(m), np.full(m, 0.5)])

    def facts(self, z: Array, clock: ActuatorClock) -> list[Fact]:
        z = z[None]
        size, (amplitudes, phases) = float(self.size(z, self.swing(z, clock), clock)[0, 0]), self._parts(z)
        found = [Fact("offset", float(z[0, 0]), "level")]
        for order, amplitude, phase in zip(self.orders.tolist(), amplitudes[0].tolist(), phases[0].tolist(), strict=True):
            found += [
                Fact(f"harmonic {order}: frequency", order * float(self._frequency(z, clock)[0]), "Hz"),
                Fact(f"harmonic {order}: amplitude", size * amplitude, "size"),
                Fact(f"harmonic {order}: phase", float(np.degrees(phase) % 360.0), "deg"),
            ]
        return found


@dataclass(frozen=True)
class Chirp(_Swings):
    """A sine whose frequency moves from one value to another during a run, upwards or downwards.

    Its numbers are the offset, both frequencies, the amplitude and the phase.

    Parameters
    ----------
    bandwidth : (float, float), optional
        Within which both frequencies are, Hz. Default: from one period in a run to four segments for each period.
    sweep : {"linear", "logarithmic"}
        How the frequency moves.

    Raises
    ------
    TypeError, ValueError
        For frequencies that are not positive or upside down, and another sweep.
    """

    _: KW_ONLY
    sweep: str = "linear"

    def __post_init__(self) -> None:
        self._check_bandwidth()
        check_choice(self.sweep, ("linear", "logarithmic"), "sweep")

    def numbers(self, clock: ActuatorClock) -> tuple[int, ...]:
        return (0,) * 5

    def _frequencies(self, z: Array, clock: ActuatorClock) -> Array:
        low, high = self.band(clock)
        return np.asarray(low * (high / low) ** z[:, 1:3])

    def swing(self, z: Array, clock: ActuatorClock) -> Array:
        first, last = self._frequencies(z, clock)[:, :, None].swapaxes(0, 1)
        share = clock.t / clock.duration
        if self.sweep == "linear":
            turns = first * share + (last - first) * share**2 / 2
        else:
            rate = np.log(last / first)
            turns = first * share * _mean_growth(rate * share)
        return np.asarray(z[:, 3:4] * np.sin(TURN * (clock.duration * turns + turns_of(z[:, 4:5]))))

    def drawn(self, rng: np.random.Generator, clock: ActuatorClock, middle: float) -> Array:
        return np.array(
            [self.offset(rng, middle), *rng.random(2), rng.choice([1.0, rng.uniform(0.3, 1.0)]), rng.uniform(0.25, 0.75)]
        )

    def still(self, share: float, clock: ActuatorClock) -> Array:
        return np.array([share, 0.5, 0.5, 0.0, 0.5])

    def facts(self, z: Array, clock: ActuatorClock) -> list[Fact]:
        z = z[None]
        size = float(self.size(z, self.swing(z, clock), clock)[0, 0])
        first, last = self._frequencies(z, clock)[0].tolist()
        return [
            Fact("offset", float(z[0, 0]), "level"),
            Fact("first frequency", first, "Hz"),
            Fact("last frequency", last, "Hz"),
            Fact("amplitude", size * float(z[0, 3]), "size"),
            Fact("phase", 360.0 * float(turns_of(z[0, 4]) % 1.0), "deg"),
        ]


def turns_of(z: Array) -> Array:
    """Phases of numbers between 0 and 1, in turns: two of them, so that an ascent can go on from either end of the usual one."""
    return np.asarray(2 * z - 1)


def _mean_growth(exponent: Array) -> Array:
    """(exp(x) - 1)/x, also at zero."""
    small = np.abs(exponent) < 1e-8
    return np.where(small, 1.0 + exponent / 2, np.expm1(exponent) / np.where(small, 1.0, exponent))


def _schroeder(m: int) -> Array:
    """Phases (m,) at which equal amplitudes have a small crest factor (Schroeder 1970)."""
    k = np.arange(1, m + 1)
    return np.asarray(-np.pi * k * (k - 1) / m)


def _harmonics(given: Any) -> int | tuple[int, ...]:
    if not isinstance(given, tuple | list | range):
        return check_positive_int(given, "harmonics", most=1000)
    orders = tuple(check_positive_int(one, "harmonics", most=1000) for one in given)
    if not orders or len(set(orders)) < len(orders):
        raise ValueError(f"harmonics: expected different numbers, at least one, given {shown(given)}")
    return orders
