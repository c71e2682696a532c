"""Runs to begin a search with: profiles of inputs as they are used for identification, with random settings.

A search from random numbers for every segment hardly finds what good runs look like. Profiles are held for a while, and often go
from one bound to the other: steps, pulses, binary sequences, ramps and sines, for each input by itself.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ...basics.values import Array
from ...points.run_region import RunCoordinates

AT_BOUND = 0.5
"""Share of starts and levels that lie on a bound, where optima mostly are."""

MOST_PULSES = 4


Profile = Callable[[np.random.Generator, int], Array]
"""Numbers (n,) between 0 and 1 of one input, drawn by a generator."""


def draw_runs(
    coordinates: RunCoordinates, count: int, rng: np.random.Generator, profiles: Sequence[Profile] | None = None
) -> Array:
    """Free numbers (count, d) of random runs, with `PROFILES` or those that are given."""
    profiles = PROFILES if profiles is None else profiles
    z = _levels(rng, (count, len(coordinates)))
    changing = coordinates.inputs
    durations = [j for j, name in enumerate(coordinates.names) if name == "dt"]
    for k in range(count):
        for _, where in changing:
            profile = profiles[int(rng.integers(len(profiles)))]
            z[k, where] = profile(rng, where.stop - where.start)
        if len(durations) > 1 and rng.random() < 0.5:  # segments of one length
            z[k, durations] = rng.random()
        else:
            z[k, durations] = rng.random(len(durations))
    return z


def _levels(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Random numbers between 0 and 1, many of them 0 or 1."""
    return np.where(rng.random(shape) < AT_BOUND, rng.integers(0, 2, shape).astype(float), rng.random(shape))


def constant(rng: np.random.Generator, n: int) -> Array:
    return np.full(n, _levels(rng, (1,)))


def step(rng: np.random.Generator, n: int) -> Array:
    before, behind = _levels(rng, (2,))
    return np.asarray(np.where(np.arange(n) < rng.integers(1, n + 1), before, behind))


def pulses(rng: np.random.Generator, n: int) -> Array:
    """One pulse or some, up or down, from a level that stays."""
    values = constant(rng, n)
    for _ in range(rng.integers(1, MOST_PULSES)):
        first = rng.integers(n)
        length = int(np.ceil(n ** rng.random()))
        values[first : first + length] = _levels(rng, (1,))
    return values


def binary(rng: np.random.Generator, n: int) -> Array:
    """A random binary sequence of two levels, each of which is held for a number of segments or more."""
    low, high = np.sort(_levels(rng, (2,)))
    hold = int(np.ceil(n ** (0.7 * rng.random())))
    bits = np.repeat(rng.integers(0, 2, n // hold + 1), hold)[:n]
    return np.asarray(np.where(np.roll(bits, rng.integers(hold)) > 0, high, low))


def ramp(rng: np.random.Generator, n: int) -> Array:
    first, last = _levels(rng, (2,))
    return np.linspace(first, last, n)


def sine(rng: np.random.Generator, n: int) -> Array:
    """A sine, or one whose frequency rises."""
    low, high = np.sort(_levels(rng, (2,)))
    s = np.arange(n) / max(n - 1, 1)
    turns = (n / 2) ** rng.random()
    rise = rng.choice([0.0, 1.0])
    return np.asarray(low + (high - low) * 0.5 * (1 + np.sin(2 * np.pi * (turns * s ** (1 + rise) + rng.random()))))


def noise(rng: np.random.Generator, n: int) -> Array:
    """Random levels, each held for a number of segments."""
    hold = int(np.ceil(n ** (0.7 * rng.random())))
    return np.asarray(np.repeat(_levels(rng, (n // hold + 1,)), hold)[:n])


PROFILES: tuple[Profile, ...] = (
    constant,
    step,
    pulses,
    pulses,
    binary,
    binary,
    ramp,
    sine,
    noise,
)

CLASSICAL: Mapping[str, Profile] = {
    "steps": step,
    "pulses": pulses,
    "binary sequences": binary,
    "ramps": ramp,
    "sines and chirps": sine,
}
"""What rigs are identified with by hand."""
