"""The task: a 45/28 mm cylinder with nine unknown parameters, 96 candidates, the 3^9 grid, and the accuracy that is asked."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import fisherpoint as fp

Array = NDArray[np.float64]

MODEL = fp.HydraulicCylinder(A_A=1.96e-3, A_B=1.00e-3, q_min=0.0, q_max=0.5, p_s=21e6, T_1=3e-3, k_u=-1.0)
PRIOR = fp.GaussianPrior(
    mean=dict(a_tau=300, b_tau=1500, m_q=150, E_oil=1.4e9, p_t=0.5e6, B_v=8.9e-7, c_L=5e-9, V_0A=1e-4, V_0B=1.2e-4),
    relative_std=dict(a_tau=0.3, b_tau=0.2, m_q=0.05, E_oil=0.2, p_t=0.2, B_v=0.1, c_L=0.3, V_0A=0.1, V_0B=0.1),
)
RULE = fp.TensorGrid(levels=3, span=1.5)
CANDIDATES = 96
STATE_SCALES = np.array([0.5, 1.0, 1e7, 1e7, 1.0])
OUTPUT_FLOOR = np.array([0.5, 1e7, 1e7, 1.0])
MEAN = np.array(list(PRIOR.mean.values()))
STD = np.array(list(PRIOR.std.values()))
TIGHT = 1e-12

TYPICAL_ERROR, LARGEST_ERROR = 1e-6, 1e-5
"""The accuracy rule: errors of y(dt), relative to max(|y|, OUTPUT_FLOOR), for 99 % of the trajectories, and for all."""


@dataclass(frozen=True)
class Pairs:
    """One theta for each of K experiment points, with the outputs (K, n_y) and dy/dtheta (K, n_y, p) of a tight solve."""

    points: fp.Experiments
    theta: Array
    y: Array
    dy_dtheta: Array

    def __len__(self) -> int:
        return len(self.points)


def candidates() -> tuple[fp.Experiments, str]:
    """96 points that are valid on the whole grid: those of the reference values where they lie beside the project."""
    path = Path(__file__).resolve().parents[2] / "shared" / "reference" / "workload.npz"
    if path.exists():
        with np.load(path) as arrays:
            table = arrays["candidates"]
        return fp.Experiments(table[:, :5], table[:, 5:6], table[:, 6]), "candidates of the reference workload"
    return _drawn(), "candidates drawn at random"


@cache
def _drawn() -> fp.Experiments:
    bounds = dict(q=(0.05, 0.45), v=(-0.5, 0.5), p_A=(3e6, 18e6), p_B=(3e6, 18e6), x_v=(-1, 1), u=(-1, 1), dt=(2e-3, 1.2e-2))
    drawn = fp.ExperimentRegion(bounds).draw(MODEL, 4000, np.random.default_rng(7))
    corners = fp.predictive_covariance(MODEL, drawn, PRIOR, fp.TensorGrid(levels=2, span=1.5))
    likely = drawn[np.flatnonzero(corners.status == fp.Status.ok)[: 2 * CANDIDATES]]
    status = fp.predictive_covariance(MODEL, likely, PRIOR, RULE).status
    return likely[np.flatnonzero(status == fp.Status.ok)[:CANDIDATES]]


def random_pairs(count: int, seed: int) -> Pairs:
    """Candidates with nodes of the grid, both at random."""
    rng = np.random.default_rng(seed)
    points = candidates()[0]
    points = points[rng.integers(len(points), size=count)]
    theta = RULE.nodes(PRIOR)[0][rng.integers(RULE.size(PRIOR), size=count)]
    tight = fp.sensitivities(MODEL, points, theta, rtol=TIGHT)
    return Pairs(points, theta, tight.y, tight.dy_dtheta)


def output_errors(y: Array, reference: Array) -> Array:
    """Largest relative error of the outputs of each trajectory, (K,)."""
    return np.asarray(np.max(np.abs(y - reference) / np.maximum(np.abs(reference), OUTPUT_FLOOR), axis=1))


def sensitivity_errors(dy_dtheta: Array, reference: Array) -> Array:
    """Largest error of dy/dtheta of each experiment, relative to the root mean square of the entry over all, (K,)."""
    size = np.sqrt(np.mean(reference**2, axis=0))
    return np.asarray(np.max(np.abs(dy_dtheta - reference) / np.where(size > 0, size, 1.0), axis=(1, 2)))


def meets_rule(errors: Array) -> bool:
    """Whether errors of outputs are within the accuracy rule."""
    return bool(np.quantile(errors, 0.99) < TYPICAL_ERROR and errors.max() < LARGEST_ERROR)


def error_figures(errors: Array) -> dict[str, Any]:
    return {"median": float(np.median(errors)), "99 %": float(np.quantile(errors, 0.99)), "worst": float(errors.max())}
