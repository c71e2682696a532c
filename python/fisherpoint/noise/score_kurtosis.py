"""The fourth moment of score residuals: by it their squares scatter, which decides whether a chi-square is too large."""

from __future__ import annotations

import numpy as np

from ..basics.values import Array
from .reading import SPACING, SPAN, normal_cdf, rounded_limits
from .sensors import Sensors

NODES = 80
"""Nodes of the quadrature over readings that are not rounded."""

LARGEST = 1e6
"""Fourth moment that counts for more than any: such readings inform about nothing, and a chi-square that has one about little."""


def score_kurtosis(y: Array, sensors: Sensors, output: int) -> Array:
    """E s^4 of the score residuals s of readings at noise-free outputs y (N,); 3 of normal readings."""
    std, relative, q = (float(of[output]) for of in (sensors.std, sensors.relative, sensors.resolution))
    lower, upper = float(sensors.lower[output]), float(sensors.upper[output])
    limited = np.isfinite(lower) or np.isfinite(upper)
    if not (relative or q or limited):
        return np.full(len(y), 3.0)
    sigma = np.sqrt(std**2 + np.square(relative * y))[:, None]
    slope = relative**2 * y[:, None] / sigma
    if q and limited:
        lower, upper = rounded_limits(q, lower, upper)
    if q >= SPACING * float(sigma.min()):
        count = int(np.ceil(SPAN * float(sigma.max()) / q)) + 1
        centers = (np.rint(y / q)[:, None] + np.arange(-count, count + 1)) * q
        edges = np.clip(np.concatenate([centers - q / 2, centers[:, -1:] + q / 2], axis=1), lower, upper)
    else:
        steps = np.linspace(-SPAN, SPAN, NODES + 1)
        edges = np.clip(y[:, None] + np.sqrt(np.square(sigma) + q**2 / 12) * steps, lower, upper)
    edges = np.concatenate([np.full((len(y), 1), -np.inf), edges, np.full((len(y), 1), np.inf)], axis=1)
    z = (edges - y[:, None]) / sigma
    probability = np.diff(normal_cdf(z), axis=1)
    finite = np.where(np.isfinite(z), z, 0.0)
    change = np.where(np.isfinite(z), np.exp(-np.square(finite) / 2) / np.sqrt(2 * np.pi) * (1 + finite * slope), 0.0)
    score = np.divide(np.diff(change, axis=1), probability, out=np.zeros(probability.shape), where=probability > 1e-15)
    second, fourth = ((probability * score**power).sum(axis=1) for power in (2, 4))
    found = np.divide(fourth, np.square(second), out=np.full(len(y), LARGEST), where=second > 1e-12)
    return np.asarray(np.clip(found, 1.0, LARGEST))
