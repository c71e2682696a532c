"""The task: a 50/35 mm cylinder with nine unknown parameters, 96 candidates, and the 3^9 grid over the prior."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

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
OUTPUT_SCALES = np.array([0.5, 1e7, 1e7, 1.0])
OUTPUT_ROWS = [0, 2, 3, 4]

STORED = Path(__file__).resolve().parents[2] / "shared" / "reference" / "workload.npz"
"""The candidates of the reference values, where these lie beside the project."""

REGION = fp.ExperimentRegion(
    dict(q=(0.05, 0.45), v=(-0.4, 0.4), p_A=(2e6, 19e6), p_B=(2e6, 19e6), x_v=(-0.8, 0.8), u=(-1, 1), dt=(1e-3, 1e-2))
)


@dataclass(frozen=True)
class Pairs:
    """K experiment points with one theta each, (K, p), and the nodes of the grid that these are, (K,)."""

    points: fp.Experiments
    theta: Array
    nodes: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, rows: slice) -> Pairs:
        return Pairs(self.points[rows], self.theta[rows], self.nodes[rows])


@cache
def candidates() -> fp.Experiments:
    """96 points of which no trajectory on the grid meets a jump or leaves the domain: stored ones, or else drawn ones."""
    if STORED.exists():
        with np.load(STORED) as arrays:
            table = arrays["candidates"]
        return fp.Experiments(table[:, :5], table[:, 5:6], table[:, 6])
    return drawn_candidates()


def source() -> str:
    """Which candidates these are, for the reader of the figures."""
    return "stored candidates of the reference workload" if STORED.exists() else "candidates drawn with a fixed seed"


def drawn_candidates() -> fp.Experiments:
    """Draw 96 such points; the corners of the grid sort most of the others out before the whole grid is tried."""
    drawn = REGION.draw(MODEL, 8 * CANDIDATES, seed=7)
    for rule in (fp.TensorGrid(levels=1), fp.TensorGrid(levels=2), RULE):
        status = fp.predictive_covariance(MODEL, drawn, PRIOR, rule, jumps="exclude").status
        drawn = drawn[np.flatnonzero(status == fp.Status.ok)[: 2 * CANDIDATES]]
    if len(drawn) < CANDIDATES:
        raise RuntimeError(f"expected {CANDIDATES} valid candidates, drew {len(drawn)}")
    return drawn[:CANDIDATES]


def random_pairs(per_candidate: int, seed: int) -> Pairs:
    """Every candidate equally often, each time with a node of the grid drawn at random."""
    points, nodes = candidates(), RULE.nodes(PRIOR)[0]
    rows = np.repeat(np.arange(len(points)), per_candidate)
    chosen = np.random.default_rng(seed).integers(len(nodes), size=len(rows))
    return Pairs(points[rows], nodes[chosen], chosen)
