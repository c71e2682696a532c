"""Errors of sensors drawn at random, as simulated rigs have them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..basics.values import Array
from .models import MOST_PARTS
from .sensors import Sensors


def memories(sensors: Sensors, dt: Array, streams: Sequence[np.random.Generator]) -> Array:
    """The parts with a memory (K, N, n_y), at the ends of segments of lengths dt (K, N); they are stationary, and anew in each run.

    Each output has a stream of its own, which gives as many numbers however many parts the output has.
    """
    found = np.zeros((*dt.shape, len(sensors.std)))
    for output, stream in enumerate(streams):
        parts = [part for part in sensors.parts if part[0] == output]
        if not parts:
            continue
        draws = stream.standard_normal((MOST_PARTS, *dt.shape))
        for (_, std, correlation_time), drawn in zip(parts, draws, strict=False):
            kept = np.exp(-dt / correlation_time)
            new = np.sqrt(-np.expm1(-2 * dt / correlation_time)) * drawn
            part = drawn[:, 0]
            found[:, 0, output] += std * part
            for n in range(1, dt.shape[1]):
                part = kept[:, n] * part + new[:, n]
                found[:, n, output] += std * part
    return found


def readings(sensors: Sensors, y: Array, white: Array, memory: Array) -> Array:
    """What sensors show of noise-free outputs (K, N, n_y): with noise, rounded, and then not past the limits.

    Parameters
    ----------
    y : ndarray, (K, N, n_y)
    white : ndarray, (K, N, n_y)
        Standard normal numbers, independent of each other.
    memory : ndarray, (K, N, n_y)
        Of `memories`.
    """
    identity = bool((sensors.correlation == np.eye(len(sensors.std))).all())
    joint = white if identity else white @ np.linalg.cholesky(sensors.correlation).T
    std = np.sqrt(np.square(sensors.std) + np.square(sensors.relative * y)) if sensors.growing else sensors.std
    shown: Array = y + std * joint
    if sensors.parts:
        shown = shown + memory
    for j, q in enumerate(sensors.resolution):
        if q:
            shown[..., j] = np.rint(shown[..., j] / q) * q
    limited = np.isfinite(sensors.lower) | np.isfinite(sensors.upper)
    return np.clip(shown, sensors.lower, sensors.upper) if limited.any() else shown
