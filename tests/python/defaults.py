"""The default cylinder's problem in pieces that are small enough for tests."""

from __future__ import annotations

from typing import Any

import numpy as np

import fisherpoint as fp
from conftest import REGION, random_points

MODEL = fp.HydraulicCylinder()
NAMES = tuple(quantity.name for quantity in MODEL.parameters)
OUTPUTS = tuple(quantity.name for quantity in MODEL.outputs)
RELATIVE_STD = {
    "a_tau": 0.30,
    "b_tau": 0.20,
    "m_q": 0.05,
    "E_oil": 0.20,
    "p_t": 0.20,
    "B_v": 0.10,
    "c_L": 0.30,
    "V_0A": 0.10,
    "V_0B": 0.10,
}
PRIOR = fp.GaussianPrior(mean=MODEL.nominal, relative_std=RELATIVE_STD)
NOISE = {"q": 5e-6, "p_A": 2e4, "p_B": 2e4, "x_v": 1e-3}
KINDS = ("noise", "region", "pooled", "pointwise")


def grid(**levels: int) -> fp.TensorGrid:
    """A grid with the given levels and one level for the other parameters."""
    return fp.TensorGrid(levels=dict.fromkeys(NAMES, 1) | levels)


SMALL = grid(a_tau=3, E_oil=3, B_v=3)
"""27 nodes; every output but x_v varies."""


def problem(**changes: Any) -> fp.DesignProblem:
    """The default cylinder over the default region with a small grid and known noise, but for the changes."""
    arguments: dict[str, Any] = {
        "model": MODEL,
        "prior": PRIOR,
        "region": fp.ExperimentRegion(REGION),
        "noise": NOISE,
        "rule": SMALL,
    }
    return fp.DesignProblem(**(arguments | changes))


def valid_points(count: int, seed: int = 0, rule: fp.TensorGrid = SMALL, jumps: str = "cross") -> fp.Experiments:
    """Random points of the default region that are valid on the whole grid."""
    drawn = random_points(np.random.default_rng(seed), 20 * count)
    survives = fp.predictive_covariance(MODEL, drawn, PRIOR, rule, jumps=jumps).status == fp.Status.ok
    points = drawn[survives][:count]
    assert len(points) == count
    return points


def point(**values: float) -> fp.Experiments:
    """One point, by default in the middle of the region and harmless."""
    chosen = {"q": 0.15, "v": 0.2, "p_A": 6e6, "p_B": 10e6, "x_v": 0.3, "u": -0.3, "dt": 2e-3} | values
    row = list(chosen.values())
    return fp.Experiments([row[:5]], [row[5:6]], row[6:])


def same_bits(a: Any, b: Any) -> bool:
    """Whether two arrays are the same to the last bit, the sign of zero included."""
    return a.shape == b.shape and a.dtype == b.dtype and a.tobytes() == b.tobytes()
