"""Runs to begin a search with: profiles of inputs as they are used for identification, with random settings.

A search from random numbers for every segment hardly finds what good runs look like. Profiles are held for a while, and often go
from one bound to the other: steps, pulses, binary sequences, ramps and sines, for each input by itself. Some return: what they do
on one side of the input at rest they undo on the other, as a carriage on a short stroke has to.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ...basics.values import Array
from ...points.run_coordinates import RunCoordinates

AT_BOUND = 0.5
"""Share of starts and levels that lie on a bound, where optima mostly are."""

MOST_PULSES = 4

OFF_BOUND = 0.1
"""How far the input at rest has to be from its bounds for profiles that return to it; others return to the middle."""


Profile = Callable[[np.random.Generator, int], Array]
"""Numbers (n,) between 0 and 1 of one input, drawn by a generator."""


def draw_runs(
    coordinates: RunCoordinates, count: int, rng: np.random.Generator, profiles: Sequence[Profile] | None = None
) -> Array:
    """Free numbers (count, d) of random runs, with `PROFILES` or those that are given."""
    profiles = PROFILES if profiles is None else profiles
    z = _levels(rng, (count, len(coordinates)))
    changing, quiet = coordinates.inputs, coordinates.quiet
    durations = [j for j, name in enumerate(coordinates.names) if name == "dt"]
    for k in range(count):
        for _, where in changing:
            profile = profiles[int(rng.integers(len(profiles)))]
            values = profile(rng, where.stop - where.start)
            if profile in RETURNING and OFF_BOUND < (middle := quiet[where.start]) < 1 - OFF_BOUND:
                values = middle + (values - 0.5) * (2 * min(middle, 1 - middle))
            z[k, where] = values
        for one in coordinates.signals:
            z[k, one.where] = one.profile.drawn(rng, one.clock, float(quiet[one.where.start]))
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


def doublet(rng: np.random.Generator, n: int) -> Array:
    """Pulses to both sides of the middle, of the same size and length: one after the other, or as +, -, -, +."""
    values, turns = np.full(n, 0.5), [1, -1] if rng.random() < 0.5 else [1, -1, -1, 1]
    length = max(1, int((n / len(turns)) ** rng.random()))
    first, size = int(rng.integers(max(1, n - length * len(turns) + 1))), rng.choice([-0.5, 0.5]) * rng.choice([1.0, rng.random()])
    for k, sign in enumerate(turns):
        values[first + k * length : first + (k + 1) * length] += sign * size
    return values


def antisymmetric(rng: np.random.Generator, n: int) -> Array:
    """A binary sequence, a sine or pulses, and then the same to the other side of the middle; or that turned round."""
    half = (binary, sine, pulses)[int(rng.integers(3))](rng, (n + 1) // 2)
    other = 1.0 - (half if rng.random() < 0.5 else half[::-1])
    return np.concatenate([half, other])[:n]


def balanced(rng: np.random.Generator, n: int) -> Array:
    """A binary sequence, a sine or noise whose mean is the middle."""
    values = (binary, sine, noise)[int(rng.integers(3))](rng, n)
    off = values - values.mean()
    return np.asarray(0.5 + off * (0.5 / max(float(np.abs(off).max()), 0.5)))


RETURNING: tuple[Profile, ...] = (doublet, antisymmetric, balanced)

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
    *RETURNING,
)

CLASSICAL: Mapping[str, Profile] = {
    "steps": step,
    "pulses": pulses,
    "binary sequences": binary,
    "ramps": ramp,
    "sines and chirps": sine,
}
"""Classical profiles of inputs for identification."""
