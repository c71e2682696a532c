"""Models, runs and files of the tests of measured runs."""

from __future__ import annotations

import numpy as np

import fisherpoint as fp
from oracle import Floats

THETA = {"k1": 1.0, "k2": 0.8}
NOISE = {"y": 0.01, "z": 0.02}


def tanks(**changes: object) -> fp.SymbolicModel:
    """Two tanks in a row; no output reads the input. Below zero there is no level."""
    given = {
        "states": {"a": "m", "b": "m"},
        "inputs": {"u": "1"},
        "outputs": {"y": "m", "z": "m"},
        "parameters": {"k1": "1", "k2": "1"},
        "constants": {"c": (1.0, "1")},
        "nominal": THETA,
    }
    return fp.SymbolicModel(["c*u - k1*sqrt(a)", "k1*sqrt(a) - k2*sqrt(b)"], ["b", "a"], **(given | changes))  # type: ignore[arg-type]


def drawn(count: int = 3, segments: int = 12, seed: int = 0, share: float = 0.7) -> fp.Runs:
    """Runs of random inputs, of which most ends are measured."""
    rng = np.random.default_rng(seed)
    measured = rng.random((count, segments)) < share
    measured[:, -1] = True
    u = rng.uniform(0.3, 1.6, (count, segments))
    return fp.Runs(rng.uniform(0.8, 1.4, (count, 2)), u, rng.uniform(0.1, 0.4, (count, segments)), measured)


def filled(runs: fp.Runs, y: Floats) -> Floats:
    """Outputs of runs, NaN where they are not measured."""
    return np.where(runs.measured[:, :, None], y, np.nan)


def with_gaps(data: fp.Measurements, seed: int = 1) -> fp.Measurements:
    """The same with a fifth of the numbers missing."""
    lost = np.random.default_rng(seed).random(data.y.shape) < 0.2
    return fp.Measurements(data.points, np.where(lost, np.nan, data.y))
